// SPDX-License-Identifier: MIT
/*
 * A short drive as messages: a body that goes round a circle (1 m/s, 0.2 rad/s) among landmarks,
 * without noise. Times are in seconds after DRIVE_START_NS.
 */
#ifndef PELORUS_TEST_SESSION_DRIVE_H
#define PELORUS_TEST_SESSION_DRIVE_H

#include "pelorus/wire.h"

#define DRIVE_START_NS UINT64_C(1000000000000)

enum { DRIVE_LANDMARKS = 200, DRIVE_MOST_SEEN = 24 };

/* Camera looking forward from a forward-left-up body; start timing; no suggestions. */
plr_message drive_header(void);

plr_time_ns drive_time_ns(double t_s);

/* The true pose. */
plr_pose drive_pose(double t_s);

plr_message drive_twist(double t_s);
plr_message drive_truth(double t_s);

/* So many readings of an IMU from t_s on. */
plr_message drive_imu(double t_s, unsigned count, double period_s);

/* At most DRIVE_MOST_SEEN landmarks in view. The observations stand in static memory until the next
 * call. */
plr_message drive_stereo(double t_s);

/* A landmark as LANDMARK (known), with that standard deviation. */
plr_message drive_known(uint32_t id, double sigma_m);

/* A CONFIG of wanted settings that holds one of them. */
plr_message drive_config(const char *name, double value);

/* START at the true pose, with the true velocity, which only an IMU needs. */
plr_message drive_start(double t_s);

#endif
