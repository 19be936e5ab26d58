// SPDX-License-Identifier: MIT
#include "filter/consistency.h"

#include <string.h>

#include "filter/health.h"
#include "filter/map_check.h"
#include "filter/relocate.h"
#include "filter/scene.h"
#include "filter/votes.h"
#include "filter/windows.h"
#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "process/process.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "state/motion.h"
#include "state/slots.h"

enum {
    AGREEING_FRAMES = 15, /* successive frames in agreement that end any doubt */
    KEPT_FRAMES = 600,    /* a doubt that lasts longer is no event: biases are taught again */
    FEW = 3,              /* points */
    FROZEN_SHARE = 2 /* a picture is repeated if at least one match in two has the same pixels */
};

/* Chi-square with 6 degrees of freedom: white noise exceeds these once in 60,000 and once in 70. */
#define DRIFTING_ABOVE PLR_R(32)
#define AGREEING_BELOW PLR_R(16)
/* Noise settings are never quite true. The twists get less weight only where the difference exceeds
 * its noise by far, and is a good part of the motion itself: a filter that doubted them earlier
 * would lose the information that they have. */
#define CONTRADICTED_ABOVE PLR_R(40)
#define SHARE_OF_MOTION    PLR_R(0.15)
#define MIN_WAY            PLR_R(0.004) /* m a frame */
#define MIN_TURN           PLR_R(0.004) /* rad a frame */
/* Q grows by this much of the statistic. With a third of it, stopped wheels still shorten the way
 * by 3 %; with four times as much, the filter follows a moving scene completely. */
#define WIDENING PLR_R(0.5)
/* Wheels that slip leave the gyro as good as it was: the turns keep their weight unless they are
 * contradicted themselves, and lose as much as the way if that is a good part of the turn. White noise
 * exceeds this once in 100 (chi-square, 3 degrees of freedom). */
#define TURNS_BELOW PLR_R(11.3)
/* The excess of a frame that contradicted the twists by itself counts in the next frames too, less
 * in each. */
#define EXCESS_DECAY PLR_R(0.8)
/* The difference between the poses by twists and by pictures is known to about this part of its
 * size. */
#define SIDEWAYS_SHARE PLR_R(0.2)
/* Added to variances, so that directions in which the pictures say little do not count. What is told
 * looks at all that they say; UNOBSERVED is above the rounding of the sums alone. Distant points say
 * little about the way, and what that little says is worth telling. Taking weight from the twists
 * asks for more: real pixels have small lasting errors, which add up in weak directions. */
#define UNOBSERVED PLR_R(0.001)
#define WEAK       PLR_R(0.05)
/* A bias is off if it differs from its prior by more than this many sigmas: of six that are as
 * stated one does so in about one drive of 1000. A bias is not judged before it has lost this share
 * of its prior's variance. */
#define BIAS_SIGMAS  PLR_R(4.2)
#define LEARNT_SHARE PLR_R(0.25)

void plr_consistency_clear(plr_filter *f) {
    memset(&f->consistency, 0, sizeof f->consistency);
    plr_scene_clear(f);
    plr_map_check_clear(f);
    plr_votes_clear(f);
}

/* ---------------------------------------------------------------- what is material */

static plr_real larger(plr_real a, plr_real b) {
    return a > b ? a : b;
}

/* Which parts of a difference n of a frame's motion are a good part of that motion. */
typedef struct plr_material {
    bool way, turn;
} plr_material;

static plr_material material(const plr_real n[PLR_POSE_DIM], const plr_applied_motion *motion) {
    plr_real turn[3];
    plr_turn_of(turn, motion->E);
    const plr_real way = SHARE_OF_MOTION * PLR_SQRT(plr_dot3(motion->p, motion->p)) + MIN_WAY;
    const plr_real angle = SHARE_OF_MOTION * PLR_SQRT(plr_dot3(turn, turn)) + MIN_TURN;
    return (plr_material){plr_dot3(n, n) > way * way, plr_dot3(n + 3, n + 3) > angle * angle};
}

