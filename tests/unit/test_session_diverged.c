// SPDX-License-Identifier: MIT
/* A filter that has diverged still says where it is, and that it does not know how well. */
#include <string.h>
#include <unity.h>

#include "support/reseal.h"
#include "support/session_desk.h"

void setUp(void) {
    desk_clear(1);
}

void tearDown(void) {
}

static void run_frames(int first, int end) {
    desk_send_frames(first, end);
    desk_run();
}

/* Five good frames; then it has diverged. Answers up to here are read. */
static void begin_and_diverge(void) {
    plr_message answer;
    desk_begin();
    desk_send(drive_header());
    desk_send(drive_config("bias", 1));
    desk_send(drive_truth(0));
    run_frames(0, 5);
    while (faulty_port_answer(&port, &answer))
        continue;
    session.filter.diverged = 1;
    reseal(&session.filter);
}

static bool is_unknown(const double packed[21]) {
    double full[21] = {0};
    for (unsigned i = 0; i < 6; i++)
        full[i * (i + 3) / 2] = PLR_WIRE_UNKNOWN_VARIANCE;
    return memcmp(packed, full, sizeof full) == 0;
}

static void test_its_poses_go_on_and_say_that_no_covariance_is_known(void) {
    plr_message answer;
    begin_and_diverge();
    run_frames(5, 15);
    for (int k = 5; k < 15; k++) {
        const plr_pose truth = drive_pose(0.1 * k);
        TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_POSE, &answer));
        const plr_pose_message *pose = &answer.as.pose;
        TEST_ASSERT_EQUAL_UINT64(drive_time_ns(0.1 * k), pose->t_ns);
        TEST_ASSERT_TRUE(pose->after_update);
        for (int i = 0; i < 3; i++) /* predicted, from twists without noise */
            TEST_ASSERT_DOUBLE_WITHIN(0.01, truth.p[i], pose->T_WB.p[i]);
        TEST_ASSERT_DOUBLE_WITHIN(0.01, 1, pose->velocity.v_B_mps[0]);
        TEST_ASSERT_TRUE(is_unknown(pose->P_xi));
        TEST_ASSERT_TRUE(is_unknown(pose->P_u));
        TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_REPORT, &answer));
        TEST_ASSERT_EQUAL_INT(PLR_E_DIVERGED, answer.as.report.report.status);
        TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DIVERGED, answer.as.report.report.health);
    }
    TEST_ASSERT_EQUAL_UINT32(10, session.totals.refused);
}

static void test_poses_after_each_twist_say_so_too(void) {
    plr_message answer;
    options.output |= PLR_OUTPUT_TWIST_POSE;
    begin_and_diverge();
    desk_send(drive_twist(0.5));
    desk_run();
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_POSE, &answer));
    TEST_ASSERT_FALSE(answer.as.pose.after_update);
    TEST_ASSERT_TRUE(is_unknown(answer.as.pose.P_xi));
}

static void test_a_sound_filter_never_says_so(void) {
    plr_message answer;
    begin_and_diverge();
    faulty_port_answers_again(&port);
    for (int k = 0; k < 5; k++) {
        TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_POSE, &answer));
        TEST_ASSERT_FALSE(is_unknown(answer.as.pose.P_xi));
        for (int i = 0; i < 6; i++)
            TEST_ASSERT_TRUE(answer.as.pose.P_xi[i * (i + 3) / 2] < PLR_WIRE_UNKNOWN_VARIANCE / 2);
    }
}

static void test_a_human_is_told_once(void) {
    plr_message answer;
    unsigned told = 0;
    begin_and_diverge();
    run_frames(5, 15);
    while (faulty_port_answer_of(&port, PLR_KIND_TEXT, &answer))
        if (strstr(answer.as.text.text, "the filter diverged at") != NULL) {
            TEST_ASSERT_EQUAL_UINT8(PLR_SEVERITY_ERROR, answer.as.text.severity);
            told++;
        }
    TEST_ASSERT_EQUAL_UINT(1, told);
}

static void test_a_start_makes_the_covariance_known_again(void) {
    plr_message answer;
    begin_and_diverge();
    run_frames(5, 7);
    while (faulty_port_answer(&port, &answer))
        continue;
    desk_send(drive_start(0.6));
    run_frames(7, 9);
    for (int k = 7; k < 9; k++) {
        TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_POSE, &answer));
        TEST_ASSERT_FALSE(is_unknown(answer.as.pose.P_xi));
        TEST_ASSERT_FALSE(is_unknown(answer.as.pose.P_u));
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, session.last.status);
    TEST_ASSERT_TRUE(session.last.used > 3);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_its_poses_go_on_and_say_that_no_covariance_is_known);
    RUN_TEST(test_poses_after_each_twist_say_so_too);
    RUN_TEST(test_a_sound_filter_never_says_so);
    RUN_TEST(test_a_human_is_told_once);
    RUN_TEST(test_a_start_makes_the_covariance_known_again);
    return UNITY_END();
}
