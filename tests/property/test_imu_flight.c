// SPDX-License-Identifier: MIT
/* An IMU with noise as it is told: orientation, position, velocity and biases stay within their
 * covariance, whichever way the filter has started. Simulated flights, normalised squared errors
 * against chi-square. */
#include <unity.h>

#include "support/imu_rig.h"

/* In the short form one short flight of each start, and with it wider bounds. */
enum { RUNS = PELORUS_SHORT_FORM ? 1 : 20, FRAMES = PELORUS_SHORT_FORM ? 100 : 300, STARTS = 3 };

void setUp(void) {
    imu_rig_set_up();
}

static void begin_and_settle(imu_rig_start start, uint64_t seed) {
    imu_rig_begin(start, seed);
    if (start == IMU_RIG_AT_REST)
        imu_rig_fly(12);
    while (start == IMU_RIG_IN_MOTION && imu_rig.filter.source.inertial.phase != PLR_IMU_SETTLED)
        imu_rig_fly(1);
    if (start != IMU_RIG_GIVEN)
        imu_rig_adopt_world();
}

static void test_errors_stay_within_the_covariance(void) {
    static const char *const names[STARTS] = {"given", "at rest", "in motion"};
    for (int start = 0; start < STARTS; start++) {
        imu_rig_errors sum = {0};
        for (uint64_t seed = 1; seed <= RUNS; seed++) {
            begin_and_settle((imu_rig_start)start, seed);
            imu_rig_fly(FRAMES);
            const imu_rig_errors e = imu_rig_errors_now();
            imu_rig_add(&sum, &e, 1.0 / RUNS);
        }
        imu_rig_demand_consistent(names[start], &sum, RUNS, false);
    }
}
