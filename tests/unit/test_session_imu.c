// SPDX-License-Identifier: MIT
/* A session that is moved by an IMU: which process is in force, batches, what comes late, clocks that
 * differ, what is refused and how it is told. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/session_desk.h"

enum { FRAMES = 25, PER_FRAME = 10 };

static const double FRAME_S = 0.1, READING_S = 0.01;

/* How a drive is sent. */
typedef struct manner {
    unsigned batch;        /* readings in an IMU message */
    double frames_late_s;  /* frames come so much later than readings of their time */
    double camera_ahead_s; /* the camera's clock is ahead of the IMU's by that much */
    bool twists;           /* TWISTs come too */
    bool without_header;   /* the HEADER says twist */
} manner;

static const manner plain = {.batch = 1};

void setUp(void) {
    desk_clear(1);
}

void tearDown(void) {
}

/* --- a drive --- */

static plr_message inertial_header(void) {
    plr_message header = drive_header();
    header.as.header.process = PLR_PROCESS_IMU;
    return header;
}

static void send_frame(const manner *how, int k) {
    plr_message frame = drive_stereo(FRAME_S * k);
    frame.as.stereo.t_ns = drive_time_ns(FRAME_S * k + how->camera_ahead_s);
    desk_send(frame);
}

/* All readings before the time of reading n, which is that of frame n / PER_FRAME. */
static void send_readings(const manner *how, int from, int end) {
    for (int n = from; n < end; n += (int)how->batch) {
        const int count = end - n < (int)how->batch ? end - n : (int)how->batch;
        if (how->twists)
            desk_send(drive_twist(READING_S * n));
        desk_send(drive_imu(READING_S * n, (unsigned)count, READING_S));
    }
}

static void send_drive(const manner *how) {
    const int late = (int)lround(how->frames_late_s / FRAME_S);
    desk_send(how->without_header ? drive_header() : inertial_header());
    desk_send(drive_start(0));
    for (int k = 0; k < FRAMES + late; k++) {
        send_readings(how, k == 0 ? 0 : PER_FRAME * (k - 1) + 1, PER_FRAME * k + 1);
        if (k >= late)
            send_frame(how, k - late);
    }
}

static void run(const manner *how) {
    desk_begin();
    send_drive(how);
    desk_run();
}

/* The last estimate, and how many frames have one. */
typedef struct result {
    plr_pose_message pose;
    unsigned poses;
} result;

static result read_result(void) {
    plr_message answer;
    result found;
    memset(&found, 0, sizeof found);
    while (faulty_port_answer_of(&port, PLR_KIND_POSE, &answer)) {
        found.pose = answer.as.pose;
        found.poses++;
    }
    faulty_port_answers_again(&port);
    return found;
}

static result drive_result(const manner *how) {
    desk_clear(1);
    run(how);
    return read_result();
}

static void assert_same_estimate(const result *expected, const result *found) {
    TEST_ASSERT_EQUAL_UINT(expected->poses, found->poses);
    TEST_ASSERT_EQUAL_UINT64(expected->pose.t_ns, found->pose.t_ns);
    TEST_ASSERT_EQUAL_MEMORY(&expected->pose.T_WB, &found->pose.T_WB, sizeof found->pose.T_WB);
    TEST_ASSERT_EQUAL_MEMORY(expected->pose.P_xi, found->pose.P_xi, sizeof found->pose.P_xi);
    TEST_ASSERT_EQUAL_MEMORY(expected->pose.bias, found->pose.bias, sizeof found->pose.bias);
}

