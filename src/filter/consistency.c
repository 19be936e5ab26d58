// SPDX-License-Identifier: MIT
#include "filter/consistency.h"

#include <string.h>

#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "state/motion.h"
#include "state/slots.h"

enum {
    FAST_WINDOWS = 2,    /* they decide whether the twists are believed */
    SETTLED_FRAMES = 15, /* in agreement, one after the other, before all is well again */
    FEW = 3,             /* points */
    FROZEN_SHARE = 2,    /* one in so many */
    STALE_FRAMES = 10    /* frames until a share of rejected matches counts */
};

/* How much of the past a window keeps from frame to frame: they look back some 4, 19 and 130 frames. */
static const plr_real keeps[PLR_CONSISTENCY_WINDOWS] = {PLR_R(0.6), PLR_R(0.9), PLR_R(0.985)};

/* Chi-square, 6 degrees of freedom: told beyond 1 in 25,000, in agreement again below 1 in 70. */
#define DIFFERS PLR_R(30)
#define AGREES  PLR_R(16)
/* Noise settings are never quite true. A filter that gave up its twists whenever they differ by more than
 * their noise would lose what they are good for: they are taken at less than their word only where they
 * differ by much more, and by a good part of the motion itself. */
#define CONTRADICTED PLR_R(40)
#define SHARE_OF_WAY PLR_R(0.15)
#define LEAST_WAY    PLR_R(0.004) /* m a frame */
/* By how much of the statistic: at a third of it the twists' pull still shortens the way by 3 %, and twice
 * as much would follow a scene that moves with its whole weight. */
#define WIDENING PLR_R(0.5)
/* What one frame said outright against the twists holds for the next ones too, fading. */
#define EXCESS_KEEPS PLR_R(0.8)
/* How well the way between two stories is known, beside its own direction. */
#define SIDEWAYS   PLR_R(0.2)
#define LEAST_TURN PLR_R(0.004) /* rad a frame */
/* Directions that hardly anything was seen of do not count. */
#define UNSEEN PLR_R(0.05)
/* The bias is off its prior beyond so many sigmas of it. */
#define OFF_PRIOR PLR_R(3.3)
/* Fading sums of the counts keep so much. */
#define COUNTS_KEEP PLR_R(0.9)
/* More rejected than this share: the scene does not agree with itself. */
#define REJECTED_SHARE PLR_R(0.3)
/* Means of d^2 per degree of freedom, over the window of the counts. */
#define NIS_HIGH PLR_R(1.5)
#define NIS_LOW  PLR_R(0.3)
#define NIS_DOF  PLR_R(200)
/* The twists' motion while the picture stays the same, squared, in its own variances. */
#define MOVED PLR_R(36)

void plr_consistency_clear(plr_filter *f) {
    memset(&f->consistency, 0, sizeof f->consistency);
}

/* ---------------------------------------------------------------- the windows */

/* s^T (V + UNSEEN I)^-1 s */
static plr_real statistic(const plr_consistency_window *w) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0}, s[PLR_POSE_DIM];
    memcpy(U, w->variance, sizeof w->variance);
    memcpy(s, w->sum, sizeof s);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        U[plr_upper_row(PLR_POSE_DIM, k)] += UNSEEN;
    if (!plr_cholesky_upper(PLR_POSE_DIM, U))
        return 0;
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, s, 1);
    return plr_dot3(s, s) + plr_dot3(s + 3, s + 3);
}

static plr_real fast_statistic(const plr_filter *f) {
    const plr_real a = statistic(&f->consistency.windows[0]);
    const plr_real b = statistic(&f->consistency.windows[1]);
    return a > b ? a : b;
}

void plr_consistency_widen(plr_filter *f, plr_applied_motion *believed) {
    plr_motion_prior(f, believed);
    if (!f->consistency.contradicted)
        return;
    const plr_real fast = fast_statistic(f), excess = f->consistency.excess;
    const plr_real factor = PLR_R(1) + (fast > excess ? fast : excess) * WIDENING;
    f->consistency.excess *= EXCESS_KEEPS;
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        f->motion.Q[i] *= factor;
}

