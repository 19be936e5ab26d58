// SPDX-License-Identifier: MIT
/*
 * The estimate as an autopilot reads it: the fields of MAVLink's ODOMETRY (331), in forward-right-
 * down axes for body and world (MAV_FRAME_BODY_FRD, MAV_FRAME_LOCAL_FRD).
 *
 * A recording's body axes are its own (HEADER.body_axes). With M = diag(1, -1, -1) for
 * forward-left-up and I for forward-right-down, vectors of the body are M v, of the world M p, and
 * the rotation is M R M: the world's axes change like the body's, so a world whose z is up becomes
 * one whose z is down. It is LOCAL_FRD and not NED, because the direction of its x depends on the
 * START.
 */
#ifndef PELORUS_MAVLINK_ODOMETRY_H
#define PELORUS_MAVLINK_ODOMETRY_H

#include "pelorus/wire.h"

typedef struct plr_odometry {
    uint64_t time_us;              /* the recording's clock */
    float p[3];                    /* m, LOCAL_FRD */
    float q[4];                    /* w x y z, BODY_FRD to LOCAL_FRD */
    float v[3];                    /* m/s, BODY_FRD */
    float w[3];                    /* rad/s, BODY_FRD */
    float pose_covariance[21];     /* of (x, y, z, roll, pitch, yaw), upper triangle row by row;
                                      the first is NaN where Euler angles have no meaning */
    float velocity_covariance[21]; /* of (v, w), likewise */
    uint8_t reset_counter;
    int8_t quality; /* percent: -1 failed, 0 unknown, 1 worst, 100 best */
} plr_odometry;

/* Fills *o from a pose and the health of the frame that it belongs to. The quality is 100 for good,
 * 50 for degraded, 1 for lost, -1 for diverged.
 * The position's covariance is R P_rho R^T with p = p^ + R^ rho; that of roll, pitch and yaw (ZYX)
 * is E P_theta E^T, d(roll, pitch, yaw) = E theta, E = [1, sr tp, cr tp; 0, cr, -sr; 0, sr/cp,
 * cr/cp]. Within 3 degrees of straight up or down E has no meaning.
 * PLR_E_ARGUMENT for other body axes: there is no telling which way is forward. */
plr_status plr_odometry_from_pose(plr_odometry *o, const plr_pose_message *pose, plr_body_axes axes,
                                  plr_health health);

#endif