static void test_readings_of_an_imu_move_the_body(void) {
    const result found = drive_result(&plain);
    const plr_pose truth = drive_pose(FRAME_S * (FRAMES - 1));
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT(FRAMES, found.poses);
    for (unsigned i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(0.05, truth.p[i], found.pose.T_WB.p[i]);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1, found.pose.velocity.v_B_mps[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.2, found.pose.velocity.w_B_radps[2]);
    TEST_ASSERT_EQUAL_UINT32(PER_FRAME * (FRAMES - 1) + 1, session.totals.imus);
}

static void test_a_batch_is_its_readings_one_by_one(void) {
    const manner batches[] = {{.batch = 5}, {.batch = PER_FRAME}};
    const result singly = drive_result(&plain);
    for (unsigned i = 0; i < 2; i++) {
        const result together = drive_result(&batches[i]);
        assert_same_estimate(&singly, &together);
    }
}

static void test_an_estimate_follows_each_reading_where_it_is_asked_for(void) {
    const manner batches = {.batch = PER_FRAME};
    options.output |= PLR_OUTPUT_TWIST_POSE;
    run(&batches);
    TEST_ASSERT_EQUAL_UINT(FRAMES + PER_FRAME * (FRAMES - 1) + 1, read_result().poses);
}

/* --- which process --- */

/* Texts with that word. */
static unsigned texts_with(const char *word) {
    plr_message answer;
    unsigned n = 0;
    faulty_port_answers_again(&port);
    while (faulty_port_answer_of(&port, PLR_KIND_TEXT, &answer))
        n += strstr(answer.as.text.text, word) != NULL;
    faulty_port_answers_again(&port);
    return n;
}

static void test_twists_among_the_readings_are_refused_once_and_spoil_nothing(void) {
    const manner both = {.batch = 1, .twists = true};
    const result alone = drive_result(&plain), found = drive_result(&both);
    assert_same_estimate(&alone, &found);
    desk_assert_refused(PLR_KIND_TWIST, PLR_E_MODE);
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT32(1, session.totals.refused);
    TEST_ASSERT_EQUAL_UINT32(PER_FRAME * (FRAMES - 1) + 1, session.totals.other_process);
    TEST_ASSERT_EQUAL_UINT(1, texts_with("set process = twist"));
}

static void test_readings_among_twists_are_refused_once_and_spoil_nothing(void) {
    desk_begin();
    desk_send(drive_header());
    desk_send_frames(0, 20);
    desk_run();
    const result alone = read_result();
    desk_clear(1);
    desk_begin();
    desk_send(drive_header());
    for (int k = 0; k < 20; k++) {
        desk_send(drive_imu(0.1 * k, PER_FRAME, READING_S));
        desk_send_frames(k, k + 1);
    }
    desk_run();
    const result found = read_result();
    assert_same_estimate(&alone, &found);
    desk_assert_refused(PLR_KIND_IMU, PLR_E_MODE);
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT32(20, session.totals.other_process);
    TEST_ASSERT_EQUAL_UINT(1, texts_with("Set process = imu"));
}

static void test_a_setting_overrides_the_process_of_the_header(void) {
    const manner told_twist = {.batch = 1, .without_header = true};
    const plr_wire_setting process = {plr_setting_by_name("process")->id, PLR_PROCESS_IMU};
    const result expected = drive_result(&plain);
    desk_clear(1);
    options.overrides = &process;
    options.override_count = 1;
    run(&told_twist);
    const result found = read_result();
    assert_same_estimate(&expected, &found);
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

/* --- late cameras, other clocks --- */

static void use_setting(const char *name, double value) {
    static plr_wire_setting overrides[2];
    overrides[options.override_count].id = plr_setting_by_name(name)->id;
    overrides[options.override_count].value = value;
    options.overrides = overrides;
    options.override_count++;
}

static void test_readings_wait_for_a_late_camera_as_twists_do(void) {
    const manner late = {.batch = 1, .frames_late_s = 0.2},
                 late_batches = {.batch = 5, .frames_late_s = 0.2};
    const result in_time = drive_result(&plain);
    desk_clear(1);
    run(&late);
    desk_assert_refused(PLR_KIND_STEREO, PLR_E_LATE);
    for (unsigned i = 0; i < 2; i++) {
        desk_clear(1);
        use_setting("twist-delay", 0.25);
        run(i == 0 ? &late : &late_batches);
        desk_assert_nothing_refused();
        faulty_port_answers_again(&port);
        const result found = read_result();
        assert_same_estimate(&in_time, &found);
        TEST_ASSERT_EQUAL_UINT32(0, session.totals.held_short);
    }
}

static void test_what_does_not_fit_the_delay_is_used_early_and_counted(void) {
    desk_clear(1);
    use_setting("twist-delay", 10);
    run(&plain);
    const unsigned readings = PER_FRAME * (FRAMES - 1) + 1;
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.held_short); /* each frame empties the ring */
    desk_clear(1);
    use_setting("twist-delay", 10);
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(0));
    send_readings(&plain, 0, (int)readings);
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(readings - PLR_SESSION_HELD_TWISTS, session.totals.held_short);
}

static void test_a_frame_is_used_at_the_time_that_camera_offset_gives_it(void) {
    const manner ahead = {.batch = 1, .camera_ahead_s = 0.03};
    const result aligned = drive_result(&plain);
    desk_clear(1);
    use_setting("camera-offset", -0.03);
    run(&ahead);
    desk_assert_nothing_refused();
    faulty_port_answers_again(&port);
    const result found = read_result();
    assert_same_estimate(&aligned, &found);
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(FRAME_S * (FRAMES - 1)), found.pose.t_ns);
}

