// SPDX-License-Identifier: MIT
/* A session that is moved by an IMU, and its clocks: a camera that is late, a camera with a clock of
 * its own, a clock that jumps. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/session_inertial.h"

void setUp(void) {
    desk_clear(1);
}

/* Nothing was refused, and the last POSE is that of `expected`. */
static void demand_result(const inertial_result *expected) {
    desk_assert_nothing_refused();
    faulty_port_answers_again(&port);
    const inertial_result found = inertial_read();
    inertial_assert_same(expected, &found);
}

/* --- late cameras, other clocks --- */

static void test_readings_wait_for_a_late_camera_as_twists_do(void) {
    const inertial_manner late = {.batch = 1, .frames_late_s = 0.2},
                          late_batches = {.batch = 5, .frames_late_s = 0.2};
    const inertial_result in_time = inertial_result_of(&inertial_plain);
    desk_clear(1);
    inertial_run(&late);
    desk_assert_refused(PLR_KIND_STEREO, PLR_E_LATE);
    for (unsigned i = 0; i < 2; i++) {
        desk_clear(1);
        desk_use_setting("twist-delay", 0.25);
        inertial_run(i == 0 ? &late : &late_batches);
        demand_result(&in_time);
        TEST_ASSERT_EQUAL_UINT32(0, session.totals.held_short);
    }
}

static void test_what_does_not_fit_the_delay_is_used_early_and_counted(void) {
    desk_clear(1);
    desk_use_setting("twist-delay", 10);
    inertial_run(&inertial_plain);
    const unsigned readings = INERTIAL_PER_FRAME * (INERTIAL_FRAMES - 1) + 1;
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.held_short); /* each frame empties the ring */
    desk_clear(1);
    desk_use_setting("twist-delay", 10);
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(0));
    inertial_send_readings(&inertial_plain, 0, (int)readings);
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(readings - PLR_SESSION_HELD_TWISTS, session.totals.held_short);
}

static void test_a_frame_is_used_at_the_time_that_camera_offset_gives_it(void) {
    const inertial_manner ahead = {.batch = 1, .camera_ahead_s = 0.03};
    const inertial_result aligned = inertial_result_of(&inertial_plain);
    desk_clear(1);
    desk_use_setting("camera-offset", -0.03);
    inertial_run(&ahead);
    desk_assert_nothing_refused();
    faulty_port_answers_again(&port);
    const inertial_result found = inertial_read();
    inertial_assert_same(&aligned, &found);
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(INERTIAL_FRAME_S * (INERTIAL_FRAMES - 1)),
                             found.pose.t_ns);
}

/* Each message in the order of its own stamps. Of a camera whose clock is `behind` readings behind
 * that of the IMU, a frame comes before the readings of its moved time. */
static void send_in_order_of_stamps(unsigned batch, int behind) {
    const inertial_manner how = {.batch = batch, .camera_ahead_s = -behind * INERTIAL_READING_S};
    const int end = INERTIAL_PER_FRAME * (INERTIAL_FRAMES - 1) + 1;
    int sent = 0;
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(0));
    for (int k = 0; k < INERTIAL_FRAMES; k++) {
        const int stamped = INERTIAL_PER_FRAME * k - behind + 1;
        const int until = stamped < end ? stamped : end;
        if (until > sent) {
            inertial_send_readings(&how, sent, until);
            sent = until;
        }
        inertial_send_frame(&how, k);
    }
    inertial_send_readings(&how, sent, end);
    desk_run();
}

static void test_in_the_order_of_stamps_camera_offset_costs_no_reading(void) {
    static const struct {
        int behind;
        double delay_s;
    } tried[] = {{3, 0}, {3, 0.25}, {-3, 0}, {-3, 0.25}};
    static const unsigned batches[] = {1, 4, INERTIAL_PER_FRAME};
    const inertial_result expected = inertial_result_of(&inertial_plain);
    for (unsigned i = 0; i < 4; i++)
        for (unsigned b = 0; b < 3; b++) {
            desk_clear(1);
            desk_use_setting("camera-offset", tried[i].behind * INERTIAL_READING_S);
            desk_use_setting("twist-delay", tried[i].delay_s);
            send_in_order_of_stamps(batches[b], tried[i].behind);
            plr_session_finish(&session);
            demand_result(&expected);
            TEST_ASSERT_EQUAL_UINT32(0, session.totals.imu_refused);
        }
}

static void test_without_steps_a_frame_waits_until_the_next_one_or_the_end(void) {
    const inertial_manner behind = {.batch = 1, .camera_ahead_s = -0.03};
    plr_message answer;
    desk_use_setting("camera-offset", 0.03);
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(0));
    inertial_send_readings(&behind, 0, 1);
    for (int k = 0; k < 4; k++)
        inertial_send_frame(&behind, k);
    desk_run();
    for (unsigned k = 0; k < 4; k++) {
        if (k == 3) {
            TEST_ASSERT_FALSE(faulty_port_answer_of(&port, PLR_KIND_REPORT, &answer));
            plr_session_finish(&session);
        }
        TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_REPORT, &answer));
        TEST_ASSERT_EQUAL_INT(PLR_OK, answer.as.report.report.status);
        TEST_ASSERT_EQUAL_UINT64(drive_time_ns(INERTIAL_FRAME_S * k - 0.03),
                                 answer.as.report.report.t_ns);
    }
}

