// SPDX-License-Identifier: MIT
/* Twists: what interval a reading stands for, what is refused, and what a refusal leaves. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/matrices.h"
#include "support/oracle.h"
#include "support/rig.h"
#include "support/rigid.h"

static const double eps = REAL_EPSILON;

/* Four readings, and when: unevenly spaced. */
enum { READINGS = 4 };
static const plr_time_ns times[READINGS] = {1000000000, 1010000000, 1040000000, 1060000000};
static const plr_twist readings[READINGS] = {{{1, 0.1, 0}, {0.1, 0, 0.5}},
                                             {{2, 0, -0.2}, {0, 0.3, -0.4}},
                                             {{-1, 0.5, 0}, {0.2, -0.1, 0.3}},
                                             {{3, 0, 0.3}, {-0.3, 0, 0.1}}};

void setUp(void) {
    rig_set_up();
}

static plr_status predict(plr_time_ns t_ns, const plr_twist *twist) {
    return plr_filter_predict(&rig.filter, t_ns, twist);
}

/* T <- T Exp(seconds (a + b) / 2) */
static void hold(double T[16], const plr_twist *a, const plr_twist *b, double seconds) {
    double xi[6], D[16], next[16];
    for (int i = 0; i < 3; i++) {
        xi[i] = seconds * (a->v_B_mps[i] + b->v_B_mps[i]) / 2;
        xi[3 + i] = seconds * (a->w_B_radps[i] + b->w_B_radps[i]) / 2;
    }
    rigid_exp(D, xi);
    square_multiply(4, T, D, next);
    memcpy(T, next, sizeof next);
}

static void demand_pose(const double T[16]) {
    double got[16];
    const plr_pose pose = pose_of(&rig.filter);
    rigid_from_pose(got, &pose);
    TEST_ASSERT_DOUBLE_WITHIN(50 * eps, 0, largest_difference(T, got, 16));
}

static void begin_with_timing(plr_twist_timing timing) {
    rig.config.twist_timing = (uint8_t)timing;
    rig_begin();
}

/* ---------------------------------------------------------------- timing */

/* Which two readings' mean holds between reading k and k + 1. */
static void check_timing(plr_twist_timing timing) {
    double T[16];
    rigid_exp(T, (const double[6]){0});
    begin_with_timing(timing);
    for (int k = 0; k < READINGS; k++) {
        TEST_ASSERT_EQUAL_INT(PLR_OK, predict(times[k], &readings[k]));
        TEST_ASSERT_EQUAL_UINT64(times[k], plr_filter_time(&rig.filter));
        if (k > 0) {
            const plr_twist *from = &readings[timing == PLR_TWIST_END ? k : k - 1];
            const plr_twist *to = &readings[timing == PLR_TWIST_START ? k - 1 : k];
            hold(T, from, to, (double)(times[k] - times[k - 1]) * 1e-9);
        }
        demand_pose(T);
    }
}

static void test_with_start_a_reading_holds_until_the_next(void) {
    check_timing(PLR_TWIST_START);
}

static void test_with_end_a_reading_holds_since_the_last(void) {
    check_timing(PLR_TWIST_END);
}

static void test_with_mid_the_mean_holds_between_two(void) {
    check_timing(PLR_TWIST_MID);
}

/* A frame between two readings: the latest holds until its time, and only the rest of the interval
 * is left for the next. */
static void check_frame_between(plr_twist_timing timing) {
    const plr_frame frame = {times[1] + 12000000, PLR_NO_BUDGET, 0, NULL};
    double T[16];
    rigid_exp(T, (const double[6]){0});
    begin_with_timing(timing);
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(times[0], &readings[0]));
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(times[1], &readings[1]));
    hold(T, &readings[timing == PLR_TWIST_END ? 1 : 0],
         &readings[timing == PLR_TWIST_START ? 0 : 1], 0.01);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, NULL));
    TEST_ASSERT_EQUAL_UINT64(frame.t_ns, plr_filter_time(&rig.filter));
    hold(T, &readings[1], &readings[1], 0.012);
    demand_pose(T);
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(times[2], &readings[2]));
    hold(T, &readings[timing == PLR_TWIST_END ? 2 : 1],
         &readings[timing == PLR_TWIST_START ? 1 : 2], 0.018);
    demand_pose(T);
}

static void test_a_frame_between_readings_splits_the_interval(void) {
    check_frame_between(PLR_TWIST_START);
    check_frame_between(PLR_TWIST_END);
    check_frame_between(PLR_TWIST_MID);
}

