// SPDX-License-Identifier: MIT
/* Motion by twists. A twist changes the pose at once; its effect on landmarks and covariance is
 * accumulated in f->motion and applied when it is needed (docs/MATH.md 4 and 6). */
#ifndef PLR_FILTER_MOTION_H
#define PLR_FILTER_MOTION_H

#include <stdbool.h>

#include "pelorus/state.h"

/* Nothing accumulated: D = I, Q = 0, B = 0. */
void plr_motion_clear(plr_motion *motion);

/* PLR_OK if the twist `reading` (6: v, w) minus the bias gives at most pi rad and 1 km in
 * `seconds`; else PLR_E_RANGE. */
plr_status plr_motion_check(const plr_filter *f, const plr_real reading[6], plr_real seconds);

/* T <- T Exp(seconds (reading - b)), and the same into f->motion. Adds the variance
 * sigma^2 interval seconds, where `interval` is the time for which the reading is valid, so that
 * the parts of an interval add up to sigma^2 interval^2. Sets the time to t_ns. */
void plr_motion_step(plr_filter *f, plr_time_ns t_ns, const plr_real reading[6], plr_real seconds,
                     plr_real interval);

/* T <- T_WB without noise (mapping). */
void plr_motion_jump(plr_filter *f, plr_time_ns t_ns, const plr_real R_WB[9], const double p_WB[3]);

/* T <- T Exp(xi), and makes R orthonormal: the correction of the pose by a frame. */
void plr_motion_correct_pose(plr_filter *f, const plr_real xi[6]);

/* The accumulated motion D Exp(L nu) with its noise nu ~ N(0, I), linearised at nu = z, a value
 * found from the frame's observations (docs/MATH.md 4 and 10). */
typedef struct plr_applied_motion {
    plr_real E[9], p[3]; /* D' = D Exp(L z) = (I + E, p) */
    plr_real L[36];      /* lower triangle: L L^T = B P_bb B^T + Q; columns may be zero */
    plr_real K[36];      /* L^-1 B, rows of zero columns zero: what nu shares with the biases */
    plr_real JL[36];     /* Jr(L z) L: D Exp(L nu) = D' Exp(JL (nu - z)) to first order */
    plr_real z[6];
} plr_applied_motion;

/* The motion at nu = 0: D' = D. */
void plr_motion_prior(plr_filter *f, plr_applied_motion *applied);

/* The motion at nu = 0 with a prior so wide that it allows any motion of a robot between two
 * frames: 30 times the sigmas of plr_motion_prior, plus 0.3 m and 0.1 rad. */
void plr_motion_open_prior(plr_filter *f, plr_applied_motion *applied);

/* The same motion taken at nu = z. `prior` is from plr_motion_prior. */
void plr_motion_at(const plr_filter *f, const plr_applied_motion *prior, const plr_real z[6],
                   plr_applied_motion *applied);

/* Applies D' to landmarks and covariance, and moves the pose from D to D'. In `body` the motion's
 * noise is kept in work.noise, not in P, until plr_covariance_close_noise. Sets f->diverged if a
 * variance is no longer positive. */
void plr_motion_apply(plr_filter *f, const plr_applied_motion *applied);

/* Applies the accumulated motion to landmarks and covariance without observations: at nu = 0. */
void plr_motion_settle(plr_filter *f);

/* Discards the accumulated motion; the bias walk of its duration is still added. */
void plr_motion_drop(plr_filter *f);

/* The pose to which landmarks and covariance refer: the one before the accumulated motion. */
void plr_motion_reference(const plr_filter *f, plr_real R_WB[9], double p_WB[3]);

/* The pose's covariance as it would be after plr_motion_settle, 6x6; changes nothing. */
void plr_motion_pose_covariance(const plr_filter *f, plr_real P_xi[36]);

/* Marks the filter as diverged, because a variance is no longer positive: no update from now on. */
void plr_filter_diverge(plr_filter *f);

#endif
