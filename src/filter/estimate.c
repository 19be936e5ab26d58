// SPDX-License-Identifier: MIT
/* The estimate as doubles. No function here changes the filter. */
#include <string.h>

#include "filter/extrinsics.h"
#include "filter/filter_internal.h"
#include "filter/guard.h"
#include "math/dense.h"
#include "math/finite.h"
#include "math/small.h"
#include "process/process.h"
#include "state/blocks.h"
#include "state/calibration.h"
#include "state/covariance.h"
#include "state/motion.h"
#include "state/sensitivity.h"
#include "supervise/supervise.h"

static bool ready(const plr_filter *f) {
    return f && f->magic == PLR_FILTER_MAGIC;
}

static void to_double(double *y, const plr_real *x, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        y[i] = (double)x[i];
}

/* The first share by which variances are enlarged, and the last: with it they are 13 times what
 * they were, more than the six that make any correlations possible. */
#define FIRST_SHARE (1.0 / (1 << 20))
#define LAST_SHARE  4.0
/* What is positive with variances less by this share is positive by more than rounding. */
#define SURE_SHARE (PLR_R(256) * PLR_EPSILON + PLR_R(1e-8))

/* Most covariances are, and to know it costs little beside plr_is_covariance where double is not in
 * hardware. Uses the lower triangle. */
static bool is_surely_positive(const plr_real P[PLR_POSE_SQUARE]) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0};
    for (unsigned i = 0, at = 0; i < PLR_POSE_DIM; i++)
        for (unsigned j = i; j < PLR_POSE_DIM; j++, at++)
            U[at] = P[PLR_POSE_DIM * j + i] * (i == j ? PLR_R(1) - SURE_SHARE : PLR_R(1));
    return plr_cholesky_upper(PLR_POSE_DIM, U);
}

/* A covariance as it is told, 6x6: symmetric to the bit, and positive, so that plr_filter_set_pose
 * takes it back. Where directions are known by very different amounts, rounding in float32 leaves a
 * P that is not quite positive (docs/NUMERICS.md 2), though each of its variances is. Variances are
 * then enlarged, all by the same share, until it is; if that does not help, because correlations are
 * beyond 1, none are told. PLR_E_DIVERGED if a number is not finite or a variance is negative. */
static plr_status tell_covariance(double *told, const plr_real P[PLR_POSE_SQUARE]) {
    enum { N = PLR_POSE_DIM };
    double C[PLR_POSE_SQUARE], share = FIRST_SHARE;
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            C[N * i + j] = (double)P[i >= j ? N * i + j : N * j + i];
    if (is_surely_positive(P)) {
        memcpy(told, C, sizeof C);
        return PLR_OK;
    }
    if (!plr_all_finite(C, PLR_POSE_SQUARE))
        return PLR_E_DIVERGED;
    for (int i = 0; i < N; i++)
        if (C[(N + 1) * i] < 0)
            return PLR_E_DIVERGED;
    for (; share <= LAST_SHARE && !plr_is_covariance(C, N); share *= 4)
        for (int i = 0; i < N; i++)
            C[(N + 1) * i] *= 1 + share;
    if (share > LAST_SHARE && !plr_is_covariance(C, N))
        for (int i = 0; i < PLR_POSE_SQUARE; i++)
            C[i] = i % (N + 1) == 0 ? C[i] : 0;
    memcpy(told, C, sizeof C);
    return PLR_OK;
}

/* The pose's covariance now, enlarged by what the calibration may be wrong, and while vision
 * contradicts the twists. */
static void pose_covariance(const plr_filter *f, plr_real P_xi[PLR_POSE_SQUARE]) {
    plr_motion_pose_covariance(&f->belief, &f->motion, P_xi);
    plr_sensitivity_add_to_pose(&f->belief, &f->camera, &f->motion, P_xi);
    plr_supervise_enlarge(&f->supervisor, f->motion.E, f->motion.p, P_xi);
}

plr_time_ns plr_filter_time(const plr_filter *f) {
    return ready(f) ? f->belief.t_ns : 0;
}

