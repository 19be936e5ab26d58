// SPDX-License-Identifier: MIT
/* TWIST and STEREO: what is refused, the delay for a late camera, the deadline. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/session_desk.h"

void setUp(void) {
    desk_clear(1);
}

/* --- data that is refused --- */

static void test_numbers_that_are_not_finite_are_refused_and_change_nothing(void) {
    plr_message twist = drive_twist(0.1), truth = drive_truth(0);
    desk_begin_drive();
    desk_send(drive_config("twist-timing", PLR_TWIST_END));
    desk_send(drive_twist(0));
    desk_send(drive_stereo(0));
    desk_run();
    const plr_pose before = pose_of(&session.filter);
    twist.as.twist.twist.v_B_mps[1] = (double)NAN;
    desk_send(twist);
    twist.as.twist.twist.v_B_mps[1] = 1e300;
    desk_send(twist);
    twist.as.twist.twist.v_B_mps[1] = 1e30;
    desk_send(twist);
    truth.as.truth.T_WB.p[0] = (double)INFINITY;
    desk_send(truth); /* for evaluation alone by now */
    desk_run();
    desk_assert_refused(PLR_KIND_TWIST, PLR_E_NOT_FINITE);
    desk_assert_refused(PLR_KIND_TWIST, PLR_E_RANGE);
    desk_assert_refused(PLR_KIND_TWIST, PLR_E_RANGE);
    desk_assert_nothing_refused();
    const plr_pose after = pose_of(&session.filter);
    TEST_ASSERT_EQUAL_MEMORY(&before, &after, sizeof before);
}

static void test_a_frame_older_than_the_last_twist_is_refused_as_late(void) {
    desk_begin_drive();
    desk_send(drive_stereo(0));
    desk_send(drive_twist(0));
    desk_send(drive_twist(0.1));
    desk_send(drive_stereo(0.05));
    desk_run();
    plr_report_message report;
    TEST_ASSERT_TRUE(desk_next_refusal(&report));
    TEST_ASSERT_EQUAL_INT(PLR_E_LATE, report.report.status);
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(0.05), report.report.t_ns);
}

static void test_time_that_repeats_or_goes_back_is_refused(void) {
    desk_begin_drive();
    desk_send(drive_twist(1));
    desk_send(drive_twist(1));
    desk_send(drive_twist(0.9));
    desk_run();
    desk_assert_refused(PLR_KIND_TWIST, PLR_E_TIME);
    desk_assert_refused(PLR_KIND_TWIST, PLR_E_TIME);
}

/* --- a late camera --- */

static plr_message drive_position(double t_s) {
    plr_message message = {.kind = PLR_KIND_READING};
    message.as.reading = (plr_reading){
        .t_ns = drive_time_ns(t_s), .sensor = PLR_SENSOR_POSITION, .axes = 7, .sigma = {1, 1, 1}};
    const plr_pose pose = drive_pose(t_s);
    memcpy(message.as.reading.value, pose.p, sizeof pose.p);
    return message;
}

/* Frames arrive 0.25 s late, twists at once, and positions too. */
static unsigned late_frames(double delay_s, bool positions, unsigned *used) {
    plr_wire_setting override = {plr_setting_by_name("twist-delay")->id, delay_s};
    unsigned late = 0;
    options.overrides = &override;
    options.override_count = 1;
    desk_begin_drive();
    desk_send(drive_start(0));
    for (int k = 0; k < 100; k++) {
        desk_send(drive_twist(0.05 * k));
        if (positions && k > 0)
            desk_send(drive_position(0.05 * k));
        if (k % 2 == 1 && k > 5)
            desk_send(drive_stereo(0.05 * (k - 5)));
    }
    desk_run();
    plr_session_finish(&session);
    plr_report_message report;
    while (desk_next_refusal(&report))
        late += report.report.status == PLR_E_LATE;
    *used = session.last.used;
    return late;
}

static void test_frames_of_a_late_camera_are_refused_without_a_delay_and_used_with_one(void) {
    unsigned used;
    TEST_ASSERT_EQUAL_UINT(47, late_frames(0, false, &used));
    setUp();
    TEST_ASSERT_EQUAL_UINT(0, late_frames(0.3, false, &used));
    TEST_ASSERT_TRUE(used > 3);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.held_short);
    const plr_pose truth = drive_pose(4.95); /* finish applied the twists that were held */
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(4.95), plr_filter_time(&session.filter));
    const plr_pose pose = pose_of(&session.filter);
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(0.01, truth.p[i], pose.p[i]);
}

static void test_positions_wait_with_the_twists_for_a_late_camera(void) {
    unsigned used;
    TEST_ASSERT_EQUAL_UINT(0, late_frames(0.3, true, &used));
    TEST_ASSERT_TRUE(used > 3);
    TEST_ASSERT_EQUAL_UINT32(99, session.filter.totals.readings);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.held_short);
}

