// SPDX-License-Identifier: MIT
/* A gyro that warms up: at rest its bias was measured to a fraction of a millirad per second, and then it moves by a
 * hundredth in two minutes. The pose was right to centimetres, and health DEGRADED in more than half of the frames. */
#include <stdio.h>
#include <unity.h>

#include "support/imu_rig.h"

enum { SECOND = 10 /* frames */, SECONDS = 100 };

static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_rig_set_up();
}

/* Flies while the bias grows to this, and returns the frames that tell of a bias. */
static unsigned told_of_bias(double most_radps, uint64_t seed) {
    unsigned told = 0;
    imu_rig_begin(IMU_RIG_AT_REST, seed);
    for (unsigned k = 1; k <= SECONDS * SECOND * IMU_RIG_EVERY; k++) {
        const double share = (double)k / (SECONDS * SECOND * IMU_RIG_EVERY);
        imu_flight_move(&imu_rig.flight);
        plr_imu imu = imu_flight_read(&imu_rig.flight);
        for (int i = 0; i < 3; i++)
            imu.w_B_radps[i] += most_radps * share * (i == 1 ? -1 : 1);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(f, imu_rig.flight.t_ns, &imu));
        if (k % IMU_RIG_EVERY != 0)
            continue;
        imu_rig_frame();
        told += (imu_rig.report.reasons & PLR_REASON_BIAS_OFF_PRIOR) != 0;
    }
    printf("a bias that grows to %g rad/s: told in %u of %u frames\n", most_radps, told,
           SECONDS * SECOND);
    return told;
}

static void test_a_bias_that_is_well_known_and_moves_is_no_fault(void) {
    imu_rig.config.gyro_walk = imu_rig.config.gyro_walk > 2e-4 ? imu_rig.config.gyro_walk : 2e-4;
    TEST_ASSERT_EQUAL_UINT(0, told_of_bias(0.006, 1));
    TEST_ASSERT_EQUAL_UINT(0, told_of_bias(0.011, 2));
}

/* The settings' sigma of a gyro's bias is 0.02 rad/s. */
static void test_a_bias_beyond_what_the_settings_allow_is_told(void) {
    imu_rig.config.gyro_walk = 1e-3;
    TEST_ASSERT_TRUE(told_of_bias(0.15, 3) > 5 * SECOND);
}
