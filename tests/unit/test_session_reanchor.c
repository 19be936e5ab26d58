// SPDX-License-Identifier: MIT
/* When a jump of the clock is believed, and what is left of the estimate then. */
#include <math.h>
#include <unity.h>

#include "session/reanchor.h"
#include "support/matrices.h"
#include "support/session_desk.h"

#define SECOND UINT64_C(1000000000)

static plr_clock_watch watch;

void setUp(void) {
    watch.agreeing = 0;
}

/* The estimate is at 100 s, the largest gap 2 s. */
static bool note(double t_s, plr_status status) {
    return plr_clock_watch_note(&watch, (plr_time_ns)(t_s * 1e9), status, 100 * SECOND, 2 * SECOND);
}

static void test_the_third_that_agrees_is_believed(void) {
    TEST_ASSERT_FALSE(note(500, PLR_E_GAP));
    TEST_ASSERT_FALSE(note(500.1, PLR_E_GAP));
    TEST_ASSERT_TRUE(note(500.2, PLR_E_GAP));
    TEST_ASSERT_FALSE(note(500.3, PLR_E_GAP)); /* and counting begins anew */
}

static void test_back_is_followed_like_ahead(void) {
    TEST_ASSERT_FALSE(note(1, PLR_E_TIME));
    TEST_ASSERT_FALSE(note(1.1, PLR_E_LATE));
    TEST_ASSERT_TRUE(note(1.2, PLR_E_TIME));
}

static void test_time_stamps_that_disagree_are_never_believed(void) {
    for (int i = 0; i < 50; i++)
        TEST_ASSERT_FALSE(note(500 + 10 * i, PLR_E_GAP));
    for (int i = 0; i < 50; i++)
        TEST_ASSERT_FALSE(note(500 - i, PLR_E_GAP));
}

static void test_one_message_received_many_times_is_not_believed(void) {
    for (int i = 0; i < 50; i++)
        TEST_ASSERT_FALSE(note(500, PLR_E_GAP));
}

static void test_an_accepted_message_in_between_starts_the_count_again(void) {
    for (int i = 0; i < 20; i++) {
        TEST_ASSERT_FALSE(note(500 + 0.2 * i, PLR_E_GAP));
        TEST_ASSERT_FALSE(note(500.1 + 0.2 * i, PLR_E_GAP));
        TEST_ASSERT_FALSE(note(100, PLR_OK));
    }
}

static void test_late_frames_within_the_gap_are_late_and_no_jump(void) {
    for (int i = 0; i < 50; i++)
        TEST_ASSERT_FALSE(note(98.1 + 0.01 * i, PLR_E_LATE));
}

static void test_refusals_for_other_reasons_neither_count_nor_break_the_count(void) {
    TEST_ASSERT_FALSE(note(500, PLR_E_GAP));
    TEST_ASSERT_FALSE(note(500.05, PLR_E_NOT_FINITE));
    TEST_ASSERT_FALSE(note(500.1, PLR_E_GAP));
    TEST_ASSERT_FALSE(note(500.15, PLR_E_RANGE));
    TEST_ASSERT_TRUE(note(500.2, PLR_E_GAP));
}

/* --- in a session --- */

static void begin(const plr_wire_setting *overrides, unsigned count) {
    desk_clear(1);
    options.overrides = overrides;
    options.override_count = count;
    desk_begin_drive();
}

static void send_drive(double from_s, double to_s) {
    for (int k = (int)lround(from_s * 10); k < (int)lround(to_s * 10); k++) {
        desk_send(drive_twist(0.1 * k));
        if (k % 2 == 0)
            desk_send(drive_stereo(0.1 * k));
    }
}

static void variances(double v[6]) {
    double P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&session.filter, P));
    for (int i = 0; i < 6; i++)
        v[i] = P[7 * i];
}

