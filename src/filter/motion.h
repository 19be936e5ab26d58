// SPDX-License-Identifier: MIT
/* The estimate's motion: the pose moves at once, the covariance's share is accumulated in blocks of
 * fixed size and applied when it is needed (docs/MATH.md 4 and 6). */
#ifndef PLR_FILTER_MOTION_H
#define PLR_FILTER_MOTION_H

#include <stdbool.h>

#include "pelorus/state.h"

/* Nothing accumulated: D = I, Q = 0, B = 0. */
void plr_motion_clear(plr_motion *motion);

/* PLR_OK if the twist `reading` (6: v, w), less the bias, may be held for `seconds`: at most pi rad
 * and 1 km; else PLR_E_RANGE. */
plr_status plr_motion_check(const plr_filter *f, const plr_real reading[6], plr_real seconds);

/* T <- T Exp(seconds (reading - b)), and the same into f->motion. The reading's noise is charged in
 * parts: sigma^2 interval seconds of its whole interval. Time is set to t_ns. */
void plr_motion_step(plr_filter *f, plr_time_ns t_ns, const plr_real reading[6], plr_real seconds,
                     plr_real interval);

/* T <- T_WB without noise (mapping). */
void plr_motion_jump(plr_filter *f, plr_time_ns t_ns, const plr_real R_WB[9], const double p_WB[3]);

/* T <- T Exp(xi), and R once more a rotation to rounding: the end of a frame's correction. */
void plr_motion_correct_pose(plr_filter *f, const plr_real xi[6]);

/* Brings landmarks and covariance up to the pose. Sets f->diverged where a variance is lost. */
void plr_motion_settle(plr_filter *f);

/* The pose's covariance as it would be after plr_motion_settle, 6x6; changes nothing. */
void plr_motion_pose_covariance(const plr_filter *f, plr_real P_xi[36]);

/* Notes that a variance ceased to be positive: no update from here on. */
void plr_filter_diverge(plr_filter *f);

#endif