plr_status plr_filter_pose(const plr_filter *f, plr_pose *T_WB) {
    const plr_status sound = T_WB ? plr_guard_check(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    to_double(T_WB->R, f->belief.R_WB, 9);
    memcpy(T_WB->p, f->belief.p_WB, sizeof T_WB->p);
    plr_extrinsics_pose_out(f, T_WB);
    return PLR_OK;
}

plr_status plr_filter_pose_covariance(const plr_filter *f, double *P_xi) {
    const plr_status sound = P_xi ? plr_guard_check(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    plr_real P[PLR_POSE_SQUARE];
    pose_covariance(f, P);
    plr_extrinsics_covariance_out(f, P);
    return tell_covariance(P_xi, P);
}

plr_status plr_filter_velocity(const plr_filter *f, plr_twist *velocity) {
    const plr_status sound = velocity ? plr_guard_check(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    plr_real u[PLR_POSE_DIM];
    plr_process_of(&f->source)->now(&f->belief, &f->motion, &f->source, u, NULL);
    plr_extrinsics_twist_out(f, u, NULL);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        if (!plr_is_finite(u[i]))
            return PLR_E_DIVERGED;
    to_double(velocity->v_B_mps, u, 3);
    to_double(velocity->w_B_radps, u + 3, 3);
    return PLR_OK;
}

plr_status plr_filter_velocity_covariance(const plr_filter *f, double *P_u) {
    const plr_status sound = P_u ? plr_guard_check(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    plr_real u[PLR_POSE_DIM], P[PLR_POSE_SQUARE];
    plr_process_of(&f->source)->now(&f->belief, &f->motion, &f->source, u, P);
    plr_sensitivity_add_to_velocity(&f->belief, &f->camera, &f->motion, P);
    plr_extrinsics_twist_out(f, u, P);
    return tell_covariance(P_u, P);
}

plr_status plr_filter_bias(const plr_filter *f, double *b, double *P_b) {
    const plr_status sound = b ? plr_guard_check(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    if (P_b) {
        plr_real P[PLR_POSE_SQUARE];
        plr_process_of(&f->source)->bias_covariance(&f->belief, &f->motion, &f->source, P);
        if (plr_has_block(&f->belief, PLR_BLOCK_BIAS))
            plr_sensitivity_add_to(&f->belief, &f->camera, plr_row_of(&f->belief, PLR_BLOCK_BIAS),
                                   PLR_BIAS_DIM, P);
        const plr_status status = tell_covariance(P_b, P);
        if (status != PLR_OK)
            return status;
    }
    to_double(b, f->belief.bias, PLR_POSE_DIM);
    return PLR_OK;
}

plr_status plr_filter_calibration(const plr_filter *f, plr_calibration_result *result) {
    const plr_status sound = result ? plr_guard_check(f) : PLR_E_ARGUMENT;
    if (sound == PLR_OK)
        plr_calibration_tell(&f->belief, &f->camera, &f->source, result);
    return sound;
}

double plr_filter_trace(const plr_filter *f) {
    if (plr_guard_check_whole(f) != PLR_OK)
        return 0;
    plr_real P[PLR_POSE_SQUARE], P_b[PLR_POSE_SQUARE] = {0};
    double trace = plr_covariance_trace(&f->belief);
    plr_covariance_get(&f->belief, PLR_BLOCK_POSE, PLR_BLOCK_POSE,
                       P); /* replaced by the present one */
    for (int i = 0; i < PLR_POSE_DIM; i++)
        trace -= (double)P[(PLR_POSE_DIM + 1) * i];
    pose_covariance(f, P);
    if (plr_has_block(&f->belief, PLR_BLOCK_BIAS)) {
        plr_real before[PLR_POSE_SQUARE];
        plr_covariance_get(&f->belief, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, before);
        plr_process_of(&f->source)->bias_covariance(&f->belief, &f->motion, &f->source, P_b);
        for (int i = 0; i < PLR_POSE_DIM; i++)
            trace += (double)P_b[(PLR_POSE_DIM + 1) * i] - (double)before[(PLR_POSE_DIM + 1) * i];
    }
    for (int i = 0; i < PLR_POSE_DIM; i++)
        trace += (double)P[(PLR_POSE_DIM + 1) * i];
    return plr_all_finite(&trace, 1) ? trace : 0;
}

plr_status plr_filter_totals(const plr_filter *f, plr_totals *totals) {
    if (!f || !totals)
        return PLR_E_ARGUMENT;
    if (!ready(f))
        return PLR_E_NOT_READY;
    *totals = f->totals;
    return PLR_OK;
}

const plr_config *plr_filter_config(const plr_filter *f) {
    return ready(f) ? &f->config : NULL;
}
