// SPDX-License-Identifier: MIT
/* Steps and frames that do not come in the order of their times: readings of an IMU in batches, late
 * ones, doubled ones, ones that overtake each other, and what is said where twist-delay does not put
 * them in order. The bits of the drive in order are what each is compared with. */
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "support/session_inertial.h"

enum { READINGS = INERTIAL_PER_FRAME * (INERTIAL_FRAMES - 1) + 1, MOST_SENDINGS = 700 };

/* How what is measured in order comes. */
typedef struct manner {
    int batch;           /* readings of an IMU message */
    double steps_late_s; /* behind the time of the last reading in the message */
    double frames_late_s;
    bool twists; /* instead of readings */
    int doubled; /* every so many-th step message comes twice; 0: none does */
    bool doubled_frames;
    double frames_again_s; /* after the first time */
    int swapped;        /* every so many-th step message comes behind the next one; 0: none does */
    int swapped_frames; /* and of the frames */
} manner;

typedef struct sending {
    double at_s;
    bool is_frame;
    int first, count; /* number of a frame, or of a message's first reading, and readings */
} sending;

static struct {
    sending all[MOST_SENDINGS];
    int count;
} plan;

void setUp(void) {
    desk_clear(1);
}

/* By arrival; of what arrives at once frames are first, which is the harder case. */
static int compare(const void *a, const void *b) {
    const sending *x = a, *y = b;
    if (x->at_s != y->at_s)
        return x->at_s < y->at_s ? -1 : 1;
    if (x->is_frame != y->is_frame)
        return x->is_frame ? -1 : 1;
    return (x->first > y->first) - (x->first < y->first);
}

static void plan_one(double at_s, bool is_frame, int first, int count) {
    TEST_ASSERT_LESS_THAN_INT(MOST_SENDINGS, plan.count);
    const sending one = {at_s, is_frame, first, count};
    plan.all[plan.count++] = one;
}

static void plan_drive(const manner *how) {
    plan.count = 0;
    for (int n = 0, message = 1; n < READINGS; n += how->batch, message++) {
        const int count = READINGS - n < how->batch ? READINGS - n : how->batch;
        const bool swapped = how->swapped > 0 && message % how->swapped == 0;
        double at_s = INERTIAL_READING_S * (n + count - 1) + how->steps_late_s;
        if (swapped)
            at_s += INERTIAL_READING_S * (how->batch + 0.5);
        plan_one(at_s, false, n, count);
        if (how->doubled > 0 && message % how->doubled == 0)
            plan_one(at_s + 0.25 * INERTIAL_READING_S, false, n, count);
    }
    for (int k = 0; k < INERTIAL_FRAMES; k++) {
        const bool swapped = how->swapped_frames > 0 && k % how->swapped_frames == 1;
        const double at_s = INERTIAL_FRAME_S * (swapped ? k + 1.2 : (double)k) + how->frames_late_s;
        plan_one(at_s, true, k, 1);
        if (how->doubled_frames)
            plan_one(at_s + how->frames_again_s, true, k, 1);
    }
    qsort(plan.all, (size_t)plan.count, sizeof plan.all[0], compare);
}

static void send(const manner *how, const sending *one) {
    if (one->is_frame)
        desk_send(drive_stereo(INERTIAL_FRAME_S * one->first));
    else if (how->twists)
        desk_send(drive_twist(INERTIAL_READING_S * one->first));
    else
        desk_send(
            drive_imu(INERTIAL_READING_S * one->first, (unsigned)one->count, INERTIAL_READING_S));
}

/* A session that is given it all, with that twist-delay. */
static inertial_result run(const manner *how, double delay_s) {
    desk_clear(1);
    desk_use_setting("twist-delay", delay_s);
    desk_begin();
    desk_send(how->twists ? drive_header() : inertial_header());
    desk_send(drive_start(0));
    plan_drive(how);
    for (int i = 0; i < plan.count; i++)
        send(how, &plan.all[i]);
    desk_run();
    plr_session_finish(&session);
    return inertial_read();
}

static inertial_result run_in_order(bool twists) {
    /* a reading just before the frame of its time */
    const manner in_order = {.batch = 1, .twists = twists, .steps_late_s = -0.001};
    const inertial_result expected = run(&in_order, 0);
    TEST_ASSERT_EQUAL_UINT(INERTIAL_FRAMES, expected.poses);
    desk_assert_nothing_refused();
    return expected;
}