/* The same of the mean difference of the last frames, which is in units of L. */
static plr_material lately_material(const plr_filter *f, const plr_real L[PLR_POSE_SQUARE],
                                    const plr_applied_motion *motion) {
    plr_real mean[PLR_POSE_DIM], n[PLR_POSE_DIM];
    plr_windows_mean(f, WEAK, mean);
    plr_mat6_vec(n, L, mean);
    return material(n, motion);
}

/* ---------------------------------------------------------------- the twists' weight */

/* By how much a standard deviation of Q grows. */
static plr_real widening(plr_real statistic) {
    return PLR_SQRT(PLR_FMA(WIDENING, statistic, PLR_R(1)));
}

void plr_consistency_widen(plr_filter *f, plr_applied_motion *believed) {
    plr_consistency *c = &f->consistency;
    plr_motion_prior(f, believed);
    if (!c->contradicted)
        return;
    const plr_statistic fast = plr_windows_fast(f, WEAK, NULL);
    const plr_real turns = larger(fast.turns, c->excess_turn);
    const plr_real way = widening(larger(fast.all, c->excess));
    const bool fails =
        c->excess_turn > TURNS_BELOW || lately_material(f, believed->L, believed).turn;
    const plr_real turn = !(turns > TURNS_BELOW) ? PLR_R(1) : fails ? way : widening(turns);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        for (unsigned j = 0; j < PLR_POSE_DIM; j++)
            f->motion.Q[PLR_POSE_DIM * i + j] *= (i < 3 ? way : turn) * (j < 3 ? way : turn);
    c->excess *= EXCESS_DECAY;
    c->excess_turn *= EXCESS_DECAY;
}

/* Converts a frame's information J, b about nu from units of L, the widened noise, to units of
 * `own`, the twists' own: with T = L^-1 own, J <- T^T J T and b <- T^T b. */
static void to_twist_sigmas(const plr_real L[PLR_POSE_SQUARE], const plr_real own[PLR_POSE_SQUARE],
                            plr_real J[PLR_POSE_SQUARE], plr_real b[PLR_POSE_DIM]) {
    plr_real T[PLR_POSE_SQUARE] = {0}, TtJ[PLR_POSE_SQUARE] = {0}, turned[PLR_POSE_DIM] = {0};
    for (unsigned c = 0; c < PLR_POSE_DIM; c++)
        for (unsigned r = c; r < PLR_POSE_DIM; r++) {
            plr_real sum = own[PLR_POSE_DIM * r + c];
            for (unsigned l = c; l < r; l++)
                sum = PLR_FMA(-L[PLR_POSE_DIM * r + l], T[PLR_POSE_DIM * l + c], sum);
            T[PLR_POSE_DIM * r + c] =
                L[(PLR_POSE_DIM + 1) * r] > 0 ? sum / L[(PLR_POSE_DIM + 1) * r] : 0;
        }
    for (unsigned r = 0; r < PLR_POSE_DIM; r++)
        for (unsigned c = 0; c < PLR_POSE_DIM; c++)
            for (unsigned l = 0; l < PLR_POSE_DIM; l++) {
                TtJ[PLR_POSE_DIM * r + c] = PLR_FMA(
                    T[PLR_POSE_DIM * l + r], J[PLR_POSE_DIM * l + c], TtJ[PLR_POSE_DIM * r + c]);
                if (c == 0)
                    turned[r] = PLR_FMA(T[PLR_POSE_DIM * l + r], b[l], turned[r]);
            }
    plr_mat6_mul(J, TtJ, T);
    memcpy(b, turned, sizeof turned);
}

