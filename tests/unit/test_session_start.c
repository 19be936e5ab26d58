// SPDX-License-Identifier: MIT
/* Where the pose starts: START, TRUTH or identity, and what a START in mid-flight does. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/reseal.h"
#include "support/session_desk.h"

void setUp(void) {
    desk_clear(1);
}

static void assert_pose_near(const plr_pose *expected, double tolerance_m) {
    const plr_pose pose = pose_of(&session.filter);
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(tolerance_m, expected->p[i], pose.p[i]);
    for (int i = 0; i < 9; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, expected->R[i], pose.R[i]);
}

static void assert_pose_is_that_of(double t_s) {
    const plr_pose expected = drive_pose(t_s);
    assert_pose_near(&expected, 1e-3);
}

static const plr_pose IDENTITY = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};

/* --- where the pose starts --- */

static void test_start_wins_over_truth(void) {
    desk_begin_drive();
    desk_send(drive_start(2)); /* says that the body stands where it will be at 2 s */
    desk_send(drive_twist(2));
    plr_message truth = drive_truth(2);
    truth.as.truth.T_WB = IDENTITY;
    desk_send(truth);
    desk_send(drive_stereo(2));
    desk_run();
    assert_pose_is_that_of(2);
}

static void test_the_first_truth_counts_where_there_is_no_start(void) {
    desk_begin_drive();
    desk_send(drive_twist(3));
    desk_send(drive_truth(3));
    desk_send(drive_stereo(3));
    desk_send(drive_twist(3.1));
    plr_message later = drive_truth(3.1);
    later.as.truth.T_WB.p[0] += 50;
    desk_send(later);
    desk_send(drive_stereo(3.1));
    desk_run();
    assert_pose_is_that_of(3.1);
}

/* The twist of 3.0 s carries the body from the TRUTH at 3.05 s on. */
static void test_twists_may_precede_the_truth(void) {
    desk_begin_drive();
    desk_send(drive_twist(2.9));
    desk_send(drive_twist(3));
    desk_send(drive_truth(3.05));
    desk_send(drive_stereo(3.1));
    desk_run();
    assert_pose_is_that_of(3.1);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
    const plr_message answer = desk_answer(PLR_KIND_POSE);
    TEST_ASSERT_EQUAL_UINT16(0, answer.as.pose.reset_count); /* a start is no reset */
}

static void test_twists_may_precede_the_start(void) {
    desk_begin_drive();
    desk_send(drive_start(3.05));
    desk_send(drive_twist(2.9));
    desk_send(drive_twist(3));
    desk_send(drive_stereo(3.1));
    desk_run();
    assert_pose_is_that_of(3.1);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
}

static void test_without_either_it_is_identity(void) {
    desk_begin_drive();
    desk_send(drive_twist(5));
    desk_send(drive_stereo(5));
    desk_send(drive_truth(5.1)); /* behind the first frame: for evaluation alone */
    desk_run();
    assert_pose_near(&IDENTITY, 1e-9);
}

static void test_identity_can_be_asked_for(void) {
    options.start = PLR_START_IDENTITY;
    desk_begin_drive();
    desk_send(drive_start(5));
    desk_send(drive_truth(5));
    desk_send(drive_twist(5));
    desk_send(drive_stereo(5));
    desk_run();
    assert_pose_near(&IDENTITY, 1e-9);
}

static void test_who_asks_for_truth_gets_no_frame_before_it(void) {
    options.start = PLR_START_TRUTH;
    desk_begin_drive();
    desk_send(drive_start(5));
    desk_send(drive_twist(5));
    desk_send(drive_stereo(5));
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_KIND_STEREO, refused_kind);
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, refused_status);
    desk_send(drive_truth(5.05));
    desk_send(drive_stereo(5.1));
    desk_run();
    assert_pose_is_that_of(5.1);
}

static void test_who_asks_for_a_start_gets_no_frame_before_it(void) {
    options.start = PLR_START_RECORDED;
    desk_begin_drive();
    desk_send(drive_twist(5));
    desk_send(drive_truth(5));
    desk_send(drive_stereo(5));
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, refused_status);
    desk_send(drive_start(5.05));
    desk_send(drive_stereo(5.1));
    desk_run();
    assert_pose_is_that_of(5.1);
}

