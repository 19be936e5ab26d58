// SPDX-License-Identifier: MIT
/* A bad link: bytes lost, doubled and damaged, writes that fail, a clock that stalls or jumps. The
 * loop goes on, the filter stays finite, and behind the noise it works as before. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/matrices.h"
#include "support/session_desk.h"

enum { SEEDS = PELORUS_SHORT_FORM ? 5 : 20, FRAMES = 60 };

void setUp(void) {
    plr_session_options_default(&options);
}

static void begin(uint64_t seed) {
    faulty_port_init(&port, seed);
    desk_begin();
}

/* Every POSE that was sent is made of numbers; returns how many there were. */
static unsigned check_poses(void) {
    plr_message answer;
    unsigned count = 0;
    while (faulty_port_answer_of(&port, PLR_KIND_POSE, &answer)) {
        const plr_pose_message *pose = &answer.as.pose;
        TEST_ASSERT_TRUE(all_finite(pose->T_WB.R, 9) && all_finite(pose->T_WB.p, 3));
        TEST_ASSERT_TRUE(all_finite(pose->P_xi, 21) && all_finite(pose->bias, 6));
        for (int i = 0; i < 6; i++)
            TEST_ASSERT_TRUE(pose->P_xi[i * (i + 3) / 2] > 0);
        count++;
    }
    return count;
}

static void assert_on_the_road(double t_s, double tolerance_m) {
    const plr_pose truth = drive_pose(t_s);
    const plr_pose pose = pose_of(&session.filter);
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(tolerance_m, truth.p[i], pose.p[i]);
}

static void test_lost_doubled_and_damaged_bytes_cost_frames_and_nothing_else(void) {
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        begin(seed);
        desk_send(drive_header());
        desk_send(drive_truth(0));
        desk_send_frames(0, 2);
        desk_run(); /* the start is whole */
        port.most_at_once = 40;
        port.lost_share = port.doubled_share = port.damaged_share = 0.0003;
        desk_send_frames(2, FRAMES);
        desk_run();
        port.lost_share = port.doubled_share = port.damaged_share = 0;
        desk_send_frames(FRAMES, FRAMES + 5);
        desk_run();
        TEST_ASSERT_TRUE(session.reader.counts.damaged > 0);
        TEST_ASSERT_TRUE(check_poses() > FRAMES / 2);
        TEST_ASSERT_TRUE(session.last.used > 3);
        assert_on_the_road(0.1 * (FRAMES + 4), 0.5);
    }
}

/* END, a HEADER, and a drive; what is known at its end. */
static void drive_anew(plr_pose *pose, double P[36]) {
    desk_send((plr_message){.kind = PLR_KIND_END});
    desk_send(drive_header());
    desk_send(drive_truth(0));
    desk_send_frames(0, FRAMES);
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose(&session.filter, pose));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&session.filter, P));
}

static void test_the_drive_after_a_bad_one_has_the_bits_of_any_other(void) {
    plr_pose expected, pose;
    double P_expected[36], P[36];
    begin(1);
    drive_anew(&expected, P_expected);
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        begin(seed);
        port.most_at_once = 7;
        port.nothing_share = 0.1;
        port.lost_share = seed % 4 == 0 || seed % 4 == 1 ? 0.0005 : 0;
        port.doubled_share = seed % 4 == 0 || seed % 4 == 2 ? 0.0005 : 0;
        port.damaged_share = seed % 4 == 0 || seed % 4 == 3 ? 0.0005 : 0;
        desk_send(drive_header());
        desk_send_frames(0, FRAMES);
        desk_run();
        TEST_ASSERT_TRUE(session.reader.counts.damaged > 0);
        port.lost_share = port.doubled_share = port.damaged_share = 0;
        const uint8_t delimiter = 0; /* ends what the noise may have left open */
        faulty_port_send_bytes(&port, &delimiter, 1);
        drive_anew(&pose, P);
        TEST_ASSERT_EQUAL_MEMORY(&expected, &pose, sizeof pose);
        TEST_ASSERT_EQUAL_MEMORY(P_expected, P, sizeof P);
    }
}

