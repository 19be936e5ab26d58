// SPDX-License-Identifier: MIT
/* A session that is moved by an IMU: batches, which process is in force, what is refused and how it is
 * told, the start, counts. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/session_inertial.h"

void setUp(void) {
    desk_clear(1);
}

static void test_readings_of_an_imu_move_the_body(void) {
    const inertial_result found = inertial_result_of(&inertial_plain);
    const plr_pose truth = drive_pose(INERTIAL_FRAME_S * (INERTIAL_FRAMES - 1));
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT(INERTIAL_FRAMES, found.poses);
    for (unsigned i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(0.05, truth.p[i], found.pose.T_WB.p[i]);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1, found.pose.velocity.v_B_mps[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.2, found.pose.velocity.w_B_radps[2]);
    TEST_ASSERT_EQUAL_UINT32(INERTIAL_PER_FRAME * (INERTIAL_FRAMES - 1) + 1, session.totals.imus);
    TEST_ASSERT_EQUAL_UINT32(session.totals.imus, session.totals.imu_readings);
}

static void test_a_batch_is_its_readings_one_by_one(void) {
    const inertial_manner batches[] = {{.batch = 5}, {.batch = INERTIAL_PER_FRAME}};
    const inertial_result singly = inertial_result_of(&inertial_plain);
    for (unsigned i = 0; i < 2; i++) {
        const inertial_result together = inertial_result_of(&batches[i]);
        inertial_assert_same(&singly, &together);
    }
}

static plr_status give(int n) {
    const plr_message m = drive_imu(INERTIAL_READING_S * n, 1, INERTIAL_READING_S);
    return plr_session_inertial(&session, m.as.imu.t_ns, &m.as.imu.readings[0]);
}

static void test_readings_of_the_programs_own_imu_are_as_those_of_messages(void) {
    const inertial_result sent = inertial_result_of(&inertial_plain);
    const plr_session_totals totals = session.totals;
    desk_clear(1);
    desk_begin();
    TEST_ASSERT_EQUAL(PLR_E_NOT_READY, give(0));
    desk_send(inertial_header());
    desk_send(drive_start(0));
    desk_run();
    for (int k = 0; k < INERTIAL_FRAMES; k++) {
        for (int n = k == 0 ? 0 : INERTIAL_PER_FRAME * (k - 1) + 1; n <= INERTIAL_PER_FRAME * k;
             n++)
            TEST_ASSERT_EQUAL(PLR_OK, give(n));
        inertial_send_frame(&inertial_plain, k);
        desk_run();
    }
    const inertial_result given = inertial_read();
    inertial_assert_same(&sent, &given);
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_MEMORY(&totals, &session.totals, sizeof totals);
}

static void test_readings_of_the_programs_own_imu_are_refused_like_those_of_messages(void) {
    plr_imu nothing = {{0}, {0}};
    TEST_ASSERT_EQUAL(PLR_E_ARGUMENT, plr_session_inertial(NULL, 0, &nothing));
    TEST_ASSERT_EQUAL(PLR_E_ARGUMENT, plr_session_inertial(&session, 0, NULL));
    desk_begin_drive(); /* by twists */
    desk_send_frames(0, 2);
    desk_run();
    TEST_ASSERT_EQUAL(PLR_OK, give(20));
    desk_assert_refused(PLR_KIND_IMU, PLR_E_MODE);
    desk_assert_nothing_refused();
}

/* Each is refused as it is told, and beside it a drive gives the same bits as without. */
static void test_readings_that_no_float32_holds_are_refused_and_change_nothing(void) {
    static const struct {
        double value;
        plr_status status;
    } bad[] = {{1e39, PLR_E_RANGE},
               {-1e39, PLR_E_RANGE},
               {3.41e38, PLR_E_RANGE},
               {-1e308, PLR_E_RANGE},
               {HUGE_VAL, PLR_E_NOT_FINITE},
               {-HUGE_VAL, PLR_E_NOT_FINITE},
               {(double)NAN, PLR_E_NOT_FINITE}};
    const inertial_result alone = inertial_result_of(&inertial_plain);
    desk_clear(1);
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(0));
    desk_run();
    for (int k = 0; k < INERTIAL_FRAMES; k++) {
        const plr_message last = drive_imu(INERTIAL_READING_S * INERTIAL_PER_FRAME * k, 1, 0);
        for (int n = k == 0 ? 0 : INERTIAL_PER_FRAME * (k - 1) + 1; n <= INERTIAL_PER_FRAME * k;
             n++)
            TEST_ASSERT_EQUAL(PLR_OK, give(n));
        for (unsigned i = 0; i < 6; i++) {
            plr_imu one = last.as.imu.readings[0];
            double *numbers[] = {one.a_B_mps2, one.w_B_radps};
            numbers[i / 3][i % 3] = bad[(unsigned)k % 7].value;
            TEST_ASSERT_EQUAL(PLR_OK, plr_session_inertial(&session, last.as.imu.t_ns + 1, &one));
            TEST_ASSERT_EQUAL(bad[(unsigned)k % 7].status, session.imu_status);
            TEST_ASSERT_EQUAL_UINT32(6 * (unsigned)k + i + 1, session.totals.imu_refused);
        }
        inertial_send_frame(&inertial_plain, k);
        desk_run();
    }
    const inertial_result beside = inertial_read();
    inertial_assert_same(&alone, &beside);
}