/* nu = (I + J)^-1 b, and V = I - (I + J)^-1, its covariance if the twists' noise is as stated. */
static bool estimate(const plr_real J[PLR_POSE_SQUARE], const plr_real b[PLR_POSE_DIM],
                     plr_real nu[PLR_POSE_DIM], plr_real V[PLR_POSE_TRIANGLE]) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0}, C[PLR_POSE_SQUARE] = {0};
    for (unsigned k = 0, at = 0; k < PLR_POSE_DIM; k++)
        for (unsigned l = k; l < PLR_POSE_DIM; l++, at++)
            U[at] = PLR_R(0.5) * (J[PLR_POSE_DIM * k + l] + J[PLR_POSE_DIM * l + k]) +
                    (k == l ? PLR_R(1) : PLR_R(0));
    if (!plr_cholesky_upper(PLR_POSE_DIM, U))
        return false;
    memcpy(nu, b, PLR_POSE_DIM * sizeof *nu);
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, nu, 1);
    plr_solve_upper(PLR_POSE_DIM, U, nu);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        C[(PLR_POSE_DIM + 1) * k] = 1;
    plr_solve_upper_transposed(PLR_POSE_DIM, PLR_POSE_DIM, U, C,
                               PLR_POSE_DIM); /* U^-T; (I + J)^-1 = U^-1 U^-T */
    for (unsigned k = 0, at = 0; k < PLR_POSE_DIM; k++)
        for (unsigned l = k; l < PLR_POSE_DIM; l++, at++) {
            V[at] = k == l ? PLR_R(1) : PLR_R(0);
            for (unsigned r = 0; r < PLR_POSE_DIM; r++)
                V[at] = PLR_FMA(-C[PLR_POSE_DIM * r + k], C[PLR_POSE_DIM * r + l], V[at]);
        }
    return true;
}

/* ---------------------------------------------------------------- the contradiction */

static plr_real trace(const plr_real V[PLR_POSE_TRIANGLE]) {
    plr_real sum = 0;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        sum += V[plr_upper_row(PLR_POSE_DIM, k)];
    return sum;
}

/* d <- Ad(D^-1) d: d is the twist of the body from the pose by twists to the pose by pictures. */
static void propagate_difference(plr_filter *f, const plr_applied_motion *applied) {
    plr_real R[9], A[PLR_POSE_SQUARE], d[PLR_POSE_DIM];
    plr_se3_rotation(R, applied->E);
    plr_se3_adjoint_inverse(A, R, applied->p);
    memcpy(d, f->consistency.difference, sizeof d);
    plr_mat6_vec(f->consistency.difference, A, d);
}

/* Of a difference that is added to d: nu in sigmas, and the expected square of nu if it is only noise. */
static void add_sigmas(plr_filter *f, const plr_real nu[PLR_POSE_DIM], plr_real noise) {
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        f->consistency.difference_sigmas[k] += nu[k];
    f->consistency.difference_noise += noise;
}

/* d <- d + n, or + what the frame moved the pose by beside the twists, if that is more: points that
 * move along carry landmarks and pose further than a frame's own n says. Translation and rotation
 * each by itself. nu is n in the twists' own sigmas, and `noise` the expected square of nu if it is
 * only noise. */
static void add_difference(plr_filter *f, const plr_real n[PLR_POSE_DIM],
                           const plr_real moved[PLR_POSE_DIM], const plr_real nu[PLR_POSE_DIM],
                           plr_real noise) {
    if (plr_health_readings_are_old(f))
        return;
    for (unsigned half = 0; half < PLR_POSE_DIM; half += 3) {
        const plr_real *a = n + half, *b = moved + half;
        const plr_real *more = plr_dot3(a, a) > plr_dot3(b, b) ? a : b;
        for (unsigned k = 0; k < 3; k++)
            f->consistency.difference[half + k] += more[k];
    }
    add_sigmas(f, nu, noise);
}