static void test_a_reading_does_not_overtake_one_that_waits(void) {
    desk_use_setting("camera-offset", 0.05);
    desk_begin_drive();
    desk_send(drive_twist(0));
    desk_send(drive_stereo(0));      /* 0.05 s by the clock of the twists: it waits for them */
    desk_send(drive_position(0.08)); /* and this one with it */
    desk_send(drive_twist(0.06));    /* the frame is used, the position is newer */
    desk_send(drive_position(0.09)); /* nothing waits but the one before it */
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(2, session.filter.totals.readings);
    TEST_ASSERT_EQUAL_UINT8(0, session.queue.counts[PLR_EVENT_READING]);
    desk_assert_nothing_refused();
}

static void test_readings_of_the_clocks_end_take_no_more_room_than_there_is(void) {
    plr_message reading = drive_position(0);
    reading.as.reading.t_ns = UINT64_MAX;
    desk_use_setting("twist-delay", 1);
    desk_begin_drive();
    for (unsigned i = 0; i < PLR_SESSION_HELD_READINGS + 3; i++)
        desk_send(reading);
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(3, session.totals.held_short);
    TEST_ASSERT_EQUAL_UINT8(PLR_SESSION_HELD_READINGS, session.queue.counts[PLR_EVENT_READING]);
}

static void test_a_reading_of_another_clock_hurries_nothing(void) {
    desk_use_setting("twist-delay", 0.5);
    desk_begin_drive();
    for (int k = 0; k < 40; k++) {
        desk_send(drive_twist(0.01 * k));
        desk_send(drive_position(1000 + 0.01 * k));
    }
    desk_run();
    TEST_ASSERT_EQUAL_UINT8(40, session.queue.counts[PLR_EVENT_STEP]);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.held_short);
    TEST_ASSERT_EQUAL_UINT32(40, session.totals.refused);
}

static void test_a_delay_that_holds_more_than_fits_is_cut_short_and_counted(void) {
    plr_wire_setting override = {plr_setting_by_name("twist-delay")->id, 5};
    options.overrides = &override;
    options.override_count = 1;
    desk_begin_drive();
    for (int k = 0; k < PLR_SESSION_HELD_TWISTS + 10; k++)
        desk_send(drive_twist(0.01 * k));
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(10, session.totals.held_short);
    TEST_ASSERT_EQUAL_UINT(PLR_SESSION_HELD_TWISTS, session.queue.counts[PLR_EVENT_STEP]);
    desk_assert_nothing_refused();
}

static void test_a_delay_does_not_hold_twists_for_ever_when_time_goes_back(void) {
    plr_wire_setting override = {plr_setting_by_name("twist-delay")->id, 0.2};
    options.overrides = &override;
    options.override_count = 1;
    desk_begin_drive();
    desk_send(drive_twist(100));
    desk_send(drive_twist(50));
    desk_run();
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(100), plr_filter_time(&session.filter));
    TEST_ASSERT_EQUAL_UINT(1, session.queue.counts[PLR_EVENT_STEP]);
}

/* --- a deadline --- */

static void test_the_budget_in_force_is_in_the_echo_and_in_the_report(void) {
    bool limited = false;
    options.deadline_us = 5;
    options.output |= PLR_OUTPUT_ECHO;
    desk_begin(); /* by this clock every update takes 1 us */
    desk_send(drive_header());
    for (int k = 0; k < 20; k++)
        desk_send(drive_stereo(0.1 * k));
    desk_run();
    plr_message answer = desk_answer(PLR_KIND_STEREO);
    TEST_ASSERT_EQUAL_UINT16(PLR_BLOCK_OBSERVATIONS, answer.as.stereo.budget);
    while (faulty_port_answer_of(&port, PLR_KIND_STEREO, &answer)) {
        const uint16_t budget = answer.as.stereo.budget;
        answer = desk_answer(PLR_KIND_REPORT);
        TEST_ASSERT_EQUAL_UINT16(budget, answer.as.report.report.budget);
        TEST_ASSERT_TRUE(answer.as.report.report.used <= budget);
        limited = limited || budget != PLR_BLOCK_OBSERVATIONS;
    }
    TEST_ASSERT_TRUE(limited); /* it learnt */
}

static void test_a_frames_own_budget_is_kept_where_it_is_less(void) {
    plr_message stereo, answer;
    desk_begin_drive();
    desk_send(drive_stereo(0));
    stereo = drive_stereo(0.05);
    stereo.as.stereo.budget = 3;
    desk_send(stereo);
    desk_run();
    TEST_ASSERT_EQUAL_UINT16(3, session.last.budget);
    TEST_ASSERT_EQUAL_UINT16(3, session.last.used);
    TEST_ASSERT_TRUE(session.last.left_out > 0);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_REPORT, &answer));
    TEST_ASSERT_EQUAL_UINT16(PLR_NO_BUDGET, answer.as.report.report.budget);
}

static void test_frames_over_the_deadline_are_counted(void) {
    options.deadline_us = 5;
    port.clock_step_ns = 6000;
    desk_begin_drive();
    for (int k = 0; k < 7; k++)
        desk_send(drive_stereo(0.1 * k));
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(7, session.totals.over_deadline);
    desk_assert_nothing_refused();
}
