// SPDX-License-Identifier: MIT
/* A filter with an IMU on a simulated flight (support/imu_flight.h): what its tests have in common. */
#ifndef PELORUS_TEST_IMU_RIG_H
#define PELORUS_TEST_IMU_RIG_H

#include "pelorus/filter.h"
#include "support/imu_flight.h"
#include "support/pose_of.h"

enum { IMU_RIG_EVERY = 40 }; /* readings in a frame: 10 Hz with 400 Hz */

typedef enum imu_rig_start { IMU_RIG_GIVEN, IMU_RIG_AT_REST, IMU_RIG_IN_MOTION } imu_rig_start;

/* Squared errors in units of their covariance: chi-square of 3 each, if that is right. */
typedef struct imu_rig_errors {
    double orientation, position, velocity, accel_bias, gyro_bias;
    double metres, rad, mps;
} imu_rig_errors;

typedef struct imu_rig_state {
    plr_filter filter, before; /* `before`: the state that a refused call must leave */
    plr_config config;         /* fits the options, as they stand after imu_rig_set_up */
    imu_flight flight;
    imu_flight_options options;
    plr_report report; /* of the last frame */
    double world[16];  /* the true world seen from the filter's: position and yaw of a start are
                          free */
} imu_rig_state;

extern imu_rig_state imu_rig;

/* Default options, and settings that say of the noise what the options make it. */
void imu_rig_set_up(void);

/* A new flight and a new filter. Given: the truth is set, v within 1 mm/s. At rest: the body stands for
 * 1.5 s. In motion: the filter begins three seconds later, on the way. */
void imu_rig_begin(imu_rig_start start, uint64_t seed);

/* The next reading, which the filter must accept; it is the answer. */
plr_imu imu_rig_read(void);

/* The next reading gets lost. */
void imu_rig_lose(void);

/* So many readings. */
void imu_rig_readings(unsigned count);

/* A frame now. Demands PLR_OK. */
void imu_rig_frame(void);

/* So many frames, each after IMU_RIG_EVERY readings. */
void imu_rig_fly(unsigned frames);

/* From now on the estimate's position and yaw are right, and its vertical is that of the truth. */
void imu_rig_adopt_world(void);

imu_rig_errors imu_rig_errors_now(void);

/* sum += share * e; of metres, rad and mps the squares. */
void imu_rig_add(imu_rig_errors *sum, const imu_rig_errors *e, double share);

/* Prints such a sum whose shares are 1 together. */
void imu_rig_tell(const char *what, const imu_rig_errors *sum);

/* The same, and demands all within the bounds of a chi-square over so many flights; where the filter may
 * be too careful, below the upper one. */
void imu_rig_demand_consistent(const char *what, const imu_rig_errors *sum, unsigned flights,
                               bool may_be_careful);

/* Keeps the state, against which imu_rig_demand_refusal compares. */
void imu_rig_remember(void);

/* The call was refused with that status and changed nothing but the counts and, if it says so, the
 * fault of the IMU. */
void imu_rig_demand_refusal(plr_status expected, plr_status got);

#endif
