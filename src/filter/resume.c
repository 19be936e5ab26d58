// SPDX-License-Identifier: MIT
/* Continuing after an interruption, with another clock and perhaps at another place. */
#include <string.h>

#include "filter/extrinsics.h"
#include "filter/filter_internal.h"
#include "filter/guard.h"
#include "math/finite.h"
#include "process/alignment.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "supervise/supervise.h"

static plr_status check_moved(const plr_filter *f, const double *P_moved) {
    if (!f->clock_started || (P_moved && f->config.mode == PLR_MODE_MAPPING))
        return PLR_E_MODE;
    if (!P_moved)
        return PLR_OK;
    if (!plr_all_finite(P_moved, PLR_POSE_SQUARE))
        return PLR_E_NOT_FINITE;
    if (!plr_all_within(P_moved, PLR_POSE_SQUARE, PLR_MAX_VARIANCE))
        return PLR_E_RANGE;
    return plr_is_covariance(P_moved, PLR_POSE_DIM) ? PLR_OK : PLR_E_ARGUMENT;
}

plr_status plr_filter_resume(plr_filter *f, plr_time_ns t_ns, const double *P_moved) {
    const plr_status sound = plr_guard_check_whole(f);
    if (sound != PLR_OK)
        return sound;
    const plr_status status = check_moved(f, P_moved);
    if (status != PLR_OK)
        return plr_filter_refuse(f, status);
    plr_alignment_follow_clock(&f->belief, &f->source, t_ns);
    f->belief.t_ns = t_ns;
    plr_filter_forget_reading(f); /* an earlier one is not valid any more */
    plr_supervise_clock_set(&f->supervisor);
    if (plr_has_block(&f->belief, PLR_BLOCK_VELOCITY)) { /* it is not what it was then */
        const plr_real v = f->source.start_velocity_variance, variance[3] = {v, v, v};
        memset(f->belief.velocity, 0, sizeof f->belief.velocity);
        plr_covariance_forget(&f->belief, PLR_BLOCK_VELOCITY, variance);
    }
    for (unsigned slot = 0; slot < f->belief.count; slot++)
        f->belief.slots[slot].anchored = 0;
    if (!P_moved) {
        plr_guard_seal_whole(f);
        return PLR_OK;
    }
    double P[PLR_POSE_SQUARE];
    memcpy(P, P_moved, sizeof P);
    plr_extrinsics_covariance_in(f, P);
    /* T = T^ Exp(n) with n ~ N(0, P_moved): a step without motion, all noise */
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        for (unsigned j = 0; j < PLR_POSE_DIM; j++)
            f->motion.Q[PLR_POSE_DIM * i + j] +=
                (plr_real)(0.5 * (P[PLR_POSE_DIM * i + j] + P[PLR_POSE_DIM * j + i]));
    f->motion.pending = f->motion.noisy = 1;
    plr_guard_seal_whole(f);
    return PLR_OK;
}
