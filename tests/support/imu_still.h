// SPDX-License-Identifier: MIT
/* A filter with an IMU that has not started: readings and pictures of a body that stands, for the tests of the
 * start (process/alignment.h). */
#ifndef PELORUS_TEST_IMU_STILL_H
#define PELORUS_TEST_IMU_STILL_H

#include "support/imu_rig.h"

enum { IMU_STILL_SECOND = 400 /* readings */ };

extern rng imu_still_chance;

/* imu_rig_set_up, and the same noise in every test. */
void imu_still_set_up(void);

/* A new filter whose clock has not begun. */
void imu_still_begin(void);

/* A filter in a pose with this roll, which is given. */
void imu_still_begin_at(double roll);

/* Readings at 400 Hz that a body at rest gives, with noise: of this specific force and rate. */
plr_status imu_still_feed(unsigned count, const double a[3], const double w[3]);

/* The same without a rate; demands PLR_OK. */
void imu_still_feed_up(unsigned count, double x, double y, double z);

/* The reasons of health now. */
uint32_t imu_still_reasons(void);

/* Demands that the filter has not started, and that this is the fault that it tells. */
void imu_still_demand_waiting(plr_imu_fault fault);

void imu_still_demand_started(void);

/* A frame of five points, all moved in the picture by this. */
plr_report imu_still_look(double shift_px);

#endif
