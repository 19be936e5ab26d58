// SPDX-License-Identifier: MIT
#include "supervise/odometry.h"

#include <string.h>

#include "limits/limits.h"
#include "math/dense.h"
#include "math/leaky.h"
#include "math/se3.h"
#include "math/small.h"
#include "pelorus/assertions.h"
#include "pelorus/settings.h"
#include "supervise/doubt.h"
#include "supervise/sum.h"
#include "supervise/supervise.h"

void plr_odometry_forget(plr_supervisor *s) {
    memset(&s->sum, 0, sizeof s->sum);
    s->statistic = 0;
    s->weight = 1;
    s->contradicting_frames = 0;
    s->outright = 0;
}

static uint16_t one_more(uint16_t frames) {
    return (uint16_t)(frames + (frames < UINT16_MAX));
}

/* ---------------------------------------------------------------- a frame's own difference */

/* nu = (I + J)^-1 b in the odometry's own sigmas, and V = I - (I + J)^-1, its covariance if both are as
 * stated; J = (Lambda - I) / w^2 and b = Lambda nu^ / w^2 are what the pictures say. */
static bool own_difference(const plr_motion_evidence *m, plr_real nu[PLR_POSE_DIM],
                           plr_real V[PLR_POSE_TRIANGLE]) {
    plr_real J[PLR_POSE_SQUARE], U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN], C[PLR_POSE_SQUARE] = {0};
    plr_upper6_unpack(J, m->Lambda);
    plr_mat6_vec(nu, J, m->nu);
    const plr_real share = PLR_R(1) / (m->weight * m->weight);
    for (unsigned k = 0; k < PLR_POSE_SQUARE; k++)
        J[k] *= share;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        J[(PLR_POSE_DIM + 1) * k] += PLR_R(1) - share;
        nu[k] *= share;
    }
    plr_upper6_pack(U, J);
    if (!plr_cholesky_upper(PLR_POSE_DIM, U))
        return false;
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, nu, 1);
    plr_solve_upper(PLR_POSE_DIM, U, nu);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        C[(PLR_POSE_DIM + 1) * k] = 1;
    plr_solve_upper_transposed(PLR_POSE_DIM, PLR_POSE_DIM, U, C, PLR_POSE_DIM);
    for (unsigned k = 0, at = 0; k < PLR_POSE_DIM; k++) /* (I + J)^-1 = U^-1 U^-T */
        for (unsigned l = k; l < PLR_POSE_DIM; l++, at++) {
            V[at] = k == l ? PLR_R(1) : PLR_R(0);
            for (unsigned r = 0; r < PLR_POSE_DIM; r++)
                V[at] = PLR_FMA(-C[PLR_POSE_DIM * r + k], C[PLR_POSE_DIM * r + l], V[at]);
        }
    return true;
}

/* The mean difference of the last frames by pictures alone, in sigmas. */
static void lately(const plr_supervisor *s, plr_real floor, plr_real mean[PLR_POSE_DIM]) {
    plr_sum_by_pictures(s->sum.sum, s->sum.variance, floor, mean);
    for (unsigned k = 0; k < PLR_POSE_DIM;
         k++) /* s / V of a lasting difference is (1 + keep) of it */
        mean[k] /= PLR_R(1) + plr_limit(s->left_out, PLR_LIMIT_SUM_KEEPS);
}

/* ---------------------------------------------------------------- what is usual */

/* Once told it stays until the variances are usually less than half of that. */
static void judge_usual(plr_supervisor *s) {
    const plr_real limit =
        plr_limit(s->left_out, PLR_LIMIT_USUAL_TOLD) * (s->misfits ? PLR_R(0.5) : PLR_R(1));
    s->misfits = 0;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        s->misfits |= s->usual[k] > limit;
}

/* Learns from the sum, direction by direction, how much odometry and pictures differ on this drive. */
static void learn_usual(plr_supervisor *s) {
    const plr_real frames = plr_limit(s->left_out, PLR_LIMIT_USUAL_FRAMES);
    const plr_real most = plr_limit(s->left_out, PLR_LIMIT_USUAL_MOST);
    const plr_real step = plr_limit(s->left_out, PLR_LIMIT_USUAL_STEP);
    if (s->usual_frames < frames)
        s->usual_frames += PLR_R(1);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        const plr_real due = s->sum.variance[plr_upper_row(PLR_POSE_DIM, k)] +
                             plr_limit(s->left_out, PLR_LIMIT_UNOBSERVED);
        const plr_real square = s->sum.sum[k] * s->sum.sum[k] / due;
        const plr_real at_most = step * s->usual[k];
        const plr_real now = square < at_most ? square : at_most;
        s->usual[k] += (now - s->usual[k]) / (s->usual_frames + PLR_R(20));
        s->usual[k] = s->usual[k] < 1 ? PLR_R(1) : s->usual[k] > most ? most : s->usual[k];
    }
    judge_usual(s);
}

bool plr_odometry_has_before(const plr_supervisor *s) {
    const bool agreed = s->agreement >= plr_limit(s->left_out, PLR_LIMIT_BEFORE_SHARE);
    return (agreed && !s->misfits) || plr_doubt_contradicted(s);
}