static void test_a_header_lost_in_noise_is_waited_for(void) {
    begin(3);
    port.damaged_share = 0.05;
    desk_send(drive_header());
    desk_send_frames(0, 10);
    desk_run();
    port.damaged_share = 0;
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_WAITING, session.phase);
    desk_send(drive_header());
    desk_send_frames(10, 20);
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_RUNNING, session.phase);
    TEST_ASSERT_TRUE(session.last.used > 3);
}

static void test_noise_alone_is_survived_and_hardly_answered(void) {
    static uint8_t noise[4096];
    begin(5);
    rng r = rng_seeded(9);
    desk_send(drive_header());
    desk_send_frames(0, 5);
    desk_run();
    const size_t before = port.answer_count;
    for (int k = 0; k < 50; k++) {
        for (size_t i = 0; i < sizeof noise; i++)
            noise[i] = (uint8_t)rng_bits(&r);
        faulty_port_send_bytes(&port, noise, sizeof noise);
    }
    desk_run();
    TEST_ASSERT_TRUE(session.reader.counts.damaged > 100);
    TEST_ASSERT_TRUE(port.answer_count - before < 200);
    noise[0] = 0;
    faulty_port_send_bytes(&port, noise, 1); /* ends what the noise began */
    desk_send_frames(5, 10);
    desk_run();
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(0.9), plr_filter_time(&session.filter));
}

static void test_writes_that_fail_lose_messages_and_change_no_estimate(void) {
    begin(1);
    desk_send(drive_header());
    desk_send_frames(0, FRAMES);
    desk_run();
    const plr_pose good = pose_of(&session.filter);
    const unsigned all = check_poses();

    begin(1);
    port.refused_share = 0.005; /* of the pieces of a frame */
    desk_send(drive_header());
    desk_send_frames(0, FRAMES);
    desk_run();
    const plr_pose bad = pose_of(&session.filter);
    TEST_ASSERT_EQUAL_MEMORY(&good, &bad, sizeof good);
    const unsigned some = check_poses();
    TEST_ASSERT_TRUE(session.totals.not_sent > 0);
    TEST_ASSERT_TRUE(some > all / 4 && some < all);
}

static void test_a_clock_that_stalls_or_jumps_changes_no_estimate(void) {
    plr_pose pose;
    begin(1);
    desk_send(drive_header());
    desk_send_frames(0, FRAMES);
    desk_run();
    const plr_pose expected = pose_of(&session.filter);
    for (int kind = 0; kind < 3; kind++) {
        begin(1);
        port.clock_step_ns = kind == 0 ? 0 : 1000;
        port.clock_jump_at = 100;
        port.clock_jump_ns = kind == 1 ? UINT64_C(1) << 62 : (uint64_t)-90000;
        desk_send(drive_header());
        desk_send_frames(0, FRAMES);
        desk_run();
        pose = pose_of(&session.filter);
        TEST_ASSERT_EQUAL_MEMORY(&expected, &pose, sizeof pose);
    }
}

static void test_a_deadline_on_a_clock_that_stalls_or_jumps_still_lets_vision_through(void) {
    for (int kind = 0; kind < 3; kind++) {
        options.deadline_us = 50;
        begin(1);
        port.clock_step_ns = kind == 0 ? 0 : 1000;
        port.clock_jump_at = 60;
        port.clock_jump_ns = kind == 1 ? UINT64_C(1) << 62 : (uint64_t)-90000;
        desk_send(drive_header());
        desk_send(drive_truth(0));
        desk_send_frames(0, FRAMES);
        desk_run();
        TEST_ASSERT_TRUE(session.last.used > 0);
        assert_on_the_road(0.1 * (FRAMES - 1), 0.1);
    }
}

static void test_a_cut_at_any_byte_is_no_more_than_a_cut(void) {
    begin(1);
    desk_send(drive_header());
    desk_send_frames(0, 3);
    const size_t whole = port.sent_count;
    for (size_t cut = 0; cut <= whole; cut += 7) {
        begin(1);
        desk_send(drive_header());
        desk_send_frames(0, 3);
        port.sent_count = cut;
        desk_run();
        plr_session_finish(&session);
        check_poses();
    }
    TEST_ASSERT_TRUE(session.totals.stereos >= 2);
}
