// SPDX-License-Identifier: MIT
/*
 * Where the IMU is on the body (settings imu-turn and imu-arm). Inside the filter the body's origin
 * is the IMU, with the body's axes; the caller's origin is elsewhere by the arm r = source.imu_arm. What
 * comes in and what goes out is changed here. Without an arm nothing is touched.
 */
#ifndef PLR_FILTER_EXTRINSICS_H
#define PLR_FILTER_EXTRINSICS_H

#include "pelorus/filter.h"

/* The arm, the turn and the camera seen from the IMU, at init. */
void plr_extrinsics_set(plr_filter *f, const plr_config *config);

/* p <- p + R r: from the caller's origin to the IMU. Of a covariance of (rho, theta), 6x6:
 * rho <- rho - r x theta. */
void plr_extrinsics_pose_in(const plr_filter *f, plr_pose *T);
void plr_extrinsics_covariance_in(const plr_filter *f, double P[PLR_POSE_SQUARE]);

/* The reverse. */
void plr_extrinsics_pose_out(const plr_filter *f, plr_pose *T);
void plr_extrinsics_covariance_out(const plr_filter *f, plr_real P[PLR_POSE_SQUARE]);

/* Velocity and rate (v, w) and their covariance, from the IMU to the caller's origin:
 * v <- v + r x w. P may be NULL. */
void plr_extrinsics_twist_out(const plr_filter *f, plr_real u[PLR_POSE_DIM], plr_real *P);

/* A place on the body seen from the IMU. */
void plr_extrinsics_place_in(const plr_filter *f, double at_B_m[3]);

/* A reading (a, w) of the IMU, turned into the body's axes. */
void plr_extrinsics_reading_in(const plr_filter *f, plr_real reading[PLR_POSE_DIM]);

#endif
