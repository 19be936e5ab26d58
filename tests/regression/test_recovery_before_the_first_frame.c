// SPDX-License-Identifier: MIT
/* An IMU that has found its tilt says how well. A covariance that broke down before the first frame that was
 * used fell back to that of the pose as it was set, of an exact tilt: GOOD, and beyond 5 sigma for a minute. */
#include <unity.h>

#include "math/packed.h"
#include "state/blocks.h"
#include "support/imu_rig.h"
#include "support/reseal.h"

static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_rig_set_up();
    imu_rig.options.rest_s = 3;
}

/* The variances of roll and pitch; the body stands upright. */
static void tilt_variance(double of[2]) {
    double P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(f, P));
    of[0] = P[21];
    of[1] = P[28];
}

static void demand_that_tilt_stays_as_uncertain(void) {
    double before[2], after[2];
    const unsigned row = plr_row_of(&f->belief, PLR_BLOCK_VELOCITY);
    tilt_variance(before);
    TEST_ASSERT_TRUE(before[0] > 1e-7 && before[1] > 1e-7);
    f->belief.P[plr_packed_at(row, row)] = PLR_R(-1);
    reseal(f);
    imu_rig_readings(IMU_RIG_EVERY);
    imu_rig_frame();
    TEST_ASSERT_EQUAL_UINT32(1, f->totals.recoveries);
    tilt_variance(after);
    for (int i = 0; i < 2; i++)
        TEST_ASSERT_TRUE(after[i] > 0.9 * before[i]);
}

static void test_a_recovery_after_a_start_at_rest_keeps_the_tilts_covariance(void) {
    imu_rig_begin(IMU_RIG_AT_REST, 1);
    for (unsigned k = 0; k < 3 * 400 && f->source.inertial.phase < PLR_IMU_UNSETTLED; k++)
        (void)imu_rig_read();
    TEST_ASSERT_TRUE(f->source.inertial.phase >= PLR_IMU_UNSETTLED);
    demand_that_tilt_stays_as_uncertain();
}