static void test_an_estimate_follows_each_reading_where_it_is_asked_for(void) {
    const inertial_manner batches = {.batch = INERTIAL_PER_FRAME};
    options.output |= PLR_OUTPUT_TWIST_POSE;
    inertial_run(&batches);
    TEST_ASSERT_EQUAL_UINT(INERTIAL_FRAMES + INERTIAL_PER_FRAME * (INERTIAL_FRAMES - 1) + 1,
                           inertial_read().poses);
}

/* --- which process --- */

static void test_twists_among_the_readings_are_refused_once_and_spoil_nothing(void) {
    const inertial_manner both = {.batch = 1, .twists = true};
    const inertial_result alone = inertial_result_of(&inertial_plain),
                          found = inertial_result_of(&both);
    inertial_assert_same(&alone, &found);
    desk_assert_refused(PLR_KIND_TWIST, PLR_E_MODE);
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT32(1, session.totals.refused);
    TEST_ASSERT_EQUAL_UINT32(INERTIAL_PER_FRAME * (INERTIAL_FRAMES - 1) + 1,
                             session.totals.other_process);
    TEST_ASSERT_EQUAL_UINT(1, desk_texts_with("set process = twist"));
}

static void test_readings_among_twists_are_refused_once_and_spoil_nothing(void) {
    desk_begin_drive();
    desk_send_frames(0, 20);
    desk_run();
    const inertial_result alone = inertial_read();
    desk_clear(1);
    desk_begin_drive();
    for (int k = 0; k < 20; k++) {
        desk_send(drive_imu(0.1 * k, INERTIAL_PER_FRAME, INERTIAL_READING_S));
        desk_send_frames(k, k + 1);
    }
    desk_run();
    const inertial_result found = inertial_read();
    inertial_assert_same(&alone, &found);
    desk_assert_refused(PLR_KIND_IMU, PLR_E_MODE);
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT32(20, session.totals.other_process);
    TEST_ASSERT_EQUAL_UINT(1, desk_texts_with("Set process = imu"));
}

static void test_a_setting_overrides_the_process_of_the_header(void) {
    const inertial_manner told_twist = {.batch = 1, .without_header = true};
    const plr_wire_setting process = {plr_setting_by_name("process")->id, PLR_PROCESS_IMU};
    const inertial_result expected = inertial_result_of(&inertial_plain);
    desk_clear(1);
    options.overrides = &process;
    options.override_count = 1;
    inertial_run(&told_twist);
    const inertial_result found = inertial_read();
    inertial_assert_same(&expected, &found);
    plr_message answer;
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_CONFIG, &answer));
    for (unsigned i = 0; i < answer.as.config.count; i++)
        if (answer.as.config.settings[i].id == process.id)
            TEST_ASSERT_EQUAL_DOUBLE(PLR_PROCESS_IMU, answer.as.config.settings[i].value);
}

static void test_a_header_of_another_process_is_another_header(void) {
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_imu(0, 1, 0));
    desk_send(inertial_header());
    desk_send(drive_header());
    desk_run();
    desk_assert_refused(PLR_KIND_HEADER, PLR_E_MODE);
    desk_assert_nothing_refused();
}

/* --- what is refused --- */

static void test_an_absurd_reading_costs_itself_and_not_its_batch(void) {
    plr_message batch = drive_imu(0, INERTIAL_PER_FRAME, INERTIAL_READING_S);
    plr_totals totals;
    batch.as.imu.readings[3].a_B_mps2[2] = 1e6;
    batch.as.imu.readings[4].w_B_radps[0] = -1e4;
    batch.as.imu.readings[7].w_B_radps[1] = (double)NAN;
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(0));
    desk_send(batch);
    desk_run();
    desk_assert_refused(PLR_KIND_IMU, PLR_E_RANGE); /* 3 and 4 in one */
    desk_assert_refused(PLR_KIND_IMU, PLR_E_NOT_FINITE);
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT32(3, session.totals.imu_refused);
    TEST_ASSERT_EQUAL_UINT32(2, session.totals.refused);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_totals(&session.filter, &totals));
    TEST_ASSERT_EQUAL_UINT32(INERTIAL_PER_FRAME - 3, totals.twists);
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(INERTIAL_READING_S * (INERTIAL_PER_FRAME - 1)),
                             plr_filter_time(&session.filter));
}

