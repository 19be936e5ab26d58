// SPDX-License-Identifier: MIT
/* The estimate as doubles. No function here changes the filter. */
#include <string.h>

#include "filter/consistency.h"
#include "filter/filter_internal.h"
#include "filter/guard.h"
#include "filter/mount.h"
#include "process/process.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "state/motion.h"
#include "state/slots.h"

static bool ready(const plr_filter *f) {
    return f && f->magic == PLR_FILTER_MAGIC;
}

static void to_double(double *y, const plr_real *x, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        y[i] = (double)x[i];
}

/* The pose's covariance now, enlarged while vision contradicts the twists. */
static void pose_covariance(const plr_filter *f, plr_real P_xi[PLR_POSE_SQUARE]) {
    plr_motion_pose_covariance(f, P_xi);
    plr_consistency_enlarge(f, P_xi);
}

plr_time_ns plr_filter_time(const plr_filter *f) {
    return ready(f) ? f->t_ns : 0;
}

plr_status plr_filter_pose(const plr_filter *f, plr_pose *T_WB) {
    if (!f || !T_WB)
        return PLR_E_ARGUMENT;
    const plr_status sound = plr_guard_check(f);
    if (sound != PLR_OK)
        return sound;
    to_double(T_WB->R, f->R_WB, 9);
    memcpy(T_WB->p, f->p_WB, sizeof T_WB->p);
    plr_mount_pose_out(f, T_WB);
    return PLR_OK;
}

plr_status plr_filter_pose_covariance(const plr_filter *f, double *P_xi) {
    if (!f || !P_xi)
        return PLR_E_ARGUMENT;
    const plr_status sound = plr_guard_check(f);
    if (sound != PLR_OK)
        return sound;
    if (f->diverged)
        return PLR_E_DIVERGED;
    plr_real P[PLR_POSE_SQUARE];
    pose_covariance(f, P);
    plr_mount_covariance_out(f, P);
    to_double(P_xi, P, PLR_POSE_SQUARE);
    return PLR_OK;
}

plr_status plr_filter_velocity(const plr_filter *f, plr_twist *velocity) {
    if (!f || !velocity)
        return PLR_E_ARGUMENT;
    const plr_status sound = plr_guard_check(f);
    if (sound != PLR_OK)
        return sound;
    plr_real u[PLR_POSE_DIM];
    plr_process_of(f)->now(f, u, NULL);
    plr_mount_twist_out(f, u, NULL);
    to_double(velocity->v_B_mps, u, 3);
    to_double(velocity->w_B_radps, u + 3, 3);
    return PLR_OK;
}

plr_status plr_filter_velocity_covariance(const plr_filter *f, double *P_u) {
    if (!f || !P_u)
        return PLR_E_ARGUMENT;
    const plr_status sound = plr_guard_check(f);
    if (sound != PLR_OK)
        return sound;
    if (f->diverged)
        return PLR_E_DIVERGED;
    plr_real u[PLR_POSE_DIM], P[PLR_POSE_SQUARE];
    plr_process_of(f)->now(f, u, P);
    plr_mount_twist_out(f, u, P);
    to_double(P_u, P, PLR_POSE_SQUARE);
    return PLR_OK;
}

plr_status plr_filter_bias(const plr_filter *f, double *b, double *P_b) {
    if (!f || !b)
        return PLR_E_ARGUMENT;
    const plr_status sound = plr_guard_check(f);
    if (sound != PLR_OK)
        return sound;
    if (f->diverged && P_b)
        return PLR_E_DIVERGED;
    plr_real P[PLR_POSE_SQUARE];
    plr_process_of(f)->bias_covariance(f, P);
    to_double(b, f->bias, PLR_POSE_DIM);
    if (P_b)
        to_double(P_b, P, PLR_POSE_SQUARE);
    return PLR_OK;
}

double plr_filter_trace(const plr_filter *f) {
    if (!f || plr_guard_check_whole(f) != PLR_OK || f->diverged)
        return 0;
    plr_real P[PLR_POSE_SQUARE], P_b[PLR_POSE_SQUARE] = {0};
    double trace = plr_covariance_trace(f);
    plr_covariance_get(f, PLR_BLOCK_POSE, PLR_BLOCK_POSE, P); /* replaced by the present one */
    for (int i = 0; i < PLR_POSE_DIM; i++)
        trace -= (double)P[(PLR_POSE_DIM + 1) * i];
    pose_covariance(f, P);
    if (plr_has_block(f, PLR_BLOCK_BIAS)) {
        plr_real before[PLR_POSE_SQUARE];
        plr_covariance_get(f, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, before);
        plr_process_of(f)->bias_covariance(f, P_b);
        for (int i = 0; i < PLR_POSE_DIM; i++)
            trace += (double)P_b[(PLR_POSE_DIM + 1) * i] - (double)before[(PLR_POSE_DIM + 1) * i];
    }
    for (int i = 0; i < PLR_POSE_DIM; i++)
        trace += (double)P[(PLR_POSE_DIM + 1) * i];
    return trace;
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