/* What a frame says of nu in the twists' own sigmas: from units of applied->L to those of believed->L.
 * With T = L'^-1 L, J <- T^T J T, b <- T^T b. */
static void in_own_sigmas(const plr_real L[PLR_POSE_SQUARE], const plr_real own[PLR_POSE_SQUARE],
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

/* nu = (I + J)^-1 b and V = I - (I + J)^-1, its covariance if the twists are what they say. */
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
                               PLR_POSE_DIM); /* U^-T; (I + J)^-1 = its square */
    for (unsigned k = 0, at = 0; k < PLR_POSE_DIM; k++)
        for (unsigned l = k; l < PLR_POSE_DIM; l++, at++) {
            V[at] = k == l ? PLR_R(1) : PLR_R(0);
            for (unsigned r = 0; r < PLR_POSE_DIM; r++)
                V[at] = PLR_FMA(-C[PLR_POSE_DIM * r + k], C[PLR_POSE_DIM * r + l], V[at]);
        }
    return true;
}

/* n = (V + UNSEEN I)^-1 nu: what the observations alone make of it, where they see it. */
static void by_vision_alone(const plr_real nu[PLR_POSE_DIM], const plr_real V[PLR_POSE_TRIANGLE],
                            plr_real n[PLR_POSE_DIM]) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0};
    memcpy(U, V, PLR_POSE_TRIANGLE * sizeof *V);
    memcpy(n, nu, PLR_POSE_DIM * sizeof *nu);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        U[plr_upper_row(PLR_POSE_DIM, k)] += UNSEEN;
    if (!plr_cholesky_upper(PLR_POSE_DIM, U))
        return;
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, n, 1);
    plr_solve_upper(PLR_POSE_DIM, U, n);
}

static void fade_in(plr_consistency_window *w, plr_real keep, const plr_real nu[PLR_POSE_DIM],
                    const plr_real V[PLR_POSE_TRIANGLE]) {
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        w->sum[k] = PLR_FMA(keep, w->sum[k], nu[k]);
    for (unsigned k = 0; k < PLR_POSE_TRIANGLE; k++)
        w->variance[k] = PLR_FMA(keep * keep, w->variance[k], V[k]);
}

/* ---------------------------------------------------------------- the contradiction */

static plr_real trace(const plr_real V[PLR_POSE_TRIANGLE]) {
    plr_real sum = 0;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        sum += V[plr_upper_row(PLR_POSE_DIM, k)];
    return sum;
}

/* d <- Ad(D^-1) d + n: the way between the two stories, in the body as it stands now. nu is the same in
 * the twists' own sigmas, and `noise` is what its square would be by their noise alone. */
static void carry_apart(plr_filter *f, const plr_applied_motion *applied,
                        const plr_real n[PLR_POSE_DIM], const plr_real nu[PLR_POSE_DIM],
                        plr_real noise) {
    plr_real R[9], A[PLR_POSE_SQUARE], d[PLR_POSE_DIM];
    plr_se3_rotation(R, applied->E);
    plr_se3_adjoint_inverse(A, R, applied->p);
    plr_mat6_vec(d, A, f->consistency.apart);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        f->consistency.apart[k] = d[k] + n[k];
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        f->consistency.apart_sigmas[k] += nu[k];
    f->consistency.apart_noise += noise;
}

