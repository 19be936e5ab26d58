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

/* Sets both cameras up, exposes by so many rows and begins to trigger them; `pattern`: they send a test pattern in
 * place of what they see. What is wrong, or NULL. */
const char *camera_start(capture *pairs, bool pattern, uint16_t exposure_rows);
void camera_stop(void);

/* Whether no picture is exposed or read out, and none begins before camera_expose would be through three times. */
bool camera_rests(void);

/* Pictures so far. Where it is another after some calls of camera_expose than before them, one began between. */
uint32_t camera_triggered(void);

typedef enum camera_side { CAMERA_LEFT, CAMERA_RIGHT, CAMERA_SIDES } camera_side;

/* Rows of exposure of one camera, from its next picture on: call it while they rest. False: it did not take it. */
bool camera_expose(camera_side side, uint16_t rows);

/* Starts readings into a queue. What is wrong, or NULL. */
const char *imu_start(readings *queue);

/* m/s^2 and rad/s of a reading's unit. */
extern const double imu_accel_unit, imu_gyro_unit;

#endif
