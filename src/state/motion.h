// SPDX-License-Identifier: MIT
/* The motion since landmarks and covariance were last moved. The pose contains it already;
 * plr_motion accumulates it until a frame applies it to them (docs/MATH.md 4 and 6). */
#ifndef PLR_STATE_MOTION_H
#define PLR_STATE_MOTION_H

#include "pelorus/belief.h"
#include "pelorus/workspace.h"

/* Nothing accumulated: D = I, Q = 0, B = 0; velocity and biases as they are. */
void plr_motion_clear(const plr_belief *belief, plr_motion *motion);

/* T <- T_WB without noise (mapping). */
void plr_motion_jump(plr_belief *belief, plr_motion *motion, plr_time_ns t_ns,
                     const plr_real R_WB[9], const double p_WB[3]);

/* The accumulated motion D Exp(L nu) with its noise nu ~ N(0, I), linearised at nu = z, a value
 * found from the frame's observations (docs/MATH.md 4 and 10). */
typedef struct plr_applied_motion {
    plr_real E[9], p[3];          /* D' = D Exp(L z) = (I + E, p) */
    plr_real L[PLR_POSE_SQUARE];  /* lower triangle: L L^T = B P_dd B^T + Q; columns may be zero */
    plr_real JL[PLR_POSE_SQUARE]; /* Jr(L z) L: D Exp(L nu) = D' Exp(JL (nu - z)) to first order */
    plr_real z[PLR_POSE_DIM];
} plr_applied_motion;

/* BPB = B P_dd B^T, the drivers' part of the accumulated motion's covariance BPB + Q; 6x6. */
void plr_motion_covariance_by_state(const plr_belief *belief, const plr_motion *motion,
                                    plr_real BPB[PLR_POSE_SQUARE]);

/* X <- L^-1 X, 6 x columns, leading dimension ld; L as in plr_applied_motion. */
void plr_motion_solve(const plr_real L[PLR_POSE_SQUARE], unsigned columns, plr_real *X,
                      unsigned ld);

/* K = L^-1 B, 6 x drivers with leading dimension PLR_DRIVERS, for L of an applied motion: the
 * derivative of nu by the drivers. Zero rows where L has zero columns. */
void plr_motion_by_drivers(const plr_belief *belief, const plr_motion *motion,
                           const plr_real L[PLR_POSE_SQUARE], plr_real K[PLR_MOTION_BY]);

/* Kt = K^T, drivers x 6. */
void plr_motion_transpose(const plr_real K[PLR_MOTION_BY], plr_real Kt[PLR_MOTION_BY]);

/* The motion at nu = 0: D' = D, with the odometry's sigmas times `weight`: of an IMU those of its readings alone, for
 * what is known of the velocity is no reading. */
void plr_motion_prior(const plr_belief *belief, const plr_motion *motion, plr_noise *noise,
                      plr_real weight, plr_applied_motion *applied);

/* The motion at nu = 0 with a prior so wide that it allows any motion of a robot between two
 * frames: 30 times the sigmas of plr_motion_prior, plus 0.3 m and 0.1 rad. */
void plr_motion_open_prior(const plr_belief *belief, const plr_motion *motion, plr_noise *noise,
                           plr_applied_motion *applied);

/* With an IMU the readings that make a way wrong make the velocity wrong, too. For the open prior this enlarges the
 * velocity's share of the pending motion's noise by what white noise of the readings does that makes 0.3 m of the way in T
 * seconds, (3/T^2) (0.3 m)^2 with a covariance of (3/2T) (0.3 m)^2, and turns it by the 0.1 rad. */
void plr_motion_open_velocity(const plr_belief *belief, plr_motion *motion);

/* The same for plr_motion_prior with a weight: the readings' noise is so many times larger, and moves the velocity as it
 * moves the pose. A gyro without weight does not aim the accelerometers. It becomes no
 * less certain than the open prior makes it. */
void plr_motion_widen_velocity(const plr_belief *belief, plr_motion *motion, plr_real weight);

/* The same motion taken at nu = z. `prior` is from plr_motion_prior. */
void plr_motion_at(const plr_motion *motion, const plr_applied_motion *prior,
                   const plr_real z[PLR_POSE_DIM], plr_applied_motion *applied);

/* A = Ad(D'^-1) of the motion D' that is held (plr_held_motion): xi after it is A xi before it. */
void plr_motion_held_adjoint(const plr_belief *belief, plr_real A[PLR_POSE_SQUARE]);

/* The pose's covariance, 6x6, as if the accumulated motion were applied. */
void plr_motion_pose_covariance(const plr_belief *belief, const plr_motion *motion,
                                plr_real P_xi[PLR_POSE_SQUARE]);

#endif