/* v = L^-1 n */
static void in_sigmas(const plr_real L[PLR_POSE_SQUARE], const plr_real n[PLR_POSE_DIM],
                      plr_real v[PLR_POSE_DIM]) {
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        v[k] = n[k];
        for (unsigned l = 0; l < k; l++)
            v[k] = PLR_FMA(-L[PLR_POSE_DIM * k + l], v[l], v[k]);
        v[k] = L[(PLR_POSE_DIM + 1) * k] > 0 ? v[k] / L[(PLR_POSE_DIM + 1) * k] : 0;
    }
}

static void contradict(plr_filter *f) {
    f->totals.contradictions++;
    f->consistency.contradicted = f->consistency.drifting = 1;
    plr_windows_clear(f);
}

/* A drift has been found: the difference begins with what has accumulated in a window. */
static void begin_difference(plr_filter *f, const plr_applied_motion *believed,
                             const plr_consistency_window *w) {
    plr_real way[PLR_POSE_DIM];
    plr_mat6_vec(way, believed->L, w->sum);
    add_difference(f, way, way, w->sum, trace(w->variance));
}

/* A frame that contradicts the twists by itself. */
static void contradict_outright(plr_filter *f, const plr_applied_motion *believed,
                                const plr_applied_motion *applied, const plr_real nu[PLR_POSE_DIM],
                                const plr_real moved[PLR_POSE_DIM]) {
    plr_consistency *c = &f->consistency;
    plr_real n[PLR_POSE_DIM], own[PLR_POSE_DIM];
    plr_mat6_vec(n, applied->L, nu);
    in_sigmas(believed->L, n, own);
    propagate_difference(f, applied);
    add_difference(f, n, moved, own, 0);
    contradict(f);
    c->excess = plr_norm2_of_6(own);
    c->excess_turn = material(n, applied).turn ? plr_dot3(own + 3, own + 3) : PLR_R(0);
}

/* Whether what has accumulated in the windows is more than noise. */
static void look_for_drift(plr_filter *f, const plr_applied_motion *believed,
                           const plr_kept_bias *kept) {
    plr_consistency *c = &f->consistency;
    c->fast = plr_windows_fast(f, UNOBSERVED, kept).all;
    const plr_real slow = plr_windows_slow(f, UNOBSERVED, kept).all;
    const plr_real most = larger(c->fast, slow);
    if (!c->contradicted && !c->drifting && most > DRIFTING_ABOVE)
        begin_difference(f, believed,
                         &c->windows[slow > c->fast ? PLR_SLOW_WINDOW : PLR_FAST_WINDOW]);
    c->drifting = most > DRIFTING_ABOVE || (c->drifting && most > AGREEING_BELOW);
}

static uint16_t one_more(uint16_t frames) {
    return (uint16_t)(frames + (frames < UINT16_MAX));
}

/* Whether it is so much, and material for so long, that the twists get less weight. */
static void weigh_twists(plr_filter *f, const plr_applied_motion *believed,
                         const plr_applied_motion *applied, const plr_kept_bias *kept) {
    plr_consistency *c = &f->consistency;
    const plr_material part = lately_material(f, believed->L, applied);
    const bool much = part.way || part.turn;
    const bool contradicts = much && plr_windows_fast(f, WEAK, kept).all > CONTRADICTED_ABOVE;
    c->small_frames = much ? 0 : one_more(c->small_frames);
    c->contradicting_frames = contradicts ? one_more(c->contradicting_frames) : 0;
    if (!c->contradicted && c->contradicting_frames >= FEW && !plr_votes_trust_twists(f)) {
        const plr_consistency_window fastest = c->windows[PLR_FASTEST_WINDOW];
        contradict(f);
        c->windows[PLR_FASTEST_WINDOW] = fastest;
    } else if (c->small_frames >= AGREEING_FRAMES) {
        c->contradicted = 0;
    }
}