static void test_a_report_has_the_time_that_the_frame_was_sent_with(void) {
    const inertial_manner behind = {.batch = 1, .camera_ahead_s = -0.03};
    plr_message answer;
    unsigned k = 0;
    desk_use_setting("camera-offset", 0.03);
    inertial_run(&behind);
    while (faulty_port_answer_of(&port, PLR_KIND_REPORT, &answer)) {
        TEST_ASSERT_EQUAL_INT(PLR_OK, answer.as.report.report.status);
        TEST_ASSERT_EQUAL_UINT64(drive_time_ns(INERTIAL_FRAME_S * k - 0.03),
                                 answer.as.report.report.t_ns);
        k++;
    }
    TEST_ASSERT_EQUAL_UINT(INERTIAL_FRAMES, k);
}

static void test_a_frame_whose_moved_time_no_clock_has_is_refused(void) {
    static const struct {
        double offset_s;
        plr_time_ns t_ns;
    } tried[] = {{-0.5, 400000000}, {0.5, UINT64_MAX - 400000000}};
    for (unsigned i = 0; i < 2; i++) {
        plr_message frame = drive_stereo(0);
        frame.as.stereo.t_ns = tried[i].t_ns;
        desk_clear(1);
        desk_use_setting("camera-offset", tried[i].offset_s);
        desk_begin();
        desk_send(inertial_header());
        desk_send(frame);
        desk_run();
        desk_assert_refused(PLR_KIND_STEREO, PLR_E_TIME);
        TEST_ASSERT_EQUAL_UINT32(0, session.last.observations);
    }
}

/* --- clocks that jump --- */

static void send_batch(double t_s) {
    desk_send(drive_imu(t_s, INERTIAL_PER_FRAME, INERTIAL_READING_S));
}

static void test_a_single_batch_of_another_time_changes_nothing(void) {
    const inertial_manner batches = {.batch = INERTIAL_PER_FRAME};
    const inertial_result expected = inertial_result_of(&batches);
    for (unsigned delayed = 0; delayed < 2; delayed++) {
        desk_clear(1);
        if (delayed)
            desk_use_setting("twist-delay", 0.25);
        desk_begin();
        desk_send(inertial_header());
        desk_send(drive_start(0));
        for (int k = 0; k < INERTIAL_FRAMES; k++) {
            inertial_send_readings(&batches, k == 0 ? 0 : INERTIAL_PER_FRAME * (k - 1) + 1,
                                   INERTIAL_PER_FRAME * k + 1);
            inertial_send_frame(&batches, k);
            if (k == 10)
                send_batch(5000);
        }
        desk_run();
        const inertial_result found = inertial_read();
        inertial_assert_same(&expected, &found);
        TEST_ASSERT_EQUAL_UINT32(0, session.totals.reanchored);
        desk_assert_refused(PLR_KIND_IMU, PLR_E_GAP);
        desk_assert_nothing_refused();
        TEST_ASSERT_EQUAL_UINT32(INERTIAL_PER_FRAME, session.totals.imu_refused);
    }
}

static void test_after_a_jump_of_the_clock_the_filter_starts_anew_where_it_was(void) {
    const inertial_manner batches = {.batch = INERTIAL_PER_FRAME};
    const inertial_result before = inertial_result_of(&batches);
    double bias[6];
    send_batch(5000);
    send_batch(5000.1);
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.reanchored);
    send_batch(5000.2);
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(1, session.totals.reanchored);
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(5000.29), plr_filter_time(&session.filter));
    const plr_pose pose = pose_of(&session.filter);
    TEST_ASSERT_EQUAL_MEMORY(before.pose.T_WB.p, pose.p, sizeof pose.p);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&session.filter, bias, NULL));
    TEST_ASSERT_EQUAL_MEMORY(before.pose.bias, bias, sizeof bias);
    plr_health_state health;
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_health(&session.filter, drive_time_ns(5000.3), &health));
    TEST_ASSERT_TRUE(health.reasons & PLR_REASON_NOT_STARTED);
    double P_then[36], P_now[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&session.filter, P_then));
    for (int k = 3; k < 70; k++) { /* it moves: it starts in motion after three seconds */
        send_batch(5000 + 0.1 * k);
        desk_send(drive_stereo(5000 + 0.1 * k + 0.09));
    }
    desk_run();
    const inertial_result after = inertial_read();
    TEST_ASSERT_EQUAL_UINT8(PLR_IMU_SETTLED, session.filter.source.inertial.phase);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&session.filter, P_now));
    for (int i = 0; i < 3; i++) /* how far it went during the jump, no picture has told */
        TEST_ASSERT_TRUE(P_now[7 * i] > 0.9 * P_then[7 * i]);
    TEST_ASSERT_EQUAL_UINT16(before.pose.reset_count + 1, after.pose.reset_count);
    TEST_ASSERT_TRUE(session.last.used > 3);
}

