// SPDX-License-Identifier: MIT
/* Finite numbers that no sensor gives are refused before the filter sees them. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "session/plausible.h"
#include "support/session_desk.h"

static bool plausible_twist(const plr_twist *twist) {
    const plr_message message = {.kind = PLR_KIND_TWIST, .as.twist.twist = *twist};
    return plr_plausible_message(&message);
}

static bool plausible_start(const plr_start *start) {
    const plr_message message = {.kind = PLR_KIND_START, .as.start = *start};
    return plr_plausible_message(&message);
}

static bool plausible_landmark(const plr_landmark *landmark) {
    const plr_message message = {.kind = PLR_KIND_LANDMARK, .as.landmark.landmark = *landmark};
    return plr_plausible_message(&message);
}

static void test_a_limit_is_included_and_what_is_beyond_is_not(void) {
    plr_twist twist = {{1e4, -1e4, 0}, {1e3, -1e3, 0}};
    plr_pose pose = {.p = {1e9, -1e9, 0}};
    TEST_ASSERT_TRUE(plausible_twist(&twist));
    TEST_ASSERT_TRUE(plr_plausible(PLR_GROUP_POSE, &pose));
    twist.v_B_mps[1] = -1.0001e4;
    TEST_ASSERT_FALSE(plausible_twist(&twist));
    twist.v_B_mps[1] = 0;
    twist.w_B_radps[2] = 1.0001e3;
    TEST_ASSERT_FALSE(plausible_twist(&twist));
    pose.p[2] = 1.0001e9;
    TEST_ASSERT_FALSE(plr_plausible(PLR_GROUP_POSE, &pose));
}

static void test_a_covariance_counts_only_where_it_is_given(void) {
    plr_start start;
    memset(&start, 0, sizeof start);
    start.P_xi[20] = 1e13;
    TEST_ASSERT_TRUE(plausible_start(&start));
    start.has_covariance = true;
    TEST_ASSERT_FALSE(plausible_start(&start));
}

static void test_each_number_of_a_bias_and_a_landmark_is_looked_at(void) {
    for (int i = 0; i < 12; i++) {
        plr_start start;
        plr_landmark landmark;
        memset(&start, 0, sizeof start);
        memset(&landmark, 0, sizeof landmark);
        *(i < 6 ? &start.bias[i] : &start.bias_variance[i - 6]) = -2e12;
        *(i < 3 ? &landmark.p_W_m[i] : &landmark.P_W_m2[i - 3]) = 2e12;
        TEST_ASSERT_FALSE(plr_plausible(PLR_GROUP_BIAS, &start));
        TEST_ASSERT_FALSE(plausible_landmark(&landmark));
    }
}

static void test_what_is_not_finite_is_left_to_the_filter(void) {
    const plr_twist twist = {{(double)NAN, (double)INFINITY, 0}, {-(double)INFINITY, 0, 0}};
    TEST_ASSERT_TRUE(plausible_twist(&twist));
}

/* With start timing a reading works on the step behind it: taken once, an absurd one would refuse
 * every step from there on. */
static void test_an_absurd_reading_costs_itself_alone(void) {
    static const double speeds[] = {1e5, 1e30, 1e300};
    for (unsigned n = 0; n < 3; n++) {
        plr_message twist = drive_twist(0.3);
        twist.as.twist.twist.v_B_mps[0] = speeds[n];
        desk_clear(1);
        desk_begin_drive();
        for (int k = 0; k < 10; k++) {
            if (k == 3)
                desk_send(twist);
            else
                desk_send(drive_twist(0.1 * k));
            desk_send(drive_stereo(0.1 * k));
        }
        desk_run();
        TEST_ASSERT_EQUAL_UINT32(1, session.totals.refused);
        TEST_ASSERT_TRUE(session.last.used > 3);
    }
}