static unsigned degraded_frames(void) {
    plr_message answer;
    unsigned n = 0;
    faulty_port_answers_again(&port);
    while (faulty_port_answer_of(&port, PLR_KIND_REPORT, &answer))
        n += answer.as.report.subject == PLR_KIND_STEREO &&
             answer.as.report.report.status == PLR_OK &&
             (answer.as.report.report.reasons & PLR_REASON_NO_TWISTS) != 0;
    faulty_port_answers_again(&port);
    return n;
}

/* --- with twist-delay --- */

static void test_frames_wait_for_late_steps_and_the_bits_are_those_of_the_order_of_time(void) {
    static const manner tried[] = {
        {.batch = 3},
        {.batch = 7},
        {.batch = 10},
        {.batch = 13},
        {.batch = 20},
        {.batch = 1, .steps_late_s = 0.08},
        {.batch = 1, .steps_late_s = 0.25},
        {.batch = 5, .steps_late_s = 0.08},
        {.batch = 17, .steps_late_s = 0.1},
        {.batch = 1, .steps_late_s = 0.08, .twists = true},
        {.batch = 10, .steps_late_s = 0.05, .frames_late_s = 0.03},
        {.batch = 1, .steps_late_s = 0.08, .doubled_frames = true},
        {.batch = 1, .steps_late_s = 0.15, .doubled_frames = true, .frames_again_s = 0.11},
        {.batch = 1, .steps_late_s = 0.18, .swapped_frames = 3},
    };
    for (unsigned i = 0; i < sizeof tried / sizeof tried[0]; i++) {
        const inertial_result expected = run_in_order(tried[i].twists);
        const inertial_result found = run(&tried[i], 0.3);
        inertial_assert_same(&expected, &found);
        TEST_ASSERT_EQUAL_UINT32(0, session.totals.held_short);
        TEST_ASSERT_EQUAL_UINT32(0, session.totals.late);
        TEST_ASSERT_EQUAL_UINT(0, degraded_frames());
        for (int k = 0; k < INERTIAL_FRAMES && tried[i].doubled_frames; k++)
            desk_assert_refused(PLR_KIND_STEREO, PLR_E_TIME);
        desk_assert_nothing_refused();
    }
}

static void test_a_replay_of_the_flight_log_of_late_steps_computes_the_same(void) {
    const manner late = {.batch = 7, .steps_late_s = 0.05};
    static uint8_t log[FAULTY_PORT_BYTES];
    desk_use_setting("twist-delay", 0.2);
    options.output |= PLR_OUTPUT_ECHO;
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(0));
    plan_drive(&late);
    for (int i = 0; i < plan.count; i++)
        send(&late, &plan.all[i]);
    desk_run();
    plr_session_finish(&session);
    const size_t bytes = port.answer_count;
    memcpy(log, port.answers, bytes);
    const inertial_result flown = inertial_read();
    desk_clear(1);
    desk_begin(); /* the log's CONFIG has the delay */
    faulty_port_send_bytes(&port, log, bytes);
    desk_run();
    const inertial_result replayed = inertial_read();
    inertial_assert_same(&flown, &replayed);
}

static void test_a_step_that_comes_twice_is_refused_and_hurries_nothing(void) {
    static const manner tried[] = {
        {.batch = 1, .doubled = 1, .frames_late_s = 0.08},
        {.batch = 1, .doubled = 3, .frames_late_s = 0.2},
        {.batch = 5, .doubled = 1, .frames_late_s = 0.08},
        {.batch = 1, .doubled = 1, .frames_late_s = 0.08, .twists = true},
        {.batch = 1, .doubled = 1, .steps_late_s = 0.08},
    };
    plr_report_message report;
    for (unsigned i = 0; i < sizeof tried / sizeof tried[0]; i++) {
        const inertial_result expected = run_in_order(tried[i].twists);
        const inertial_result found = run(&tried[i], 0.3);
        inertial_assert_same(&expected, &found);
        unsigned told = 0;
        for (; desk_next_refusal(&report); told++) {
            TEST_ASSERT_EQUAL_UINT8(tried[i].twists ? PLR_KIND_TWIST : PLR_KIND_IMU,
                                    report.subject);
            TEST_ASSERT_EQUAL_INT(PLR_E_TIME, report.report.status);
        }
        TEST_ASSERT_GREATER_THAN_UINT(0, told);
        if (!tried[i].twists)
            TEST_ASSERT_EQUAL_UINT32(session.totals.imu_readings - READINGS,
                                     session.totals.imu_refused);
    }
}