static void test_a_frame_before_the_first_reading_stands_still(void) {
    const plr_frame first = {500, PLR_NO_BUDGET, 0, NULL},
                    second = {900000500, PLR_NO_BUDGET, 0, NULL};
    double T[16], before[36], after[36];
    rigid_exp(T, (const double[6]){0});
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &first, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, before));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &second, NULL));
    demand_pose(T);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, after));
    TEST_ASSERT_GREATER_THAN_DOUBLE(before[0], after[0]); /* and knows that it may have moved */
}

static void test_a_reading_at_the_time_of_a_frame_takes_over_from_there(void) {
    const plr_frame frame = {times[1], PLR_NO_BUDGET, 0, NULL};
    double T[16];
    rigid_exp(T, (const double[6]){0});
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(times[0], &readings[0]));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(times[1], &readings[1]));
    hold(T, &readings[0], &readings[0], 0.01);
    demand_pose(T);
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(times[2], &readings[2]));
    hold(T, &readings[1], &readings[1], 0.03);
    demand_pose(T);
}

/* The first reading after a pose from outside has no reading before it: it holds since the pose. */
static void test_the_first_reading_holds_since_the_pose_from_outside(void) {
    double T[16];
    rigid_exp(T, (const double[6]){0});
    TEST_ASSERT_EQUAL_INT(
        PLR_OK, plr_filter_set_pose(&rig.filter, times[0] - 5000000, &rig_identity, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(times[0], &readings[0]));
    hold(T, &readings[0], &readings[0], 0.005);
    demand_pose(T);
}

static void test_the_bias_is_taken_off_every_reading(void) {
    const double b[6] = {0.5, -0.25, 0.125, 0.0625, 0, -0.5}, variance[6] = {0};
    double T[16];
    rigid_exp(T, (const double[6]){0});
    rig.config.bias = 1;
    rig_begin();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_bias(&rig.filter, b, variance));
    for (int k = 0; k < READINGS; k++)
        TEST_ASSERT_EQUAL_INT(PLR_OK, predict(times[k], &readings[k]));
    for (int k = 1; k < READINGS; k++) {
        plr_twist u = readings[k - 1];
        for (int i = 0; i < 3; i++) {
            u.v_B_mps[i] -= b[i];
            u.w_B_radps[i] -= b[3 + i];
        }
        hold(T, &u, &u, (double)(times[k] - times[k - 1]) * 1e-9);
    }
    demand_pose(T);
}

static void test_readings_touch_neither_landmarks_nor_covariance(void) {
    rig_drive(3);
    rig_remember();
    for (int k = 0; k < 50; k++)
        rig_twist();
    TEST_ASSERT_EQUAL_MEMORY(rig.before.belief.P, rig.filter.belief.P, sizeof rig.filter.belief.P);
    TEST_ASSERT_EQUAL_MEMORY(rig.before.belief.slots, rig.filter.belief.slots,
                             sizeof rig.filter.belief.slots);
    TEST_ASSERT_EQUAL_UINT32(rig.before.totals.twists + 50, rig.filter.totals.twists);
}

/* ---------------------------------------------------------------- refusals */

static void test_null_pointers_are_refused(void) {
    rig_remember();
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_predict(NULL, 1, &readings[0]));
    rig_demand_untouched(PLR_E_ARGUMENT, predict(1, NULL));
}

static void test_time_must_ascend_from_reading_to_reading(void) {
    rig_drive(2);
    rig_twist();
    rig_remember();
    const plr_time_ns now = plr_filter_time(&rig.filter);
    rig_demand_refusal(PLR_E_TIME, predict(now, &readings[0]));
    rig_demand_refusal(PLR_E_TIME, predict(now - 1, &readings[0]));
    rig_demand_refusal(PLR_E_TIME, predict(0, &readings[0]));
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(now + 1, &readings[0]));
}

static void test_a_reading_older_than_the_last_frame_is_refused(void) {
    rig_drive(2);
    rig_remember();
    rig_demand_refusal(PLR_E_TIME, predict(plr_filter_time(&rig.filter) - 1, &readings[0]));
}

static void test_a_gap_is_refused_beyond_its_limit(void) {
    rig_drive(2);
    rig_remember();
    const plr_time_ns now = plr_filter_time(&rig.filter);
    rig_demand_refusal(PLR_E_GAP, predict(now + 2000000001, &readings[0]));
    rig_demand_refusal(PLR_E_GAP, predict(UINT64_MAX, &readings[0]));
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(now + 1000000000, &readings[0]));
}

