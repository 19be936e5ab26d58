// SPDX-License-Identifier: MIT
/* Of a single reading the noise of way and velocity is one and the same error: the two correlate fully. Where
 * it was large, what was left of the velocity's variance was a difference of two large numbers, and in float32
 * less than nothing. */
#include <math.h>
#include <unity.h>

#include "support/imu_rig.h"
#include "support/reseal.h"

enum { FRAMES = 20 };

static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_rig_set_up();
}

/* What a reading held for so long adds that may be wrong by so much: v by `sigma`, the way by half of that
 * for the same time. */
static void add_noise(plr_real seconds, plr_real sigma) {
    const plr_real half = PLR_R(0.5) * seconds, variance = sigma * sigma;
    for (unsigned i = 0; i < 3; i++) {
        f->motion.Q[(PLR_POSE_DIM + 1) * i] += half * half * variance;
        f->motion.core.Q_nc[PLR_REST_DIM * i + i] += half * variance;
        f->motion.core.Q_cc[(PLR_REST_DIM + 1) * i] += variance;
    }
    reseal(f);
}

static void test_one_reading_that_may_be_wrong_by_much_leaves_every_variance_positive(void) {
    static const plr_real sigmas_mps[] = {PLR_R(10.5), PLR_R(100), PLR_R(1000)};
    for (unsigned k = 0; k < 3; k++) {
        double P[36];
        imu_rig_begin(IMU_RIG_GIVEN, 1);
        imu_rig_fly(20);
        for (unsigned frame = 0; frame < FRAMES; frame++) {
            imu_rig_readings(IMU_RIG_EVERY);
            add_noise(PLR_R(0.1), sigmas_mps[k]);
            imu_rig_frame();
            TEST_ASSERT_EQUAL_UINT32(0, f->totals.recoveries);
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(f, P));
            TEST_ASSERT_TRUE(P[0] > 0 && P[7] > 0 && P[14] > 0);
            TEST_ASSERT_TRUE(sqrt(P[0] + P[7] + P[14]) < 2 * (double)sigmas_mps[k]);
        }
    }
}