void plr_consistency_add(plr_filter *f, const plr_applied_motion *believed,
                         const plr_applied_motion *applied, const plr_real nu[PLR_POSE_DIM],
                         const plr_real Lambda[PLR_POSE_TRIANGLE],
                         const plr_real moved[PLR_POSE_DIM], const plr_real *kept_bias,
                         bool outright) {
    plr_consistency *c = &f->consistency;
    plr_kept_bias kept;
    plr_real J[PLR_POSE_SQUARE], b[PLR_POSE_DIM], own[PLR_POSE_DIM], V[PLR_POSE_TRIANGLE];
    if (outright) {
        contradict_outright(f, believed, applied, nu, moved);
        return;
    }
    plr_upper6_unpack(J, Lambda);
    plr_mat6_vec(b, J, nu);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        J[(PLR_POSE_DIM + 1) * k] -= 1;
    if (c->contradicted)
        to_twist_sigmas(applied->L, believed->L, J, b);
    if (!estimate(J, b, own, V))
        return;
    if (c->contradicted || c->drifting ||
        c->settling_frames > 0) /* it stays until it is resolved */
        propagate_difference(f, applied);
    if (c->contradicted || c->drifting) {
        plr_real n[PLR_POSE_DIM], way[PLR_POSE_DIM];
        plr_by_pictures_alone(own, V, UNOBSERVED, n);
        plr_mat6_vec(way, believed->L, n);
        add_difference(f, way, moved, own, trace(V));
    }
    plr_windows_add(f, own, V, !c->contradicted && !plr_health_readings_are_old(f));
    plr_windows_keep_bias(f, kept_bias, V, &kept);
    look_for_drift(f, believed, &kept);
    weigh_twists(f, believed, applied, &kept);
}

/* ---------------------------------------------------------------- the verdict */

/* If prior and noise are as stated, an estimate differs from the mean of its prior by N(0, P_0 - P),
 * with P_0 the prior's variance and the walk's since: by less than the prior's sigma as long as
 * little has been learnt. */
static bool bias_is_off(const plr_filter *f) {
    plr_real P[PLR_POSE_SQUARE];
    plr_covariance_get(f, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, P);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        const plr_real prior = plr_bias_prior_variance(f, k), off = f->bias[k] - f->bias_prior[k];
        const plr_real learnt = prior - P[(PLR_POSE_DIM + 1) * k];
        if (prior > 0 && learnt > LEARNT_SHARE * prior &&
            off * off > BIAS_SIGMAS * BIAS_SIGMAS * learnt)
            return true;
    }
    return false;
}

static uint32_t find_reasons(const plr_filter *f, plr_scene_verdict scene) {
    const plr_consistency *c = &f->consistency;
    uint32_t reasons = plr_scene_noise_reasons(f);
    if (c->contradicted || c->drifting)
        reasons |= PLR_REASON_TWIST_CONTRADICTED;
    if (c->frozen)
        reasons |= PLR_REASON_FROZEN_IMAGE;
    if (plr_has_block(f, PLR_BLOCK_BIAS) && bias_is_off(f))
        reasons |= PLR_REASON_BIAS_OFF_PRIOR;
    if (scene != PLR_SCENE_AGREES)
        reasons |= PLR_REASON_SCENE_DISAGREES;
    return reasons;
}

/* C = s (d d^T + a share of |d|^2 in all directions, because d is not known better than that). s is
 * the share of d that the twists' noise does not explain; the rest is in P already. */
static void covariance_of(const plr_filter *f, const plr_real d[PLR_POSE_DIM],
                          plr_real C[PLR_POSE_SQUARE]) {
    const plr_real sigmas2 = plr_norm2_of_6(f->consistency.difference_sigmas);
    const plr_real noise = f->consistency.difference_noise;
    const plr_real s = sigmas2 > noise ? PLR_R(1) - noise / sigmas2 : PLR_R(0);
    const plr_real way = SIDEWAYS_SHARE * SIDEWAYS_SHARE * plr_dot3(d, d);
    const plr_real turn = SIDEWAYS_SHARE * SIDEWAYS_SHARE * plr_dot3(d + 3, d + 3);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        for (unsigned j = 0; j < PLR_POSE_DIM; j++)
            C[PLR_POSE_DIM * i + j] = s * (d[i] * d[j] + (i != j ? PLR_R(0) : i < 3 ? way : turn));
}

