// SPDX-License-Identifier: MIT
/* What a session does with each kind of message, and what it refuses, and how it says so. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/session_desk.h"
#include "support/wire_frames.h"

enum { KNOWN = 64 };

static plr_landmark known[KNOWN];

void setUp(void) {
    desk_clear(1);
    options.known = known;
    options.known_capacity = KNOWN;
}

/* --- before and among the data --- */

static void test_whatever_comes_before_a_header_is_refused(void) {
    desk_begin();
    desk_send(drive_config("slots", 3));
    desk_send(drive_start(0));
    desk_send(drive_known(1, 0.1));
    desk_send(drive_twist(0));
    desk_send(drive_stereo(0));
    desk_run();
    desk_assert_refused(PLR_KIND_CONFIG, PLR_E_NOT_READY);
    desk_assert_refused(PLR_KIND_START, PLR_E_NOT_READY);
    desk_assert_refused(PLR_KIND_LANDMARK, PLR_E_NOT_READY);
    desk_assert_refused(PLR_KIND_TWIST, PLR_E_NOT_READY);
    desk_assert_refused(PLR_KIND_STEREO, PLR_E_NOT_READY);
    TEST_ASSERT_EQUAL_UINT32(5, session.totals.refused);
    desk_send(drive_header());
    desk_send(drive_stereo(1));
    desk_run();
    desk_assert_nothing_refused();
}

static void test_the_same_header_again_is_ignored_and_another_refused(void) {
    plr_message changed = drive_header();
    changed.as.header.calibration.fx_px += 1;
    desk_begin_drive();
    desk_send(drive_config("slots", 3));
    desk_send(drive_header()); /* keeps the CONFIG */
    desk_send(drive_twist(0));
    desk_send(drive_stereo(0));
    desk_send(drive_header());
    desk_send(changed);
    desk_send(drive_stereo(0.1));
    desk_run();
    desk_assert_refused(PLR_KIND_HEADER, PLR_E_MODE);
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT16(3, plr_filter_config(&session.filter)->slots);
    TEST_ASSERT_EQUAL_DOUBLE(drive_header().as.header.calibration.fx_px,
                             session.header.calibration.fx_px);
    TEST_ASSERT_EQUAL_UINT(3, plr_filter_landmark_count(&session.filter));
}

static void test_settings_do_not_change_in_mid_flight(void) {
    desk_begin_drive();
    desk_send(drive_config("slots", 3));
    desk_send(drive_twist(0));
    desk_send(drive_config("slots", 3));
    desk_send(drive_config("slots", 4));
    desk_run();
    desk_assert_refused(PLR_KIND_CONFIG, PLR_E_MODE);
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT16(3, plr_filter_config(&session.filter)->slots);
}

static void test_what_other_filters_computed_is_passed_over(void) {
    plr_message pose = {.kind = PLR_KIND_POSE}, landmark = drive_known(1, 1);
    pose.as.pose.real_bytes = 8;
    landmark.as.landmark.role = PLR_LANDMARK_EVICTED;
    options.output |= PLR_OUTPUT_ECHO;
    desk_begin_drive();
    desk_send(pose);
    desk_send(landmark);
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
    TEST_ASSERT_EQUAL_UINT32(1, session.writer.counts.frames); /* the HEADER */
    TEST_ASSERT_EQUAL_UINT(0, session.known.count);
}

/* --- known landmarks --- */

static void send_known_drive(const char *setting, double value) {
    desk_begin_drive();
    desk_send(drive_config(setting, value));
    for (uint32_t id = 0; id < KNOWN; id++)
        desk_send(drive_known(id, 0.01));
    desk_send(drive_truth(0));
    for (int k = 0; k < 20; k++) {
        desk_send(drive_twist(0.1 * k));
        desk_send(drive_stereo(0.1 * k));
    }
    desk_run();
}

static void test_localization_uses_the_known_landmarks_and_no_others(void) {
    plr_landmark landmark;
    send_known_drive("mode", PLR_MODE_LOCALIZATION);
    TEST_ASSERT_TRUE(session.last.used > 3);
    for (unsigned i = 0; i < plr_filter_landmark_count(&session.filter); i++) {
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&session.filter, i, &landmark));
        TEST_ASSERT_TRUE(landmark.known && landmark.id < KNOWN);
    }
}

static void test_slam_ignores_known_landmarks_unless_asked(void) {
    plr_landmark landmark;
    for (int asked = 0; asked < 2; asked++) {
        unsigned known_ones = 0, others = 0;
        setUp();
        send_known_drive("known-map", asked);
        for (unsigned i = 0; i < plr_filter_landmark_count(&session.filter); i++) {
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&session.filter, i, &landmark));
            known_ones += landmark.known;
            others += !landmark.known;
        }
        TEST_ASSERT_EQUAL(asked, known_ones > 0);
        TEST_ASSERT_TRUE(others > 0);
    }
}