static void test_steps_that_overtake_each_other_are_put_in_order(void) {
    static const manner tried[] = {
        {.batch = 1, .swapped = 2, .frames_late_s = 0.08},
        {.batch = 5, .swapped = 3, .frames_late_s = 0.1},
        {.batch = 1, .swapped = 2, .frames_late_s = 0.08, .twists = true},
    };
    for (unsigned i = 0; i < sizeof tried / sizeof tried[0]; i++) {
        const inertial_result expected = run_in_order(tried[i].twists);
        const inertial_result found = run(&tried[i], 0.2);
        inertial_assert_same(&expected, &found);
        desk_assert_nothing_refused();
    }
}

static void test_frames_that_wait_in_vain_are_used_when_the_delay_is_over(void) {
    plr_message answer;
    desk_use_setting("twist-delay", 0.15);
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(0));
    desk_send(drive_imu(0, 1, 0));
    for (int k = 0; k < 6; k++) { /* 0 is in time; a frame is used when one is 0.15 s newer */
        desk_send(drive_stereo(INERTIAL_FRAME_S * k));
        desk_run();
    }
    for (unsigned k = 0; k < 6; k++) {
        if (k == 4) {
            TEST_ASSERT_FALSE(faulty_port_answer_of(&port, PLR_KIND_REPORT, &answer));
            TEST_ASSERT_EQUAL_UINT8(2, session.queue.counts[PLR_EVENT_FRAME]);
            plr_session_finish(&session);
        }
        TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_REPORT, &answer));
        TEST_ASSERT_EQUAL_INT(PLR_OK, answer.as.report.report.status);
        TEST_ASSERT_EQUAL_UINT64(drive_time_ns(INERTIAL_FRAME_S * k), answer.as.report.report.t_ns);
    }
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.held_short);
}

/* The health of the frame before would be that of the start: good. */
static void test_where_every_frame_is_refused_its_report_says_lost(void) {
    const manner late = {.batch = 1, .frames_late_s = 0.15, .twists = true};
    plr_report_message report;
    unsigned told = 0;
    (void)run(&late, 0);
    while (desk_next_refusal(&report)) {
        TEST_ASSERT_EQUAL_INT(PLR_E_LATE, report.report.status);
        TEST_ASSERT_EQUAL_INT(PLR_HEALTH_LOST, report.report.health);
        TEST_ASSERT_BITS(PLR_REASON_NO_FRAMES, PLR_REASON_NO_FRAMES, report.report.reasons);
        told++;
    }
    TEST_ASSERT_GREATER_THAN_UINT(INERTIAL_FRAMES / 2, told);
}

static void test_more_frames_than_fit_are_used_early_and_counted(void) {
    const manner late = {.batch = 1, .steps_late_s = 0.5};
    (void)run(&late, 1);
    TEST_ASSERT_GREATER_THAN_UINT32(0, session.totals.held_short);
    TEST_ASSERT_GREATER_THAN_UINT32(0, session.totals.late);
    TEST_ASSERT_GREATER_THAN_UINT(0, desk_texts_with("Set twist-delay to that or more"));
}

static void test_a_clock_that_is_set_back_keeps_no_frame_waiting(void) {
    desk_use_setting("twist-delay", 0.2);
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(0));
    desk_send(drive_imu(0, 1, 0));
    desk_send(drive_stereo(1000));
    desk_send(drive_stereo(1000.1));
    desk_run();
    TEST_ASSERT_EQUAL_UINT8(2, session.queue.counts[PLR_EVENT_FRAME]);
    desk_send(drive_stereo(0.1));
    desk_run();
    TEST_ASSERT_EQUAL_UINT8(1, session.queue.counts[PLR_EVENT_FRAME]);
    desk_assert_refused(PLR_KIND_STEREO, PLR_E_GAP);
    desk_assert_refused(PLR_KIND_STEREO, PLR_E_GAP);
    desk_send(drive_imu(0.01, 10, INERTIAL_READING_S));
    desk_run();
    TEST_ASSERT_EQUAL_UINT8(0, session.queue.counts[PLR_EVENT_FRAME]);
    desk_assert_nothing_refused();
}

/* --- the start --- */

/* Frames of 0 and 0.1 s come before any reading; then the message. */
static void wait_for_start(plr_message message) {
    desk_clear(1);
    desk_use_setting("twist-delay", 0.3);
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_stereo(0));
    desk_send(drive_stereo(0.1));
    desk_send(message);
    desk_run();
}

