// SPDX-License-Identifier: MIT
#include "process/imu_phase.h"

#include "math/arrows.h"
#include "pelorus/assertions.h"

/* But for PLR_IMU_STARTS_AS_TOLD, which settles it from all. */
static const plr_arrow arrows[] = {
    {PLR_IMU_ALIGNS, PLR_IMU_WORLD_GIVEN, PLR_IMU_ALIGNS_IN_WORLD},
    {PLR_IMU_ALIGNS, PLR_IMU_STARTS_AT_REST, PLR_IMU_SETTLED},
    {PLR_IMU_ALIGNS, PLR_IMU_STARTS_MOVING, PLR_IMU_UNSETTLED},
    {PLR_IMU_ALIGNS_IN_WORLD, PLR_IMU_STARTS_AT_REST, PLR_IMU_SETTLED},
    {PLR_IMU_ALIGNS_IN_WORLD, PLR_IMU_STARTS_MOVING, PLR_IMU_UNSETTLED_IN_WORLD},
    {PLR_IMU_UNSETTLED, PLR_IMU_WORLD_GIVEN, PLR_IMU_UNSETTLED_IN_WORLD},
    {PLR_IMU_UNSETTLED, PLR_IMU_ANCHORS, PLR_IMU_SETTLED},
    {PLR_IMU_UNSETTLED_IN_WORLD, PLR_IMU_ANCHORS, PLR_IMU_SETTLED},
};

void plr_imu_phase_change(plr_inertial *inertial, plr_imu_trigger trigger) {
    PLR_ASSERT(inertial->phase < PLR_IMU_PHASES);
    inertial->phase = trigger == PLR_IMU_STARTS_AS_TOLD
                          ? (uint8_t)PLR_IMU_SETTLED
                          : (uint8_t)plr_arrow_follow(arrows, sizeof arrows / sizeof *arrows,
                                                      inertial->phase, trigger);
}