static void test_localization_without_a_map_is_warned_of(void) {
    options.known_capacity = 0;
    desk_begin_drive();
    desk_send(drive_known(1, 0.1));
    desk_send(drive_config("mode", PLR_MODE_LOCALIZATION));
    desk_send(drive_stereo(0));
    desk_run();
    desk_assert_refused(PLR_KIND_LANDMARK, PLR_E_FULL);
    const plr_message answer = desk_answer(PLR_KIND_TEXT);
    TEST_ASSERT_EQUAL_UINT8(PLR_SEVERITY_WARNING, answer.as.text.severity);
}

static void test_a_known_landmark_twice_is_refused(void) {
    desk_begin_drive();
    desk_send(drive_known(1, 0.1));
    desk_send(drive_known(1, 0.2));
    desk_run();
    desk_assert_refused(PLR_KIND_LANDMARK, PLR_E_EXISTS);
}

/* --- mapping --- */

static void test_mapping_takes_each_pose_and_leaves_out_frames_without(void) {
    desk_begin_drive();
    desk_send(drive_config("mode", PLR_MODE_MAPPING));
    for (int k = 0; k < 10; k++) {
        desk_send(drive_twist(0.1 * k));
        if (k % 3 != 1)
            desk_send(drive_truth(0.1 * k));
        desk_send(drive_stereo(0.1 * k));
    }
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(3, session.totals.without_truth);
    desk_assert_refused(PLR_KIND_STEREO, PLR_E_MODE);
    const plr_pose truth = drive_pose(0.9);
    const plr_pose pose = pose_of(&session.filter);
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, truth.p[i], pose.p[i]);
    TEST_ASSERT_TRUE(session.last.used > 3);
}

/* --- frames that are no messages --- */

static void send_frame(unsigned kind, const uint8_t *payload, size_t n) {
    static uint8_t stuffed[1 << 18];
    faulty_port_send_bytes(&port, stuffed, wire_frame(kind, 0, payload, n, stuffed));
}

static void test_an_unknown_kind_a_short_payload_and_noise_are_answered_once_a_run(void) {
    static const uint8_t payload[4] = {1, 2, 3, 4}, noise[] = {5, 1, 2, 0, 9, 9, 0, 3, 3, 0};
    desk_begin_drive();
    for (int i = 0; i < 5; i++)
        send_frame(77, payload, sizeof payload);
    for (int i = 0; i < 5; i++)
        send_frame(PLR_KIND_TWIST, payload, sizeof payload);
    faulty_port_send_bytes(&port, noise, sizeof noise);
    desk_run();
    plr_report_message report;
    TEST_ASSERT_TRUE(desk_next_refusal(&report));
    TEST_ASSERT_EQUAL_UINT8(77, report.subject);
    TEST_ASSERT_EQUAL_INT(PLR_E_FOREIGN, report.report.status);
    desk_assert_refused(PLR_KIND_TWIST, PLR_E_ARGUMENT);
    desk_assert_refused(PLR_KIND_NONE, PLR_E_CORRUPT);
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT32(5, session.reader.counts.unknown);
    TEST_ASSERT_EQUAL_UINT32(5, session.reader.counts.malformed);
}

static void test_a_frame_too_long_for_the_buffer_is_answered_and_the_next_one_taken(void) {
    static uint8_t payload[12 + 20 * (PLR_MAX_OBSERVATIONS + 1)];
    payload[10] = (uint8_t)((PLR_MAX_OBSERVATIONS + 1) & 0xff);
    payload[11] = (uint8_t)((PLR_MAX_OBSERVATIONS + 1) >> 8);
    desk_begin_drive();
    send_frame(PLR_KIND_STEREO, payload, sizeof payload);
    desk_send(drive_stereo(0));
    desk_run();
    desk_assert_refused(PLR_KIND_STEREO, PLR_E_FULL);
    desk_assert_nothing_refused();
    TEST_ASSERT_TRUE(plr_filter_landmark_count(&session.filter) > 3);
}

static void test_a_header_of_a_later_version_is_refused_and_the_loop_goes_on(void) {
    uint8_t payload[202] = {PLR_WIRE_VERSION_MAJOR + 1};
    unsigned futures = 0;
    desk_begin();
    send_frame(PLR_KIND_HEADER, payload, sizeof payload);
    desk_send(drive_header());
    desk_send(drive_stereo(0));
    for (plr_step step = PLR_STEP_BYTES; step != PLR_STEP_CLOSED;) {
        step = plr_session_step(&session);
        futures += step == PLR_STEP_FUTURE;
    }
    TEST_ASSERT_EQUAL_UINT(1, futures);
    desk_assert_refused(PLR_KIND_HEADER, PLR_E_FOREIGN);
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_RUNNING, session.phase);
}