/* Is what the last frames make of the difference a good part of the motion? */
static bool differs_much(const plr_consistency_window *w, const plr_real L[PLR_POSE_SQUARE],
                         const plr_applied_motion *applied) {
    plr_real mean[PLR_POSE_DIM], n[PLR_POSE_DIM];
    by_vision_alone(w->sum, w->variance, mean);
    plr_mat6_vec(n, L, mean);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        n[k] /= PLR_R(1) + keeps[0]; /* of sums over frames to the mean of a frame */
    plr_real turn[3];
    plr_turn_of(turn, applied->E);
    const plr_real way = SHARE_OF_WAY * PLR_SQRT(plr_dot3(applied->p, applied->p)) + LEAST_WAY;
    const plr_real angle = SHARE_OF_WAY * PLR_SQRT(plr_dot3(turn, turn)) + LEAST_TURN;
    return plr_dot3(n, n) > way * way || plr_dot3(n + 3, n + 3) > angle * angle;
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
    memset(f->consistency.windows, 0, sizeof f->consistency.windows);
}

void plr_consistency_add(plr_filter *f, const plr_applied_motion *believed,
                         const plr_applied_motion *applied, const plr_real nu[PLR_POSE_DIM],
                         const plr_real Lambda[PLR_POSE_TRIANGLE], bool outright) {
    plr_consistency *c = &f->consistency;
    plr_real J[PLR_POSE_SQUARE], b[PLR_POSE_DIM], own[PLR_POSE_DIM], V[PLR_POSE_TRIANGLE],
        n[PLR_POSE_DIM];
    if (outright) {
        plr_mat6_vec(n, applied->L, nu);
        in_sigmas(believed->L, n, own);
        carry_apart(f, applied, n, own, 0);
        contradict(f);
        c->excess = plr_norm2_of_6(own);
        return;
    }
    for (unsigned k = 0, at = 0; k < PLR_POSE_DIM; k++)
        for (unsigned l = k; l < PLR_POSE_DIM; l++, at++)
            J[PLR_POSE_DIM * k + l] = J[PLR_POSE_DIM * l + k] = Lambda[at];
    plr_mat6_vec(b, J, nu);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        J[(PLR_POSE_DIM + 1) * k] -= 1;
    if (c->contradicted)
        in_own_sigmas(applied->L, believed->L, J, b);
    if (!estimate(J, b, own, V))
        return;
    plr_real way[PLR_POSE_DIM] = {0};
    if (c->contradicted || c->drifting) {
        by_vision_alone(own, V, n);
        plr_mat6_vec(way, believed->L, n);
        carry_apart(f, applied, way, own, trace(V));
    } else if (c->doubtful) { /* what came apart before stays so until it is settled */
        static const plr_real none[PLR_POSE_DIM] = {0};
        carry_apart(f, applied, none, none, 0);
    }
    for (unsigned w = 0; w < PLR_CONSISTENCY_WINDOWS; w++)
        if (w < FAST_WINDOWS || !c->contradicted)
            fade_in(&c->windows[w], keeps[w], own, V);
    const plr_real fast = fast_statistic(f), slow = statistic(&c->windows[FAST_WINDOWS]);
    const plr_real most = fast > slow ? fast : slow;
    if (!c->contradicted && !c->drifting && most > DIFFERS) { /* what has come apart until now */
        const plr_consistency_window *w = &c->windows[slow > fast ? FAST_WINDOWS : 1];
        plr_mat6_vec(way, believed->L, w->sum);
        for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
            c->apart[k] += way[k];
            c->apart_sigmas[k] += w->sum[k];
        }
        c->apart_noise += trace(w->variance);
    }
    c->drifting = most > DIFFERS || (c->drifting && most > AGREES);
    const bool much = differs_much(&c->windows[0], believed->L, applied);
    c->slight = much ? 0 : (uint16_t)(c->slight + (c->slight < UINT16_MAX));
    c->insisting =
        much && fast > CONTRADICTED ? (uint16_t)(c->insisting + (c->insisting < UINT16_MAX)) : 0;
    if (!c->contradicted && c->insisting >= FEW) {
        const plr_consistency_window fastest = c->windows[0];
        contradict(f);
        c->windows[0] = fastest;
    } else if (c->slight >= SETTLED_FRAMES) {
        c->contradicted = 0;
    }
}

/* ---------------------------------------------------------------- frozen pictures */

