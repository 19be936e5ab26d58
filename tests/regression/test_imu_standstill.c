// SPDX-License-Identifier: MIT
/* What a review of standstills with an IMU found: a second reading of the same time, a wheel's or a
 * standstill's, used the mean rate anew as if it were half a second of new readings, until the gyro's
 * bias was believed twice too well. */
#include <unity.h>

#include "support/imu_rig.h"

enum { GYRO = 3 };

static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_rig_set_up();
}

static void measure_standstill(void) {
    const plr_reading still = {.t_ns = imu_rig.flight.t_ns,
                               .sensor = PLR_SENSOR_STANDSTILL,
                               .axes = 3,
                               .sigma = {0.01, 1e-4}};
    plr_reading_result result;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(f, &still, &result));
    TEST_ASSERT_TRUE(result.used);
}

static double bias_variance(void) {
    double b[6], P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(f, b, P));
    return P[7 * GYRO];
}

static void test_a_second_standstill_of_the_same_time_tells_nothing_new(void) {
    imu_rig.options.rest_s = 60;
    imu_rig_begin(IMU_RIG_GIVEN, 1);
    imu_rig_fly(2);
    const double before = bias_variance();
    measure_standstill();
    const double once = bias_variance();
    TEST_ASSERT_TRUE(once < 0.9 * before);
    for (unsigned more = 0; more < 5; more++)
        measure_standstill();
    TEST_ASSERT_TRUE(bias_variance() > 0.9 * once);
}