static void test_one_damaged_time_stamp_changes_nothing(void) {
    begin(NULL, 0);
    send_drive(0, 3);
    desk_run();
    const plr_pose without = pose_of(&session.filter);

    begin(NULL, 0);
    send_drive(0, 2);
    desk_send(drive_twist(90000));
    desk_send(drive_stereo(1e6));
    send_drive(2, 3);
    desk_run();
    const plr_pose with = pose_of(&session.filter);
    TEST_ASSERT_EQUAL_MEMORY(&without, &with, sizeof with);
    TEST_ASSERT_EQUAL_UINT32(2, session.totals.refused);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.reanchored);
}

static void check_jump(double to_s) {
    double before[6], after[6];
    begin(NULL, 0);
    send_drive(20, 22);
    desk_run();
    variances(before);
    const plr_pose last = pose_of(&session.filter);
    TEST_ASSERT_TRUE(plr_filter_landmark_count(&session.filter) > 5);

    const double gap = fabs(to_s + 0.2 - 21.9);
    desk_send(drive_twist(to_s));
    desk_send(drive_stereo(to_s)); /* of the same time: says nothing new */
    desk_send(drive_twist(to_s + 0.1));
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.reanchored);
    desk_send(drive_twist(to_s + 0.2));
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(1, session.totals.reanchored);
    TEST_ASSERT_EQUAL_UINT32(3, session.totals.refused);
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(to_s + 0.2), plr_filter_time(&session.filter));
    const plr_pose pose = pose_of(&session.filter);
    for (int i = 0; i < 9; i++) /* set_pose makes a rotation orthonormal once more */
        TEST_ASSERT_DOUBLE_WITHIN(2 * REAL_EPSILON, last.R[i], pose.R[i]);
    TEST_ASSERT_EQUAL_MEMORY(last.p, pose.p, sizeof pose.p);
    TEST_ASSERT_EQUAL_UINT(0, plr_filter_landmark_count(&session.filter));

    variances(after);
    for (int i = 0; i < 6; i++) {
        const double speed = i < 3 ? 1 + 0.1 : 0.2 + 0.01; /* m/s, rad/s: true and sigma */
        const double limit = i < 3 ? 1e6 : 3.2898681336964528;
        const double expected = before[i] + fmin(pow(speed * gap, 2), limit);
        /* it goes by its own speed, which is right to 2 mm/s of 1.1 m/s */
        TEST_ASSERT_DOUBLE_WITHIN(4e-3 * expected, expected, after[i]);
    }
    plr_message answer = desk_answer(PLR_KIND_LANDMARK);
    TEST_ASSERT_EQUAL_UINT8(PLR_LANDMARK_EVICTED, answer.as.landmark.role);
    answer = desk_answer(PLR_KIND_TEXT);
    TEST_ASSERT_EQUAL_UINT8(PLR_SEVERITY_WARNING, answer.as.text.severity);

    send_drive(to_s + 0.3, to_s + 3);
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(3, session.totals.refused);
    TEST_ASSERT_TRUE(plr_filter_landmark_count(&session.filter) > 5);
    TEST_ASSERT_TRUE(session.last.used > 5);
}

static void test_a_jump_ahead_is_followed_with_what_is_then_known(void) {
    check_jump(30);
}

static void test_a_jump_back_is_followed(void) {
    check_jump(10);
}

static void test_after_a_jump_of_days_nothing_is_claimed_but_the_pose(void) {
    check_jump(1e6);
}

static void test_in_mapping_a_jump_back_begins_a_new_map(void) {
    const plr_wire_setting mapping = {plr_setting_by_name("mode")->id, PLR_MODE_MAPPING};
    begin(&mapping, 1);
    for (int k = 0; k < 20; k++) {
        desk_send(drive_truth(20 + 0.1 * k));
        desk_send(drive_stereo(20 + 0.1 * k));
    }
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
    for (int k = 0; k < 20; k++) {
        desk_send(drive_truth(0.1 * k));
        desk_send(drive_stereo(0.1 * k));
    }
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(1, session.totals.reanchored);
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(1.9), plr_filter_time(&session.filter));
    TEST_ASSERT_TRUE(plr_filter_landmark_count(&session.filter) > 5);
}
