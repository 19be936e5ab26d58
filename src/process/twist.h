// SPDX-License-Identifier: MIT
/* The process `twist`: velocity and angular rate are measured, and move the pose (docs/MATH.md 4). */
#ifndef PLR_PROCESS_TWIST_H
#define PLR_PROCESS_TWIST_H

#include "pelorus/state.h"

/* Lays out the state's blocks: the pose, and with the setting `bias` the biases of the twists. */
void plr_twist_lay_out(plr_filter *f);

/* Adds what the biases may have changed in `seconds`: their random walk. */
void plr_twist_walk(plr_filter *f, plr_real seconds);

/* The body's twist now, (v, w), by the last reading, and its covariance, 6x6: the reading's and the
 * biases'. */
void plr_twist_now(const plr_filter *f, plr_real u[PLR_POSE_DIM], plr_real P_u[PLR_POSE_SQUARE]);

/* The biases' covariance at the time of the estimate, 6x6: with the walk not yet applied. Zeros if
 * they are not estimated. */
void plr_twist_bias_covariance(const plr_filter *f, plr_real P_b[PLR_POSE_SQUARE]);

/* PLR_OK if the twist `reading` (6: v, w) minus the bias gives at most pi rad and 1 km in
 * `seconds`; else PLR_E_RANGE. */
plr_status plr_twist_check(const plr_filter *f, const plr_real reading[PLR_POSE_DIM],
                           plr_real seconds);

/* T <- T Exp(seconds (reading - b)), and the same into f->motion. Adds the variance
 * sigma^2 interval seconds, where `interval` is the time for which the reading is valid, so that
 * the parts of an interval add up to sigma^2 interval^2. Sets the time to t_ns. */
void plr_twist_step(plr_filter *f, plr_time_ns t_ns, const plr_real reading[PLR_POSE_DIM],
                    plr_real seconds, plr_real interval);

#endif