/* ---------------------------------------------------------------- the difference of two poses */

/* d <- Ad(D^-1) d: d is the twist of the body from the pose by odometry to the pose by pictures. */
static void carry_difference(plr_supervisor *s, const plr_motion_evidence *m) {
    plr_real R[9], A[PLR_POSE_SQUARE], d[PLR_POSE_DIM];
    plr_se3_rotation(R, m->E);
    plr_se3_adjoint_inverse(A, R, m->p);
    memcpy(d, s->difference, sizeof d);
    plr_mat6_vec(s->difference, A, d);
}

void plr_odometry_differs(plr_supervisor *s, const plr_real n[PLR_POSE_DIM],
                          const plr_real nu[PLR_POSE_DIM], plr_real noise) {
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        s->difference[k] += n[k];
        s->difference_sigmas[k] += nu[k];
    }
    s->difference_noise += noise;
}

/* Of translation and rotation by itself the longer one: points that move along carry the pose further than
 * a frame's own difference n says. */
static void add_longer(plr_supervisor *s, const plr_motion_evidence *m,
                       const plr_real n[PLR_POSE_DIM], const plr_real nu[PLR_POSE_DIM],
                       plr_real noise) {
    plr_real more[PLR_POSE_DIM];
    for (unsigned half = 0; half < PLR_POSE_DIM; half += 3) {
        const plr_real *a = n + half, *b = m->moved + half;
        memcpy(more + half, plr_dot3(a, a) > plr_dot3(b, b) ? a : b, 3 * sizeof *more);
    }
    plr_odometry_differs(s, more, nu, noise);
}

static plr_real trace(const plr_real V[PLR_POSE_TRIANGLE]) {
    plr_real sum = 0;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        sum += V[plr_upper_row(PLR_POSE_DIM, k)];
    return sum;
}

void plr_odometry_cover(const plr_supervisor *s, const plr_real d[PLR_POSE_DIM],
                        plr_real C[PLR_POSE_SQUARE]) {
    const plr_real sideways = plr_limit(s->left_out, PLR_LIMIT_SIDEWAYS);
    const plr_real sigmas2 = plr_norm2_of_6(s->difference_sigmas);
    const plr_real unexplained =
        sigmas2 > s->difference_noise ? PLR_R(1) - s->difference_noise / sigmas2 : PLR_R(0);
    const plr_real way = sideways * sideways * plr_dot3(d, d);
    const plr_real turn = sideways * sideways * plr_dot3(d + 3, d + 3);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        for (unsigned j = 0; j < PLR_POSE_DIM; j++)
            C[PLR_POSE_DIM * i + j] = unexplained * (d[i] * d[j] + (i != j  ? PLR_R(0)
                                                                    : i < 3 ? way
                                                                            : turn));
}

void plr_odometry_settle(plr_supervisor *s) {
    memset(s->difference, 0, sizeof s->difference);
    memset(s->difference_sigmas, 0, sizeof s->difference_sigmas);
    s->difference_noise = 0;
    memset(&s->sum, 0, sizeof s->sum);
}

/* ---------------------------------------------------------------- a frame */

/* A frame that excludes the odometry by itself, and is followed. */
static void add_outright(plr_supervisor *s, const plr_motion_evidence *m, bool held) {
    plr_real n[PLR_POSE_DIM];
    plr_mat6_vec(n, m->L, m->nu);
    carry_difference(s, m);
    if (!held && s->scene == PLR_SCENE_MAY_MOVE)
        add_longer(s, m, n, m->nu, 0);
    memset(&s->sum, 0, sizeof s->sum);
}

/* From the present pose to the one by pictures alone: of the difference of the last frames what the odometry,
 * with the weight that it has, still holds back, L Lambda^-1 L^-1 n. */
static void differ_by_pictures(plr_supervisor *s, const plr_motion_evidence *m,
                               const plr_real nu[PLR_POSE_DIM]) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0};
    plr_real mean[PLR_POSE_DIM], n[PLR_POSE_DIM];
    lately(s, plr_limit(s->left_out, PLR_LIMIT_UNOBSERVED), mean);
    memcpy(U, m->Lambda, sizeof m->Lambda);
    if (!plr_cholesky_upper(PLR_POSE_DIM, U))
        return;
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, mean, 1);
    plr_solve_upper(PLR_POSE_DIM, U, mean);
    plr_mat6_vec(n, m->L, mean);
    plr_odometry_differs(s, n, nu, 0);
}

/* From the pose by odometry to the present one. */
static void differ_by_odometry(plr_supervisor *s, const plr_motion_evidence *m,
                               const plr_real nu[PLR_POSE_DIM],
                               const plr_real V[PLR_POSE_TRIANGLE]) {
    plr_real n[PLR_POSE_DIM], way[PLR_POSE_DIM];
    plr_sum_by_pictures(nu, V, plr_limit(s->left_out, PLR_LIMIT_UNOBSERVED), n);
    plr_mat6_vec(way, m->L, n);
    add_longer(s, m, way, nu, trace(V));
}

/* What the sum holds of the difference when it is found: by odometry what was applied of it, by pictures
 * what was not. */