/* Twists and pictures have agreed for long enough: the difference between their poses is added to
 * P. */
static void resolve(plr_filter *f) {
    plr_consistency *c = &f->consistency;
    if (plr_norm2_of_6(c->difference) > 0) {
        plr_real C[PLR_POSE_SQUARE];
        covariance_of(f, c->difference, C);
        plr_covariance_add(f, PLR_BLOCK_POSE, C);
        plr_relocate_let_go(f, C);
        f->totals.widened++;
    }
    memset(c->difference, 0, sizeof c->difference);
    memset(c->difference_sigmas, 0, sizeof c->difference_sigmas);
    c->difference_noise = 0;
    plr_windows_clear(f);
    c->contradicted = c->drifting = c->settling_frames = c->relocated = 0;
    c->agreeing_frames = c->doubted_frames = 0;
}

void plr_consistency_trust_twists(plr_filter *f) {
    plr_consistency *c = &f->consistency;
    plr_windows_clear(f);
    c->contradicted = 0;
    c->contradicting_frames = 0;
    c->excess = c->excess_turn = 0;
}

void plr_consistency_cover(plr_filter *f, const plr_real n[PLR_POSE_DIM],
                           const plr_real nu[PLR_POSE_DIM], plr_real noise) {
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        f->consistency.difference[k] += n[k];
    add_sigmas(f, nu, noise);
    plr_consistency_doubt(f);
}

void plr_consistency_doubt(plr_filter *f) {
    f->consistency.settling_frames = AGREEING_FRAMES;
}

uint32_t plr_consistency_judge(plr_filter *f, const plr_report *report, bool lost) {
    plr_consistency *c = &f->consistency;
    const plr_scene_verdict scene = plr_scene_add(f, report);
    const uint32_t reasons = find_reasons(f, scene);
    const bool doubtful = lost || c->contradicted || c->frozen || scene == PLR_SCENE_SPLIT;
    if (doubtful)
        plr_consistency_doubt(f);
    else if ((c->drifting || scene == PLR_SCENE_WORSE) && c->settling_frames < AGREEING_FRAMES)
        c->settling_frames++; /* as long as it lasted, so that noise is soon forgotten */
    if (lost || c->contradicted || c->frozen || c->doubted_frames > 0)
        c->doubted_frames = one_more(c->doubted_frames);
    const bool agrees = !lost && !c->frozen && !c->drifting && report->used >= FEW &&
                        c->fast < AGREEING_BELOW && scene == PLR_SCENE_AGREES;
    c->agreeing_frames = agrees ? one_more(c->agreeing_frames) : 0;
    if (c->settling_frames > 0 && c->agreeing_frames >= c->settling_frames)
        resolve(f);
    return c->settling_frames > 0 ? reasons | PLR_REASON_POSE_MAY_BE_WRONG : reasons;
}

bool plr_consistency_keeps_biases(const plr_filter *f) {
    const plr_consistency *c = &f->consistency;
    return c->contradicted || (c->doubted_frames > 0 && c->doubted_frames < KEPT_FRAMES);
}

void plr_consistency_enlarge(const plr_filter *f, plr_real P_xi[PLR_POSE_SQUARE]) {
    const plr_motion *m = &f->motion;
    plr_real R[9], A[PLR_POSE_SQUARE], d[PLR_POSE_DIM];
    if (!(plr_norm2_of_6(f->consistency.difference) > 0))
        return;
    plr_se3_rotation(R, m->E);
    plr_se3_adjoint_inverse(A, R, m->p);
    plr_mat6_vec(d, A, f->consistency.difference);
    plr_real C[PLR_POSE_SQUARE];
    covariance_of(f, d, C);
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        P_xi[i] += C[i];
}
