// SPDX-License-Identifier: MIT
/* Hours of standing still, noise on every reading and pixel: the pose stays where it is, P stays
 * positive. The filter learns nothing new for 100,000 frames, and must not talk itself into anything. */
#include <math.h>
#include <stdio.h>
#include <unity.h>

#include "state/covariance.h"
#include "support/axes.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/rig.h"

/* Nearly three hours at ten frames a second; in the short form five minutes. */
enum { FRAMES = PELORUS_SHORT_FORM ? 3000 : 100000, LANDMARKS = 12, EVERY = 1000 };

void setUp(void) {
    rig_set_up();
    rig.options.speed_mps = rig.options.turn_radps = rig.options.sway = 0;
    rig.options.most_seen = LANDMARKS;
}

static void demand_still_there(void) {
    double P[36];
    const plr_pose pose = pose_of(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    TEST_ASSERT_GREATER_THAN_DOUBLE(0, oracle_smallest_eigenvalue(6, P));
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(0.05, 0, pose.p[i]);
        TEST_ASSERT_DOUBLE_WITHIN(4 * sqrt(P[7 * i]), 0, pose.p[i]);
        TEST_ASSERT_LESS_THAN_DOUBLE(0.02, sqrt(P[7 * i]));
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.005, 0, largest_difference(rig_identity.R, pose.R, 9));
}

static void check_hours(bool bias) {
    rig.config.bias = bias;
    rig_begin();
    for (unsigned k = 0; k < FRAMES; k += EVERY) {
        rig_stand(EVERY);
        demand_still_there();
        TEST_ASSERT_TRUE(plr_covariance_is_positive(&rig.filter.belief));
        /* all that is left uncertain is common to all landmarks, so their correlations are near 1,
         * and every frame leaves one rounding there */
        TEST_ASSERT_GREATER_THAN_DOUBLE(-(double)(k + EVERY) * REAL_EPSILON,
                                        rig_smallest_correlation());
    }
    TEST_ASSERT_EQUAL_UINT(rig.report.matched, LANDMARKS - rig.report.poor);
    TEST_ASSERT_EQUAL_UINT64(0, rig.filter.totals.evicted);
    TEST_ASSERT_EQUAL_UINT32(0, rig.filter.totals.locks);
}

static void test_hours_of_standing_still_move_nothing(void) {
    check_hours(false);
}

static void test_hours_of_standing_still_with_biases_move_nothing(void) {
    check_hours(true);
}

/* The same hours without any noise: certainty may grow, and never beyond what floats can hold. */
static void test_hours_without_noise_stay_exact(void) {
    rig.options.pixel_sigma_px = rig.options.velocity_sigma_mps = rig.options.gyro_sigma_radps = 0;
    rig.config.bias = 0;
    each_axis(rig.config.velocity_sigma, 0);
    each_axis(rig.config.gyro_sigma, 0);
    rig_begin();
    rig_stand(FRAMES);
    TEST_ASSERT_TRUE(plr_covariance_is_positive(&rig.filter.belief));
    TEST_ASSERT_GREATER_THAN_DOUBLE(0, rig_smallest_correlation());
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0, rig.filter.belief.p_WB[0]);
}