static void begin_difference(plr_supervisor *s, const plr_motion_evidence *m) {
    const plr_real frames = PLR_R(1) / (PLR_R(1) - plr_limit(s->left_out, PLR_LIMIT_SUM_KEEPS));
    plr_real all[PLR_POSE_DIM], way[PLR_POSE_DIM];
    lately(s, plr_limit(s->left_out, PLR_LIMIT_WEAK), all);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        all[k] = s->scene == PLR_SCENE_MAY_MOVE ? s->sum.sum[k] : frames * all[k] - s->sum.sum[k];
    plr_mat6_vec(way, m->L, all);
    plr_odometry_differs(s, way, s->sum.sum, trace(s->sum.variance));
}

/* While it lasts, each frame adds what lies between the present pose and the other one that may be true: that
 * by odometry, where most of what is seen may move as one, or where both have always differed; else that by
 * the pictures alone. */
static void follow_difference(plr_supervisor *s, const plr_motion_evidence *m,
                              const plr_real nu[PLR_POSE_DIM], const plr_real V[PLR_POSE_TRIANGLE],
                              bool begins) {
    const bool lasts = s->doubt == PLR_DOUBT_DEPARTED || plr_doubt_contradicted(s);
    if (begins)
        begin_difference(s, m);
    else if (s->misfits || (lasts && s->scene == PLR_SCENE_MAY_MOVE))
        differ_by_odometry(s, m, nu, V);
    else if (lasts)
        differ_by_pictures(s, m, nu);
}

/* An average of the last frames, of those that may count: not of an event, nor shortly after it. One that
 * neither agrees nor departs may be the beginning of an event, and must not take its before away. */
static void learn_agreement(plr_supervisor *s) {
    const plr_real keeps = plr_limit(s->left_out, PLR_LIMIT_BEFORE_KEEPS);
    const bool agrees = s->statistic < plr_limit(s->left_out, PLR_LIMIT_AGREES_BELOW);
    if (agrees || s->statistic > plr_limit(s->left_out, PLR_LIMIT_DEPARTS_ABOVE))
        s->agreement = plr_leaky_sum(s->agreement, keeps, agrees ? PLR_R(1) - keeps : PLR_R(0));
}

plr_odometry_verdict plr_odometry_add(plr_supervisor *s, const plr_motion_evidence *m, bool held,
                                      bool tells) {
    plr_odometry_verdict verdict = {false, false, 0};
    plr_real nu[PLR_POSE_DIM], V[PLR_POSE_TRIANGLE];
    if (m->outright) {
        add_outright(s, m, held);
        verdict.contradicts = true;
        verdict.excess = plr_norm2_of_6(m->nu);
        return verdict;
    }
    if (!own_difference(m, nu, V))
        return verdict;
    const bool calm = s->doubt == PLR_DOUBT_NONE;
    carry_difference(s, m);
    plr_sum_add(&s->sum, plr_limit(s->left_out, PLR_LIMIT_SUM_KEEPS), nu, V);
    s->statistic =
        plr_sum_statistic(&s->sum, s->usual, plr_limit(s->left_out, PLR_LIMIT_UNOBSERVED));
    const bool before = plr_odometry_has_before(s);
    if ((calm || !before) && tells)
        learn_usual(s);
    if (calm || !before)
        learn_agreement(s);
    const plr_real weighed =
        plr_sum_statistic(&s->sum, s->usual, plr_limit(s->left_out, PLR_LIMIT_WEAK));
    const bool contradicts = weighed > plr_limit(s->left_out, PLR_LIMIT_CONTRADICTS_ABOVE);
    s->contradicting_frames = contradicts ? one_more(s->contradicting_frames) : 0;
    verdict.contradicts =
        before && s->slips && !plr_doubt_contradicted(s) &&
        s->contradicting_frames >= plr_limit_count(s->left_out, PLR_LIMIT_CONTRADICTS_FRAMES);
    verdict.departs = before && s->statistic > plr_limit(s->left_out, PLR_LIMIT_DEPARTS_ABOVE);
    if (!held)
        follow_difference(s, m, nu, V, verdict.departs && (calm || s->doubt == PLR_DOUBT_SETTLING));
    return verdict;
}

void plr_odometry_weigh(plr_supervisor *s, plr_real excess) {
    const plr_real keeps = plr_limit(s->left_out, PLR_LIMIT_SUM_KEEPS);
    const plr_real before = s->slips ? PLR_R(0) : PLR_FMA(s->weight, s->weight, -PLR_R(1));
    s->weight = 1;
    if (!plr_doubt_contradicted(s))
        return;
    const plr_real now =
        plr_sum_statistic(&s->sum, s->usual, plr_limit(s->left_out, PLR_LIMIT_WEAK));
    const plr_real lost =
        plr_limit(s->left_out, PLR_LIMIT_WEIGHT_LOST) * (now > excess ? now : excess);
    const plr_real fades = keeps * keeps * before;
    s->weight = PLR_SQRT((lost > fades ? lost : fades) + PLR_R(1));
    PLR_ASSERT(s->weight >= 1);
}