/* A number that another set of four pixels hardly ever has. */
static uint32_t print_of(const plr_observation *o) {
    const float pixels[4] = {o->uL_px, o->vL_px, o->uR_px, o->vR_px};
    uint32_t print = 2166136261U;
    for (unsigned i = 0; i < 4; i++) {
        uint32_t bits;
        memcpy(&bits, &pixels[i], sizeof bits);
        print = (print ^ bits) * 16777619U;
        print ^= print >> 15;
    }
    return print;
}

/* How far, in its own variances, the twists have moved the body since the picture was new. */
static bool has_moved(plr_filter *f) {
    plr_consistency *c = &f->consistency;
    const plr_motion *m = &f->motion;
    plr_real turn[3], sum = 0;
    plr_turn_of(turn, m->E);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        const plr_real way = c->still_way[k] + (k < 3 ? m->p[k] : turn[k - 3]);
        const plr_real variance = c->still_variance[k] + m->Q[(PLR_POSE_DIM + 1) * k];
        if (variance > 0)
            sum += way * way / variance;
        else if (way * way > PLR_R(1e-8))
            sum += PLR_R(2) * MOVED;
    }
    return sum > MOVED;
}

bool plr_consistency_is_frozen(plr_filter *f, const plr_frame *frame, unsigned n) {
    plr_consistency *c = &f->consistency;
    unsigned matched = 0, same = 0;
    for (unsigned k = 0; k < n; k++) {
        if (f->work.slot_of[k] == PLR_NO_SLOT)
            continue;
        plr_slot *slot = &f->slots[f->work.slot_of[k]];
        const uint32_t print = print_of(&frame->observations[f->work.order[k]]);
        matched++;
        same += slot->print == print;
        slot->print = print;
    }
    c->frozen = 0;
    if (matched < FEW || FROZEN_SHARE * same < matched) {
        memset(c->still_way, 0, sizeof c->still_way);
        memset(c->still_variance, 0, sizeof c->still_variance);
        return false;
    }
    if (has_moved(f)) {
        c->frozen = 1;
        return true;
    }
    const plr_motion *m =
        &f->motion; /* this picture is used: what moved until now is not pending */
    plr_real turn[3];
    plr_turn_of(turn, m->E);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        c->still_way[k] += k < 3 ? m->p[k] : turn[k - 3];
        c->still_variance[k] += m->Q[(PLR_POSE_DIM + 1) * k];
    }
    return false;
}

/* ---------------------------------------------------------------- the verdict */

static bool bias_is_off(const plr_filter *f) {
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        const plr_real limit = OFF_PRIOR * f->bias_prior_sigma[k];
        if (limit > 0 && plr_abs(f->bias[k] - f->bias_prior[k]) > limit)
            return true;
    }
    return false;
}

static void count(plr_filter *f, const plr_report *report) {
    plr_consistency *c = &f->consistency;
    c->matched = PLR_FMA(COUNTS_KEEP, c->matched, (plr_real)report->matched);
    c->gated = PLR_FMA(COUNTS_KEEP, c->gated, (plr_real)report->gated);
    c->nis = PLR_FMA(COUNTS_KEEP, c->nis, (plr_real)report->nis);
    c->nis_dof = PLR_FMA(COUNTS_KEEP, c->nis_dof, (plr_real)report->nis_dof);
}

static uint32_t find_reasons(const plr_filter *f, const plr_report *report) {
    const plr_consistency *c = &f->consistency;
    uint32_t reasons = 0;
    if (c->contradicted || c->drifting)
        reasons |= PLR_REASON_TWIST_CONTRADICTED;
    if (c->frozen)
        reasons |= PLR_REASON_FROZEN_IMAGE;
    if (plr_has_block(f, PLR_BLOCK_BIAS) && bias_is_off(f))
        reasons |= PLR_REASON_BIAS_OFF_PRIOR;
    if (report->matched > 0 && c->matched > STALE_FRAMES && c->gated > REJECTED_SHARE * c->matched)
        reasons |= PLR_REASON_SCENE_DISAGREES;
    if (c->nis_dof > NIS_DOF && c->nis > NIS_HIGH * c->nis_dof)
        reasons |= PLR_REASON_NIS_HIGH;
    if (c->nis_dof > NIS_DOF && c->nis < NIS_LOW * c->nis_dof)
        reasons |= PLR_REASON_NIS_LOW;
    return reasons;
}

