// SPDX-License-Identifier: MIT
/* The start of an IMU from phase to phase: plr_imu_phase_change alone changes it. */
#ifndef PLR_PROCESS_IMU_PHASE_H
#define PLR_PROCESS_IMU_PHASE_H

#include "pelorus/source.h"

/* What can lead to another phase. */
typedef enum plr_imu_trigger {
    PLR_IMU_WORLD_GIVEN,    /* the pose was set with a covariance, measured, or found in a map */
    PLR_IMU_STARTS_AT_REST, /* tilt and gyro bias are measured, velocity is zero */
    PLR_IMU_STARTS_MOVING,  /* tilt is measured, velocity is to be found */
    PLR_IMU_STARTS_AS_TOLD, /* velocity was set beside the pose */
    PLR_IMU_ANCHORS         /* some time after a start in motion */
} plr_imu_trigger;

/* The phase that follows; a trigger that leads nowhere from here changes nothing. */
void plr_imu_phase_change(plr_inertial *inertial, plr_imu_trigger trigger);

#endif
