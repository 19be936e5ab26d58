// SPDX-License-Identifier: MIT
/* The process `twist`: measured velocity and angular rate move the pose (docs/MATH.md 4). */
#ifndef PLR_PROCESS_TWIST_H
#define PLR_PROCESS_TWIST_H

#include "pelorus/state.h"

/* Lays out the state's blocks: the pose, and with the setting `bias` the biases of the twists. */
void plr_twist_lay_out(plr_filter *f);

/* Adds the variance of the biases' random walk in `seconds`. */
void plr_twist_walk(plr_filter *f, plr_real seconds);

/* The body's present twist (v, w): the last reading minus the bias, with its covariance, 6x6: that
 * of the reading plus that of the bias. */
void plr_twist_now(const plr_filter *f, plr_real u[PLR_POSE_DIM], plr_real P_u[PLR_POSE_SQUARE]);

/* The biases' covariance at the time of the estimate, 6x6, including the walk that is not
 * applied yet. Zeros if they are not estimated. */
void plr_twist_bias_covariance(const plr_filter *f, plr_real P_b[PLR_POSE_SQUARE]);

/* PLR_OK if the twist `reading` (6: v, w) minus the bias turns by at most pi rad and moves by at
 * most 1 km in `seconds`; else PLR_E_RANGE. */
plr_status plr_twist_check(const plr_filter *f, const plr_real reading[PLR_POSE_DIM],
                           plr_real seconds);

/* T <- T Exp(seconds (reading - b)), and the same into f->motion. Adds the variance
 * sigma^2 interval seconds, where `interval` is the time for which the reading is valid, so that
 * the parts of an interval add up to sigma^2 interval^2. Sets the time to t_ns. */
void plr_twist_step(plr_filter *f, plr_time_ns t_ns, const plr_real reading[PLR_POSE_DIM],
                    plr_real seconds, plr_real interval);

#endif
