// SPDX-License-Identifier: MIT
/* Two cameras with one trigger, and an IMU, on the same clock: what sensors_stereo.c needs of a board. */
#ifndef PELORUS_CORTEX_M_CAMERA_H
#define PELORUS_CORTEX_M_CAMERA_H

#include <stdbool.h>
#include <stdint.h>

#include "capture.h"
#include "readings.h"

/* Starts the clock of all times below. What is wrong in words, or NULL. */
const char *moments_start(void);
uint64_t moments_now_ns(void);

/* Sets both cameras up and begins to trigger them; `pattern`: they send a test pattern in place of what they see.
 * What is wrong, or NULL. Each strip has `rows` rows. */
const char *camera_start(capture *pairs, bool pattern);
void camera_stop(void);

/* Rows of exposure from the next picture on, the same for both. */
void camera_expose(uint16_t rows);

/* Starts readings into a queue. What is wrong, or NULL. */
const char *imu_start(readings *queue);

/* m/s^2 and rad/s of a reading's unit. */
extern const double imu_accel_unit, imu_gyro_unit;

#endif