static void test_a_start_behind_frames_that_wait_is_no_start_for_them(void) {
    wait_for_start(
        drive_truth(0.2)); /* by then both are used, at the identity, as without a wait */
    TEST_ASSERT_EQUAL_UINT8(0, session.queue.counts[PLR_EVENT_FRAME]);
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_RUNNING, session.phase);
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(0.1), plr_filter_time(&session.filter));
    wait_for_start(drive_truth(0)); /* and of the frame's own time it is one */
    TEST_ASSERT_EQUAL_UINT8(2, session.queue.counts[PLR_EVENT_FRAME]);
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(0), plr_filter_time(&session.filter));
    wait_for_start(drive_start(0.2));
    TEST_ASSERT_EQUAL_UINT8(0, session.queue.counts[PLR_EVENT_FRAME]);
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(0.2), plr_filter_time(&session.filter));
    wait_for_start(drive_start(0));
    TEST_ASSERT_EQUAL_UINT8(2, session.queue.counts[PLR_EVENT_FRAME]);
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_STARTING, session.phase);
    desk_assert_nothing_refused();
}

static void test_in_mapping_no_frame_waits(void) {
    desk_use_setting("twist-delay", 0.3);
    desk_use_setting("mode", PLR_MODE_MAPPING);
    desk_begin_drive();
    for (int k = 0; k < 4; k++) {
        desk_send(drive_truth(INERTIAL_FRAME_S * k));
        desk_send(drive_stereo(INERTIAL_FRAME_S * k));
        desk_run();
        TEST_ASSERT_EQUAL_UINT8(0, session.queue.counts[PLR_EVENT_FRAME]);
    }
    desk_assert_nothing_refused();
}

/* --- without it --- */

static void test_late_steps_are_told_with_the_delay_that_puts_them_in_order(void) {
    static const struct {
        manner how;
        const char *words, *needed;
    } tried[] = {
        {{.batch = 7}, "IMU readings come late", "here by 0.040 s"},
        {{.batch = 1, .steps_late_s = 0.08}, "IMU readings come late", "here by 0.090 s"},
        {{.batch = 1, .steps_late_s = 0.08, .twists = true}, "TWISTs come late", "here by 0.090 s"},
    };
    for (unsigned i = 0; i < sizeof tried / sizeof tried[0]; i++) {
        plr_report_message report;
        const inertial_result expected = run_in_order(tried[i].how.twists);
        (void)run(&tried[i].how, 0);
        TEST_ASSERT_GREATER_THAN_UINT32(0, session.totals.late);
        while (desk_next_refusal(&report))
            TEST_ASSERT_EQUAL_INT(PLR_E_LATE, report.report.status);
        TEST_ASSERT_GREATER_THAN_UINT(INERTIAL_FRAMES / 2, degraded_frames());
        const unsigned told = desk_texts_with(tried[i].words);
        TEST_ASSERT_TRUE(told >= 1 && told <= 2);
        TEST_ASSERT_EQUAL_UINT(1, desk_texts_with(tried[i].needed));
        const inertial_result found = run(&tried[i].how, 0.09);
        inertial_assert_same(&expected, &found);
        desk_assert_nothing_refused();
    }
}

/* Readings turn as if the gyro counted in degrees. */
static unsigned told_of_faults(double late_s) {
    desk_clear(1);
    desk_begin();
    desk_send(inertial_header());
    const int late = (int)(late_s / INERTIAL_READING_S + 0.5);
    for (int n = 0; n < 600; n++) {
        if (n >= late) {
            plr_message imu = drive_imu(INERTIAL_READING_S * (n - late), 1, 0);
            for (unsigned i = 0; i < 3; i++)
                imu.as.imu.readings[0].w_B_radps[i] *= 57.3;
            desk_send(imu);
        }
        if (n % INERTIAL_PER_FRAME == 0)
            desk_send(drive_stereo(INERTIAL_READING_S * n));
    }
    desk_run();
    return desk_texts_with("the IMU: ");
}

static void test_of_an_imu_that_comes_late_no_fault_is_told_but_that(void) {
    TEST_ASSERT_GREATER_THAN_UINT(0, told_of_faults(0));
    TEST_ASSERT_EQUAL_UINT(0, told_of_faults(0.08));
    TEST_ASSERT_GREATER_THAN_UINT(0, desk_texts_with("IMU readings come late"));
}

static void test_what_is_twice_or_before_a_start_is_not_called_late(void) {
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(1));
    desk_send(drive_imu(1, 1, 0));
    desk_send(drive_imu(1, 1, 0));
    desk_send(drive_stereo(1));
    desk_send(drive_imu(1, 1, 0));
    desk_send(drive_imu(0.5, 1, 0));
    desk_run();
    desk_assert_refused(PLR_KIND_IMU, PLR_E_TIME);
    TEST_ASSERT_EQUAL_UINT32(3, session.totals.imu_refused);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.late);
    TEST_ASSERT_EQUAL_UINT(0, desk_texts_with("come late"));
}