/* --- readings that nothing can be done with are told --- */

/* From frame 15 on the IMU's clock has started again, by so many ns; the camera's goes on, or
 * starts again with it. */
static void send_with_a_clock_that_starts_again(unsigned batch, plr_time_ns back_ns, bool both) {
    const plr_time_ns later_ns = back_ns + UINT64_C(5000000000);
    desk_begin();
    desk_send(inertial_header());
    plr_message start = drive_start(0);
    start.as.start.t_ns += later_ns;
    desk_send(start);
    for (int n = 0; n <= INERTIAL_PER_FRAME * (INERTIAL_FRAMES - 1); n++) {
        plr_message imu = drive_imu(INERTIAL_READING_S * n, batch, INERTIAL_READING_S);
        imu.as.imu.t_ns += later_ns - (n > 15 * INERTIAL_PER_FRAME ? back_ns : 0);
        if (n % (int)batch == 0)
            desk_send(imu);
        if (n % INERTIAL_PER_FRAME > 0)
            continue;
        plr_message frame = drive_stereo(INERTIAL_READING_S * n);
        frame.as.stereo.t_ns += later_ns - (both && n > 15 * INERTIAL_PER_FRAME ? back_ns : 0);
        desk_send(frame);
    }
    desk_run();
}

static void test_where_both_clocks_wrap_the_pose_is_known_as_if_a_moment_had_gone_by(void) {
    static const struct {
        plr_time_ns back_ns;
        double least_m, most_m;
    } tried[] = {{UINT64_C(1000) << 32, 0, 2},         /* 71 minutes */
                 {UINT64_C(3000000000000), 900, 1e4}}; /* 50 minutes: no counter's round */
    for (unsigned i = 0; i < 2; i++) {
        for (unsigned batch = 1; batch <= 5; batch += 4) {
            double P[36];
            desk_clear(1);
            send_with_a_clock_that_starts_again(batch, tried[i].back_ns, true);
            TEST_ASSERT_EQUAL_UINT32(1, session.totals.reanchored);
            TEST_ASSERT_EQUAL_UINT(i == 0, desk_texts_with("32-bit microseconds that wrap"));
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&session.filter, P));
            for (int k = 0; k < 3; k++) {
                TEST_ASSERT_TRUE(P[7 * k] >= tried[i].least_m * tried[i].least_m);
                TEST_ASSERT_TRUE(P[7 * k] < tried[i].most_m * tried[i].most_m);
            }
        }
    }
}

static void test_an_imu_whose_clock_alone_starts_again_is_told_with_the_counter(void) {
    static const struct {
        plr_time_ns back_ns;
        const char *said;
        bool named;
    } tried[] = {{UINT64_C(1000) << 32, "32-bit microseconds that wrap", true},
                 {UINT64_C(1) << 32, "32-bit nanoseconds that wrap", true},
                 {UINT64_C(600000000000), "that wrap", false}};
    for (unsigned i = 0; i < 3; i++) {
        desk_clear(1);
        send_with_a_clock_that_starts_again(5, tried[i].back_ns, false);
        TEST_ASSERT_EQUAL_UINT(1, desk_texts_with("IMU readings are of another clock"));
        TEST_ASSERT_EQUAL_UINT(tried[i].named, desk_texts_with(tried[i].said));
        TEST_ASSERT_EQUAL_UINT32(0, session.totals.reanchored);
        desk_clear(1);
        send_with_a_clock_that_starts_again(1, tried[i].back_ns,
                                            false); /* three before a frame comes */
        TEST_ASSERT_TRUE(session.totals.reanchored > 0);
        TEST_ASSERT_EQUAL_INT(tried[i].named, desk_texts_with(tried[i].said) > 0);
    }
}

static void test_readings_that_share_a_stamp_are_told_once_and_doubled_ones_are_not(void) {
    for (unsigned copies = 2; copies <= 8; copies += 3) {
        desk_clear(1);
        desk_begin();
        desk_send(inertial_header());
        desk_send(drive_start(0));
        for (int n = 0; n <= 5 * INERTIAL_PER_FRAME; n++) {
            for (unsigned c = 0; c < copies; c++)
                desk_send(drive_imu(INERTIAL_READING_S * n, 1, INERTIAL_READING_S));
            if (n % INERTIAL_PER_FRAME == 0)
                inertial_send_frame(&inertial_plain, n / INERTIAL_PER_FRAME);
        }
        desk_run();
        TEST_ASSERT_EQUAL_UINT(copies > 2, desk_texts_with("share a stamp"));
    }
}
