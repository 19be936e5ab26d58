// SPDX-License-Identifier: MIT
/* A filter that has diverged still says where it is, and that it does not know how well; with the next
 * frame it goes on by itself, and a human is told. */
#include <string.h>
#include <unity.h>

#include "support/reseal.h"
#include "support/session_desk.h"

void setUp(void) {
    desk_clear(1);
}

static void run_frames(int first, int end) {
    desk_send_frames(first, end);
    desk_run();
}

/* Five good frames; then it has diverged. Answers up to here are read. */
static void begin_and_diverge(void) {
    plr_message answer;
    desk_begin_drive();
    desk_send(drive_config("bias", 1));
    desk_send(drive_truth(0));
    run_frames(0, 5);
    while (faulty_port_answer(&port, &answer))
        continue;
    spoil_covariance(&session.filter);
}

static bool is_unknown(const double packed[21]) {
    double full[21] = {0};
    for (unsigned i = 0; i < 6; i++)
        full[i * (i + 3) / 2] = PLR_WIRE_UNKNOWN_VARIANCE;
    return memcmp(packed, full, sizeof full) == 0;
}

static void test_the_next_frame_recovers_and_its_pose_has_a_covariance_again(void) {
    plr_message answer;
    begin_and_diverge();
    run_frames(5, 15);
    for (int k = 5; k < 15; k++) {
        const plr_pose truth = drive_pose(0.1 * k);
        TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_POSE, &answer));
        const plr_pose_message *pose = &answer.as.pose;
        TEST_ASSERT_EQUAL_UINT64(drive_time_ns(0.1 * k), pose->t_ns);
        TEST_ASSERT_TRUE(pose->after_update);
        for (int i = 0; i < 3; i++) /* kept, and carried on by twists and pixels without noise */
            TEST_ASSERT_DOUBLE_WITHIN(0.01, truth.p[i], pose->T_WB.p[i]);
        TEST_ASSERT_DOUBLE_WITHIN(0.01, 1, pose->velocity.v_B_mps[0]);
        TEST_ASSERT_FALSE(is_unknown(pose->P_xi));
        TEST_ASSERT_FALSE(is_unknown(pose->P_u));
        for (int i = 0; i < 6; i++) {
            TEST_ASSERT_TRUE(pose->P_xi[i * (i + 3) / 2] > 0);
            TEST_ASSERT_TRUE(pose->P_xi[i * (i + 3) / 2] < 0.1);
        }
        TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_REPORT, &answer));
        const plr_report *report = &answer.as.report.report;
        const uint32_t recovery = PLR_REASON_NOT_POSITIVE | PLR_REASON_RECOVERED;
        TEST_ASSERT_EQUAL_INT(PLR_OK, report->status);
        TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DEGRADED, report->health);
        TEST_ASSERT_EQUAL_HEX32(k == 5 ? recovery : 0, report->reasons & recovery);
        TEST_ASSERT_TRUE(report->reasons & PLR_REASON_POSE_MAY_BE_WRONG);
        TEST_ASSERT_TRUE(k == 5 ? report->created > 3 : report->used > 3);
    }
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
    TEST_ASSERT_EQUAL_UINT32(1, session.filter.totals.recoveries);
}

static void test_poses_after_each_twist_say_so_too(void) {
    options.output |= PLR_OUTPUT_TWIST_POSE;
    begin_and_diverge();
    desk_send(drive_twist(0.5));
    desk_run();
    const plr_message answer = desk_answer(PLR_KIND_POSE);
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

/* What there is to tell of `words`. */
static unsigned count_texts(plr_severity severity, const char *words) {
    plr_message answer;
    unsigned told = 0;
    while (faulty_port_answer_of(&port, PLR_KIND_TEXT, &answer))
        if (strstr(answer.as.text.text, words) != NULL) {
            TEST_ASSERT_EQUAL_UINT8(severity, answer.as.text.severity);
            told++;
        }
    return told;
}

static void test_a_human_is_told_once(void) {
    begin_and_diverge();
    run_frames(5, 15);
    TEST_ASSERT_EQUAL_UINT(1, count_texts(PLR_SEVERITY_ERROR, "the filter diverged at"));
}

static void test_a_human_is_told_each_time(void) {
    begin_and_diverge();
    run_frames(5, 10);
    spoil_covariance(&session.filter);
    run_frames(10, 15);
    TEST_ASSERT_EQUAL_UINT(2, count_texts(PLR_SEVERITY_ERROR, "the filter diverged at"));
}

static void test_a_start_makes_the_covariance_known_again(void) {
    plr_message answer;
    begin_and_diverge();
    run_frames(5, 7);
    while (faulty_port_answer(&port, &answer))
        continue;
    spoil_covariance(&session.filter); /* and no frame comes between */
    desk_send(drive_start(0.6));
    run_frames(7, 9);
    for (int k = 7; k < 9; k++) {
        TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_POSE, &answer));
        TEST_ASSERT_FALSE(is_unknown(answer.as.pose.P_xi));
        TEST_ASSERT_FALSE(is_unknown(answer.as.pose.P_u));
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, session.last.status);
    TEST_ASSERT_TRUE(session.last.used > 3);
    TEST_ASSERT_FALSE(session.last.reasons & (PLR_REASON_RECOVERED | PLR_REASON_POSE_MAY_BE_WRONG));
}
