// SPDX-License-Identifier: MIT
/* The loop as a whole: a drive goes in, answers come out; nothing stops it. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "pelorus/session.h"
#include "support/faulty_port.h"
#include "support/session_drive.h"

static plr_session session, second;
static plr_session_options options;
static faulty_port port, other;

void setUp(void) {
    faulty_port_init(&port, 1);
    faulty_port_init(&other, 1);
    plr_session_options_default(&options);
}

static void begin(plr_session *s, faulty_port *p) {
    const plr_port functions = faulty_port_functions(p);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(s, &functions, &options));
}

static void send(faulty_port *p, plr_message message) {
    faulty_port_send(p, &message);
}

static void send_drive(faulty_port *p, int frames) {
    send(p, drive_header());
    send(p, drive_truth(0));
    for (int k = 0; k < frames; k++) {
        send(p, drive_twist(0.1 * k));
        send(p, drive_stereo(0.1 * k));
    }
}

static void send_end(faulty_port *p) {
    plr_message end = {.kind = PLR_KIND_END};
    faulty_port_send(p, &end);
}

static void run(plr_session *s) {
    while (plr_session_step(s) != PLR_STEP_CLOSED)
        continue;
}

static unsigned count_answers(faulty_port *p, plr_kind kind) {
    plr_message answer;
    unsigned count = 0;
    faulty_port_answers_again(p);
    while (faulty_port_answer_of(p, kind, &answer))
        count++;
    faulty_port_answers_again(p);
    return count;
}

static void test_a_drive_is_answered_with_poses_near_the_truth(void) {
    const plr_wire_setting without_bias = {plr_setting_by_name("bias")->id, 0};
    plr_message pose, report;
    options.overrides = &without_bias;
    options.override_count = 1;
    begin(&session, &port);
    send_drive(&port, 100);
    send_end(&port);
    run(&session);
    for (int k = 0; k < 100; k++) {
        const plr_pose truth = drive_pose(0.1 * k);
        TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_POSE, &pose));
        TEST_ASSERT_EQUAL_UINT64(drive_time_ns(0.1 * k), pose.as.pose.t_ns);
        TEST_ASSERT_TRUE(pose.as.pose.after_update);
        for (int i = 0; i < 3; i++)
            TEST_ASSERT_DOUBLE_WITHIN(0.01, truth.p[i], pose.as.pose.T_WB.p[i]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1, pose.as.pose.velocity.v_B_mps[0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.01, pose.as.pose.P_u[0]); /* 0.1 m/s */
        TEST_ASSERT_TRUE(faulty_port_answer(&port, &report));
        TEST_ASSERT_EQUAL_INT(PLR_KIND_REPORT, report.kind);
        TEST_ASSERT_EQUAL_UINT8(PLR_KIND_STEREO, report.as.report.subject);
        TEST_ASSERT_EQUAL_INT(PLR_OK, report.as.report.report.status);
        TEST_ASSERT_TRUE(k == 0 || report.as.report.report.used > 3);
        TEST_ASSERT_TRUE(report.as.report.update_us > 0);
    }
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
}

static void test_pieces_of_any_size_give_the_same_answers(void) {
    begin(&session, &port);
    send_drive(&port, 30);
    send_end(&port);
    run(&session);
    other.most_at_once = 7;
    other.nothing_share = 0.3;
    begin(&second, &other);
    send_drive(&other, 30);
    send_end(&other);
    run(&second);
    TEST_ASSERT_EQUAL_size_t(port.answer_count, other.answer_count);
    TEST_ASSERT_EQUAL_MEMORY(port.answers, other.answers, port.answer_count);
}

/* The flight log of a run, with settings that a HEADER does not say, replays itself. */
static void test_a_flight_log_replays_to_the_same_bits(void) {
    const plr_wire_setting overrides[] = {{plr_setting_by_name("slots")->id, 12},
                                          {plr_setting_by_name("pixel-sigma")->id, 0.7},
                                          {plr_setting_by_name("bias")->id, 1}};
    options.output |= PLR_OUTPUT_ECHO;
    options.overrides = overrides;
    options.override_count = 3;
    begin(&session, &port);
    send_drive(&port, 60);
    send_end(&port);
    run(&session);
    faulty_port_send_bytes(&other, port.answers, port.answer_count);
    options.override_count = 0;
    begin(&second, &other);
    run(&second);
    TEST_ASSERT_EQUAL_UINT16(12, plr_filter_config(&second.filter)->slots);
    TEST_ASSERT_EQUAL_size_t(port.answer_count, other.answer_count);
    TEST_ASSERT_EQUAL_MEMORY(port.answers, other.answers, port.answer_count);
}

static void test_what_is_sent_is_an_option(void) {
    options.output = PLR_OUTPUT_POSE | PLR_OUTPUT_TWIST_POSE;
    begin(&session, &port);
    send_drive(&port, 10);
    send_end(&port);
    run(&session);
    TEST_ASSERT_EQUAL_UINT(20, count_answers(&port, PLR_KIND_POSE));
    TEST_ASSERT_EQUAL_UINT32(20, session.writer.counts.frames);
}

static void test_a_port_without_output_is_a_port(void) {
    plr_port functions = faulty_port_functions(&port);
    functions.write = NULL;
    functions.now_ns = NULL;
    functions.idle = NULL;
    functions.feed_watchdog = NULL;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&session, &functions, &options));
    send_drive(&port, 10);
    port.nothing_share = 0.5;
    run(&session);
    TEST_ASSERT_EQUAL_size_t(0, port.answer_count);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.not_sent);
    TEST_ASSERT_TRUE(plr_filter_landmark_count(&session.filter) > 3);
}

