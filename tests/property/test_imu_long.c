// SPDX-License-Identifier: MIT
/* Ten minutes with an IMU: the errors stay within the covariance as they were in the first minute, and the
 * covariance stays one. */
#include <stdio.h>
#include <unity.h>

#include "support/chi_square.h"
#include "support/imu_rig.h"

/* Frames at 5 Hz; each fourth is looked at. */
enum { RUNS = 4, MINUTE = 300, MINUTES = 10, LOOK = 4 };

void setUp(void) {
    imu_rig_set_up();
    imu_rig.options.rate_hz = 200;
}

/* Errors of each minute over all flights, and those at the end. */
static imu_rig_errors of_minute[MINUTES], at_end;

static void fly_all(void) {
    const double share = (double)LOOK / (RUNS * MINUTE);
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        imu_rig_begin(IMU_RIG_GIVEN, 500 + seed);
        imu_rig_errors e = {0};
        for (unsigned k = 0; k < MINUTES * MINUTE / LOOK; k++) {
            imu_rig_fly(LOOK);
            e = imu_rig_errors_now();
            imu_rig_add(&of_minute[k * LOOK / MINUTE], &e, share);
        }
        imu_rig_add(&at_end, &e, 1.0 / RUNS);
        TEST_ASSERT_EQUAL_UINT32(0, imu_rig.filter.totals.recoveries);
        TEST_ASSERT_EQUAL_UINT32(0, imu_rig.filter.totals.locks);
        TEST_ASSERT_TRUE(imu_rig.filter.totals.gated < imu_rig.filter.totals.matched / 50);
    }
}

/* What the pictures show soon is known anew every few seconds: the mean over a minute says much. Of
 * position and heading each flight has one error that only grows. */
static void test_ten_minutes_are_as_consistent_as_the_first(void) {
    fly_all();
    for (unsigned m = 0; m < MINUTES; m++) {
        const imu_rig_errors *e = &of_minute[m];
        char minute[16];
        snprintf(minute, sizeof minute, "minute %u", m + 1);
        imu_rig_tell(minute, e);
        TEST_ASSERT_TRUE(e->velocity / 3 > 0.75 && e->velocity / 3 < 1.3);
        TEST_ASSERT_TRUE(e->gyro_bias / 3 > 0.5 && e->gyro_bias / 3 < 1.8);
        TEST_ASSERT_TRUE(e->accel_bias / 3 > 0.4 && e->accel_bias / 3 < 2.2);
    }
    chi_square_demand("position", at_end.position / 3, 3 * RUNS);
    chi_square_demand("orientation", at_end.orientation / 3, 3 * RUNS);
}