static void test_a_batch_beyond_the_end_of_time_is_refused_from_there_on(void) {
    plr_message batch = drive_imu(0, 3, 2);
    batch.as.imu.t_ns = UINT64_MAX - 3000000000u;
    desk_begin();
    desk_send(inertial_header());
    desk_send(batch);
    desk_run();
    desk_assert_refused(PLR_KIND_IMU, PLR_E_TIME);
    TEST_ASSERT_EQUAL_UINT32(1, session.totals.imu_refused);
}

static void test_a_run_of_refusals_is_answered_once_and_told_once(void) {
    desk_use_setting("accel-range", 50);
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(0));
    for (int n = 0; n < 40; n++) {
        plr_message imu = drive_imu(INERTIAL_READING_S * n, 1, 0);
        if (n / 10 % 2 == 1)
            imu.as.imu.readings[0].a_B_mps2[0] = 50 + n;
        desk_send(imu);
    }
    desk_run();
    desk_assert_refused(PLR_KIND_IMU, PLR_E_RANGE);
    desk_assert_refused(PLR_KIND_IMU, PLR_E_RANGE);
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT32(20, session.totals.imu_refused);
    TEST_ASSERT_EQUAL_UINT(1, desk_texts_with("the IMU: "));
}

static void test_faults_are_told_anew_in_the_next_drive(void) {
    for (unsigned drive = 0; drive < 2; drive++) {
        plr_message end = {.kind = PLR_KIND_END};
        plr_message imu = drive_imu(0, 1, 0);
        imu.as.imu.readings[0].a_B_mps2[0] = (double)NAN;
        if (drive == 0)
            desk_begin();
        desk_send(inertial_header());
        desk_send(imu);
        desk_send(drive_twist(0));
        desk_send(end);
    }
    desk_run();
    TEST_ASSERT_EQUAL_UINT(2, desk_texts_with("the IMU: "));
    TEST_ASSERT_EQUAL_UINT(2, desk_texts_with("set process = twist"));
}

/* --- the start --- */

static void test_the_velocity_of_a_start_is_that_of_the_filter(void) {
    plr_twist velocity;
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(0));
    desk_send(drive_imu(0, 1, 0));
    desk_run();
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity(&session.filter, &velocity));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1, velocity.v_B_mps[0]);
}

static void test_a_velocity_without_three_variances_is_not_given(void) {
    for (unsigned i = 0; i < 3; i++) {
        plr_message start = drive_start(0);
        plr_twist velocity;
        start.as.start.velocity_variance[i] = i == 0 ? 0 : -1;
        desk_clear(1);
        desk_begin();
        desk_send(inertial_header());
        desk_send(start);
        desk_send(drive_imu(0, 1, 0));
        desk_run();
        desk_assert_nothing_refused();
        if (plr_filter_velocity(&session.filter, &velocity) == PLR_OK)
            TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0, velocity.v_B_mps[0]);
    }
}

static void test_an_absurd_velocity_is_refused_and_the_pose_is_set(void) {
    plr_message start = drive_start(0);
    start.as.start.velocity[1] = -1e5;
    desk_begin();
    desk_send(inertial_header());
    desk_send(start);
    desk_send(drive_imu(0, 1, 0));
    desk_run();
    desk_assert_refused(PLR_KIND_START, PLR_E_RANGE);
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_RUNNING, session.phase);
}

static void test_a_velocity_means_nothing_to_a_filter_moved_by_twists(void) {
    desk_begin_drive();
    desk_send(drive_start(0));
    desk_send_frames(0, 3);
    desk_run();
    desk_assert_nothing_refused();
}

/* --- counting --- */

static void test_an_end_compares_the_imu_messages(void) {
    plr_message end = {.kind = PLR_KIND_END}, answer;
    const inertial_manner batches = {.batch = 5};
    desk_begin();
    inertial_send_drive(&batches);
    port.sender.counts.sent[PLR_COUNTED_IMU] += 2; /* two were lost on the way */
    desk_send(end);
    desk_run();
    TEST_ASSERT_EQUAL_UINT(1, desk_texts_with(" 49 of 51 IMU"));
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_END, &answer));
    TEST_ASSERT_EQUAL_UINT8(1U << PLR_COUNTED_IMU, answer.as.end.differs);
    TEST_ASSERT_EQUAL_UINT32(49, answer.as.end.arrived[PLR_COUNTED_IMU]);
}