static void test_a_start_behind_the_first_frame_is_refused_and_identity_taken(void) {
    desk_begin_drive();
    desk_send(drive_start(7));
    desk_send(drive_twist(5));
    desk_send(drive_stereo(5));
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_KIND_START, refused_kind);
    TEST_ASSERT_EQUAL_INT(PLR_E_TIME, refused_status);
    assert_pose_near(&IDENTITY, 1e-9);
}

static void test_a_start_that_is_no_pose_is_refused_and_truth_taken(void) {
    plr_message start = drive_start(5);
    start.as.start.T_WB.R[4] = 3;
    desk_begin_drive();
    desk_send(start);
    desk_send(drive_twist(5));
    desk_send(drive_truth(5));
    desk_send(drive_stereo(5));
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_KIND_START, refused_kind);
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, refused_status);
    assert_pose_is_that_of(5);
}

static void test_the_start_covariance_is_taken_packed_row_by_row(void) {
    plr_message start = drive_start(5);
    double P[36];
    start.as.start.has_covariance = true;
    for (int i = 0, k = 0; i < 6; i++)
        for (int j = 0; j <= i; j++, k++)
            start.as.start.P_xi[k] = i == j ? 1.0 + i : 0.03125 * (i + 2 * j);
    desk_begin_drive();
    desk_send(start);
    plr_message stereo = drive_stereo(5);
    stereo.as.stereo.count = 0;
    desk_send(stereo);
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&session.filter, P));
    for (int i = 0, k = 0; i < 6; i++)
        for (int j = 0; j <= i; j++, k++)
            /* eight roundings of a variance are added to it, so that none comes out negative */
            TEST_ASSERT_DOUBLE_WITHIN(1e-6 * (1 + i), start.as.start.P_xi[k], P[6 * i + j]);
}

static void test_a_bias_prior_is_taken_whatever_the_pose_starts_from(void) {
    plr_message start = drive_start(5);
    double b[6], P_b[36];
    start.as.start.has_bias = true;
    for (int i = 0; i < 6; i++) {
        start.as.start.bias[i] = 0.25 * i;
        start.as.start.bias_variance[i] = 1e-4 * (1 + i);
    }
    options.start = PLR_START_IDENTITY;
    desk_begin_drive();
    desk_send(drive_config("bias", 1));
    desk_send(start);
    desk_send(drive_twist(5));
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&session.filter, b, P_b));
    for (int i = 0; i < 6; i++) {
        TEST_ASSERT_EQUAL_DOUBLE(0.25 * i, b[i]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-10, 1e-4 * (1 + i), P_b[7 * i]);
    }
}

static void test_a_start_in_mid_flight_sets_the_pose_anew_and_is_counted(void) {
    plr_message answer, start = drive_start(6);
    start.as.start.T_WB.p[2] = 40;
    desk_begin_drive();
    desk_send(drive_twist(5));
    desk_send(drive_stereo(5));
    desk_send(start);
    desk_send(drive_stereo(6));
    desk_run();
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 40, pose_of(&session.filter).p[2]);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_POSE, &answer));
    TEST_ASSERT_EQUAL_UINT16(0, answer.as.pose.reset_count);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_POSE, &answer));
    TEST_ASSERT_EQUAL_UINT16(1, answer.as.pose.reset_count);
}

static void test_a_widened_covariance_counts_as_a_reset_too(void) {
    desk_begin_drive();
    desk_send(drive_twist(5));
    desk_send(drive_stereo(5));
    desk_run();
    session.filter.totals.widened++; /* as the filter counts it */
    reseal(&session.filter);
    desk_send(drive_stereo(6));
    desk_run();
    plr_message answer = desk_answer(PLR_KIND_POSE);
    TEST_ASSERT_EQUAL_UINT16(0, answer.as.pose.reset_count);
    answer = desk_answer(PLR_KIND_POSE);
    TEST_ASSERT_EQUAL_UINT16(1, answer.as.pose.reset_count);
}