static void test_end_sends_what_is_left_and_counts(void) {
    plr_message answer;
    begin(&session, &port);
    send_drive(&port, 5);
    run(&session);
    const unsigned held = plr_filter_landmark_count(&session.filter);
    send_end(&port);
    TEST_ASSERT_EQUAL_INT(PLR_STEP_ENDED, plr_session_step(&session));
    TEST_ASSERT_EQUAL_UINT(held, count_answers(&port, PLR_KIND_LANDMARK));
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_LANDMARK, &answer));
    TEST_ASSERT_EQUAL_UINT8(PLR_LANDMARK_FINAL, answer.as.landmark.role);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_END, &answer));
    TEST_ASSERT_EQUAL_UINT32(held, answer.as.end.sent[PLR_COUNTED_LANDMARK]);
    TEST_ASSERT_EQUAL_UINT32(1 + 5 + 5 + held, answer.as.end.frames); /* CONFIG, POSE, REPORT */
}

static void test_after_end_a_header_starts_anew(void) {
    begin(&session, &port);
    send_drive(&port, 40);
    send_end(&port);
    run(&session);
    const size_t first_run = port.answer_count;
    send(&port, drive_twist(4)); /* belongs to nothing */
    run(&session);
    TEST_ASSERT_EQUAL_UINT32(1, session.totals.refused);
    send_drive(&port, 40);
    run(&session);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
    TEST_ASSERT_EQUAL_UINT32(40, session.totals.stereos);
    TEST_ASSERT_TRUE(port.answer_count > 2 * first_run - 4096);
}

static void test_a_stream_that_is_cut_can_be_finished(void) {
    begin(&session, &port);
    send_drive(&port, 5);
    run(&session);
    plr_session_finish(&session);
    TEST_ASSERT_TRUE(count_answers(&port, PLR_KIND_LANDMARK) > 3);
    TEST_ASSERT_EQUAL_UINT(1, count_answers(&port, PLR_KIND_END));
}

static void test_an_end_that_counts_more_than_arrived_is_told(void) {
    plr_message answer, lost = drive_twist(0.55);
    begin(&session, &port);
    send_drive(&port, 5);
    const size_t before = port.sent_count;
    faulty_port_send(&port, &lost);
    port.sent_count = before; /* sent, and never arrived */
    send_end(&port);
    run(&session);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_TEXT, &answer));
    TEST_ASSERT_NOT_NULL(strstr(answer.as.text.text, "5 of 6 TWIST"));
    TEST_ASSERT_EQUAL_UINT32(1, session.reader.counts.missing);
}

static void test_each_step_feeds_the_watchdog_and_an_empty_one_idles(void) {
    unsigned steps = 0;
    port.stays_open = true;
    begin(&session, &port);
    send_drive(&port, 2);
    for (plr_step step = PLR_STEP_BYTES; step != PLR_STEP_IDLE; steps++)
        step = plr_session_step(&session);
    TEST_ASSERT_EQUAL_UINT(steps, port.feeds);
    TEST_ASSERT_EQUAL_UINT(1, port.idles);
    TEST_ASSERT_EQUAL_INT(PLR_STEP_IDLE, plr_session_step(&session));
    TEST_ASSERT_EQUAL_UINT(2, port.idles);
}

static void test_a_port_that_fails_is_told_and_may_come_back(void) {
    port.fails = true;
    begin(&session, &port);
    TEST_ASSERT_EQUAL_INT(PLR_STEP_FAILED, plr_session_step(&session));
    send_drive(&port, 2);
    while (plr_session_step(&session) != PLR_STEP_FAILED)
        continue;
    TEST_ASSERT_EQUAL_UINT32(2, session.totals.stereos);
}

static int read_too_much(void *context, uint8_t *bytes, size_t n) {
    (void)context;
    (void)bytes;
    return (int)n + 1;
}

static void test_a_port_that_claims_more_than_was_asked_is_not_believed(void) {
    plr_port functions = faulty_port_functions(&port);
    functions.read = read_too_much;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&session, &functions, &options));
    TEST_ASSERT_EQUAL_INT(PLR_STEP_FAILED, plr_session_step(&session));
}

static void test_impossible_arguments_are_refused(void) {
    plr_port functions = faulty_port_functions(&port);
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_session_init(NULL, &functions, &options));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_session_init(&session, NULL, &options));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_session_init(&session, &functions, NULL));
    options.override_count = 1;
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_session_init(&session, &functions, &options));
    options.override_count = 0;
    options.map_count = 1;
    options.known_capacity = 1;
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_session_init(&session, &functions, &options));
    static const plr_landmark landmark = {.id = 1};
    options.map = &landmark;
    options.known_capacity = 0;
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_session_init(&session, &functions, &options));
    options.map_count = 0;
    functions.read = NULL;
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_session_init(&session, &functions, &options));
}

static void test_two_sessions_side_by_side_do_not_disturb_each_other(void) {
    begin(&session, &port);
    send_drive(&port, 20);
    run(&session);
    faulty_port_init(&port, 1);
    begin(&session, &port);
    begin(&second, &other);
    send_drive(&port, 20);
    send_drive(&other, 20);
    while (plr_session_step(&session) != PLR_STEP_CLOSED)
        (void)plr_session_step(&second);
    run(&second);
    TEST_ASSERT_EQUAL_size_t(port.answer_count, other.answer_count);
    TEST_ASSERT_EQUAL_MEMORY(port.answers, other.answers, port.answer_count);
}