/* C = s d d^T, and a share of it to all sides, for d itself is not known any better; s is what of d the
 * twists' own noise does not explain, for that is in P already. */
static void covariance_of(const plr_filter *f, const plr_real d[PLR_POSE_DIM],
                          plr_real C[PLR_POSE_SQUARE]) {
    const plr_real sigmas2 = plr_norm2_of_6(f->consistency.apart_sigmas);
    const plr_real noise = f->consistency.apart_noise;
    const plr_real s = sigmas2 > noise ? PLR_R(1) - noise / sigmas2 : PLR_R(0);
    const plr_real way = SIDEWAYS * SIDEWAYS * plr_dot3(d, d);
    const plr_real turn = SIDEWAYS * SIDEWAYS * plr_dot3(d + 3, d + 3);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        for (unsigned j = 0; j < PLR_POSE_DIM; j++)
            C[PLR_POSE_DIM * i + j] = s * (d[i] * d[j] + (i != j ? PLR_R(0) : i < 3 ? way : turn));
}

/* Both stories have agreed for long enough: what lies between them becomes a part of P. */
static void settle(plr_filter *f) {
    plr_consistency *c = &f->consistency;
    if (plr_norm2_of_6(c->apart) > 0) {
        plr_real C[PLR_POSE_SQUARE];
        covariance_of(f, c->apart, C);
        plr_covariance_add(f, PLR_BLOCK_POSE, C);
        f->totals.widened++;
    }
    memset(c->apart, 0, sizeof c->apart);
    memset(c->apart_sigmas, 0, sizeof c->apart_sigmas);
    c->apart_noise = 0;
    memset(c->windows, 0, sizeof c->windows);
    c->contradicted = c->drifting = c->doubtful = 0;
    c->agreeing = 0;
}

uint32_t plr_consistency_judge(plr_filter *f, const plr_report *report, bool lost) {
    plr_consistency *c = &f->consistency;
    count(f, report);
    uint32_t reasons = find_reasons(f, report);
    const uint32_t doubts =
        PLR_REASON_TWIST_CONTRADICTED | PLR_REASON_FROZEN_IMAGE | PLR_REASON_SCENE_DISAGREES;
    if (lost || (reasons & doubts))
        c->doubtful = 1;
    const bool agrees = !lost && !c->frozen && !c->drifting && report->used >= FEW &&
                        fast_statistic(f) < AGREES && !(reasons & PLR_REASON_SCENE_DISAGREES);
    c->agreeing = agrees ? (uint16_t)(c->agreeing + (c->agreeing < UINT16_MAX)) : 0;
    if (c->doubtful && c->agreeing >= SETTLED_FRAMES)
        settle(f);
    return c->doubtful ? reasons | PLR_REASON_POSE_MAY_BE_WRONG : reasons;
}

void plr_consistency_cover(const plr_filter *f, plr_real P_xi[PLR_POSE_SQUARE]) {
    const plr_motion *m = &f->motion;
    plr_real R[9], A[PLR_POSE_SQUARE], d[PLR_POSE_DIM];
    if (!(plr_norm2_of_6(f->consistency.apart) > 0))
        return;
    plr_se3_rotation(R, m->E);
    plr_se3_adjoint_inverse(A, R, m->p);
    plr_mat6_vec(d, A, f->consistency.apart);
    plr_real C[PLR_POSE_SQUARE];
    covariance_of(f, d, C);
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        P_xi[i] += C[i];
}
