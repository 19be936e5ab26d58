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

/* The accumulated motion as a frame applies it, once its observations have said what it was: the
 * motion is D Exp(L nu) with nu ~ N(0, I), taken at nu = z (docs/MATH.md 4 and 10). */
typedef struct plr_applied_motion {
    plr_real E[9], p[3]; /* D' = D Exp(L z) = (I + E, p) */
    plr_real L[36];      /* lower triangle: L L^T = B P_bb B^T + Q; columns may be zero */
    plr_real K[36];      /* L^-1 B, rows of zero columns zero: what nu shares with the biases */
    plr_real JL[36];     /* Jr(L z) L: D Exp(L nu) = D' Exp(JL (nu - z)) to first order */
    plr_real z[6];
} plr_applied_motion;

/* The motion at nu = 0: D' = D. */
void plr_motion_prior(plr_filter *f, plr_applied_motion *applied);

/* The motion at nu = 0 with a prior that excludes nothing a robot may have done between two frames: 30
 * times the sigmas of plr_motion_prior, and 0.3 m and 0.1 rad besides. */
void plr_motion_open_prior(plr_filter *f, plr_applied_motion *applied);

/* The same motion taken at nu = z. `prior` is from plr_motion_prior. */
void plr_motion_at(const plr_filter *f, const plr_applied_motion *prior, const plr_real z[6],
                   plr_applied_motion *applied);

/* Brings landmarks and covariance up to D', and the pose from D to D'. In `body` the motion's noise
 * stays outside of P, in work.noise, until plr_covariance_close_noise. Sets f->diverged where a
 * variance is lost. */
void plr_motion_apply(plr_filter *f, const plr_applied_motion *applied);

/* Brings landmarks and covariance up to the pose, with nothing but the twists to say how it moved. */
void plr_motion_settle(plr_filter *f);

/* Forgets the motion not yet applied; the biases have their walk all the same. */
void plr_motion_drop(plr_filter *f);

/* The pose at which landmarks and covariance stand: that of before the motion not yet applied. */
void plr_motion_reference(const plr_filter *f, plr_real R_WB[9], double p_WB[3]);

/* The pose's covariance as it would be after plr_motion_settle, 6x6; changes nothing. */
void plr_motion_pose_covariance(const plr_filter *f, plr_real P_xi[36]);

/* Notes that a variance ceased to be positive: no update from here on. */
void plr_filter_diverge(plr_filter *f);

#endif
