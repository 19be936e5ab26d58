// SPDX-License-Identifier: MIT
/* An IMU with noise as it is told: orientation, position, velocity and biases stay within their
 * covariance, whichever way the filter has started. Simulated flights, normalised squared errors
 * against chi-square. */
#include <math.h>
#include <stdio.h>
#include <unity.h>

#include "support/chi_square.h"
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
    while (start == IMU_RIG_IN_MOTION && !imu_rig.filter.inertial.anchored)
        imu_rig_fly(1);
    if (start != IMU_RIG_GIVEN)
        imu_rig_adopt_world();
}

static void test_errors_stay_within_the_covariance(void) {
    static const char *const names[STARTS] = {"given", "at rest", "in motion"};
    double low, high;
    chi_square_bounds(3 * RUNS, &low, &high);
    for (int start = 0; start < STARTS; start++) {
        imu_rig_errors sum = {0};
        for (uint64_t seed = 1; seed <= RUNS; seed++) {
            begin_and_settle((imu_rig_start)start, seed);
            imu_rig_fly(FRAMES);
            const imu_rig_errors e = imu_rig_errors_now();
            imu_rig_add(&sum, &e, 1.0 / RUNS);
        }
        printf("%s: NEES orientation %.3f, position %.3f, velocity %.3f, b_a %.3f, b_g %.3f; "
               "%.4f m, %.4f rad\n",
               names[start], sum.orientation / 3, sum.position / 3, sum.velocity / 3,
               sum.accel_bias / 3, sum.gyro_bias / 3, sqrt(sum.metres), sqrt(sum.rad));
        const double all[5] = {sum.orientation, sum.position, sum.velocity, sum.accel_bias,
                               sum.gyro_bias};
        for (unsigned i = 0; i < 5; i++)
            TEST_ASSERT_TRUE_MESSAGE(all[i] / 3 > low && all[i] / 3 < high, names[start]);
    }
}