static void test_the_first_reading_may_come_at_any_time(void) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(UINT64_MAX - 20000000, &readings[0]));
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(UINT64_MAX - 10000000, &readings[0]));
    TEST_ASSERT_EQUAL_INT(PLR_E_TIME, predict(5, &readings[0])); /* no wrapping around */
}

static void test_numbers_that_are_none_are_refused(void) {
    static const double bad[3] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
    rig_drive(2);
    rig_remember();
    const plr_time_ns next = plr_filter_time(&rig.filter) + RIG_STEP_NS;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++) {
            plr_twist twist = readings[0];
            twist.v_B_mps[i] = bad[k];
            rig_demand_refusal(PLR_E_NOT_FINITE, predict(next, &twist));
            twist = readings[0];
            twist.w_B_radps[i] = bad[k];
            rig_demand_refusal(PLR_E_NOT_FINITE, predict(next, &twist));
        }
}

static void test_a_step_beyond_pi_or_a_kilometre_is_refused(void) {
    static const double too_fast[] = {1.1e5, -1e20, 1e38, 1e300};
    rig_drive(2);
    rig_remember();
    const plr_time_ns next = plr_filter_time(&rig.filter) + RIG_STEP_NS;
    for (unsigned k = 0; k < sizeof too_fast / sizeof *too_fast; k++) {
        plr_twist twist = readings[0];
        twist.v_B_mps[1] = too_fast[k];
        rig_demand_refusal(PLR_E_RANGE, predict(next, &twist));
        twist = readings[0];
        twist.w_B_radps[2] = too_fast[k];
        rig_demand_refusal(PLR_E_RANGE, predict(next, &twist));
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(next, &readings[0]));
}

static void test_a_refused_first_reading_does_not_start_the_clock(void) {
    const plr_twist wild = {{1e30, 0, 0}, {0}};
    rig_remember();
    rig_demand_refusal(PLR_E_RANGE, predict(times[0], &wild));
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(times[0] - 500, &readings[0]));
}

/* ---------------------------------------------------------------- mapping */

static void begin_mapping(void) {
    rig.config.mode = PLR_MODE_MAPPING;
    rig_begin();
}

static void test_mapping_checks_readings_and_ignores_them(void) {
    const plr_twist bad = {{(double)NAN, 0, 0}, {0}}, huge = {{1e300, 0, 0}, {0}};
    begin_mapping();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(&rig.filter, times[0], &rig_identity));
    rig_remember();
    rig_demand_refusal(PLR_E_NOT_FINITE, predict(times[1], &bad));
    if (PLR_REAL == 32)
        rig_demand_refusal(PLR_E_RANGE, predict(times[1], &huge));
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(times[1], &readings[1]));
    TEST_ASSERT_EQUAL_INT(PLR_OK, predict(0, &readings[1])); /* its time does not matter either */
    TEST_ASSERT_EQUAL_UINT64(times[0], plr_filter_time(&rig.filter));
    double T[16];
    rigid_exp(T, (const double[6]){0});
    demand_pose(T);
}

static void test_move_to_belongs_to_mapping(void) {
    rig_remember();
    rig_demand_refusal(PLR_E_MODE, plr_filter_move_to(&rig.filter, 1, &rig_identity));
}

static void test_move_to_refuses_what_is_no_pose_or_no_later(void) {
    plr_pose bad = rig_identity;
    begin_mapping();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(&rig.filter, times[0], &rig_identity));
    rig_remember();
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_move_to(NULL, times[1], &rig_identity));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_move_to(&rig.filter, times[1], NULL));
    rig_demand_refusal(PLR_E_TIME, plr_filter_move_to(&rig.filter, times[0], &rig_identity));
    rig_demand_refusal(PLR_E_TIME, plr_filter_move_to(&rig.filter, 0, &rig_identity));
    bad.R[4] = (double)INFINITY;
    rig_demand_refusal(PLR_E_NOT_FINITE, plr_filter_move_to(&rig.filter, times[1], &bad));
    bad.R[4] = -1;
    rig_demand_refusal(PLR_E_ARGUMENT, plr_filter_move_to(&rig.filter, times[1], &bad));
    bad = rig_identity;
    bad.p[1] = -1e10;
    rig_demand_refusal(PLR_E_RANGE, plr_filter_move_to(&rig.filter, times[1], &bad));
}