static void test_a_report_has_the_time_that_the_frame_was_sent_with(void) {
    const manner behind = {.batch = 1, .camera_ahead_s = -0.03};
    plr_message answer;
    unsigned k = 0;
    use_setting("camera-offset", 0.03);
    run(&behind);
    while (faulty_port_answer_of(&port, PLR_KIND_REPORT, &answer)) {
        TEST_ASSERT_EQUAL_INT(PLR_OK, answer.as.report.report.status);
        TEST_ASSERT_EQUAL_UINT64(drive_time_ns(FRAME_S * k - 0.03), answer.as.report.report.t_ns);
        k++;
    }
    TEST_ASSERT_EQUAL_UINT(FRAMES, k);
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
        use_setting("camera-offset", tried[i].offset_s);
        desk_begin();
        desk_send(inertial_header());
        desk_send(frame);
        desk_run();
        desk_assert_refused(PLR_KIND_STEREO, PLR_E_TIME);
        TEST_ASSERT_EQUAL_UINT32(0, session.last.observations);
    }
}

/* --- what is refused --- */

static void test_an_absurd_reading_costs_itself_and_not_its_batch(void) {
    plr_message batch = drive_imu(0, PER_FRAME, READING_S);
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
    TEST_ASSERT_EQUAL_UINT32(PER_FRAME - 3, totals.twists);
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(READING_S * (PER_FRAME - 1)),
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
    use_setting("accel-range", 50);
    desk_begin();
    desk_send(inertial_header());
    desk_send(drive_start(0));
    for (int n = 0; n < 40; n++) {
        plr_message imu = drive_imu(READING_S * n, 1, 0);
        if (n / 10 % 2 == 1)
            imu.as.imu.readings[0].a_B_mps2[0] = 50 + n;
        desk_send(imu);
    }
    desk_run();
    desk_assert_refused(PLR_KIND_IMU, PLR_E_RANGE);
    desk_assert_refused(PLR_KIND_IMU, PLR_E_RANGE);
    desk_assert_nothing_refused();
    TEST_ASSERT_EQUAL_UINT32(20, session.totals.imu_refused);
    TEST_ASSERT_EQUAL_UINT(1, texts_with("the IMU: "));
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
    TEST_ASSERT_EQUAL_UINT(2, texts_with("the IMU: "));
    TEST_ASSERT_EQUAL_UINT(2, texts_with("set process = twist"));
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
    desk_begin();
    desk_send(drive_header());
    desk_send(drive_start(0));
    desk_send_frames(0, 3);
    desk_run();
    desk_assert_nothing_refused();
}

/* --- counting --- */

static void test_an_end_compares_the_imu_messages(void) {
    plr_message end = {.kind = PLR_KIND_END}, answer;
    const manner batches = {.batch = 5};
    desk_begin();
    send_drive(&batches);
    port.sender.counts.imus += 2; /* two were lost on the way */
    desk_send(end);
    desk_run();
    TEST_ASSERT_EQUAL_UINT(1, texts_with(" 49 of 51 IMU"));
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_END, &answer));
    TEST_ASSERT_EQUAL_UINT8(1U << PLR_COUNTED_IMU, answer.as.end.differs);
    TEST_ASSERT_EQUAL_UINT32(49, answer.as.end.arrived[PLR_COUNTED_IMU]);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_readings_of_an_imu_move_the_body);
    RUN_TEST(test_a_batch_is_its_readings_one_by_one);
    RUN_TEST(test_an_estimate_follows_each_reading_where_it_is_asked_for);
    RUN_TEST(test_twists_among_the_readings_are_refused_once_and_spoil_nothing);
    RUN_TEST(test_readings_among_twists_are_refused_once_and_spoil_nothing);
    RUN_TEST(test_a_setting_overrides_the_process_of_the_header);
    RUN_TEST(test_a_header_of_another_process_is_another_header);
    RUN_TEST(test_readings_wait_for_a_late_camera_as_twists_do);
    RUN_TEST(test_what_does_not_fit_the_delay_is_used_early_and_counted);
    RUN_TEST(test_a_frame_is_used_at_the_time_that_camera_offset_gives_it);
    RUN_TEST(test_a_report_has_the_time_that_the_frame_was_sent_with);
    RUN_TEST(test_a_frame_whose_moved_time_no_clock_has_is_refused);
    RUN_TEST(test_an_absurd_reading_costs_itself_and_not_its_batch);
    RUN_TEST(test_a_batch_beyond_the_end_of_time_is_refused_from_there_on);
    RUN_TEST(test_a_run_of_refusals_is_answered_once_and_told_once);
    RUN_TEST(test_faults_are_told_anew_in_the_next_drive);
    RUN_TEST(test_the_velocity_of_a_start_is_that_of_the_filter);
    RUN_TEST(test_a_velocity_without_three_variances_is_not_given);
    RUN_TEST(test_an_absurd_velocity_is_refused_and_the_pose_is_set);
    RUN_TEST(test_a_velocity_means_nothing_to_a_filter_moved_by_twists);
    RUN_TEST(test_an_end_compares_the_imu_messages);
    return UNITY_END();
}
