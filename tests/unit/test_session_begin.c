// SPDX-License-Identifier: MIT
/* From a HEADER to a running filter: settings, start pose, what makes no sense. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "pelorus/session.h"
#include "support/faulty_port.h"
#include "support/session_drive.h"

static plr_session session;
static plr_session_options options;
static faulty_port port;
static plr_status refused_status;
static plr_kind refused_kind;
static const plr_setting *refused_setting;

static void on_refused(void *context, plr_kind subject, plr_time_ns t_ns, plr_status status,
                       const plr_setting *culprit) {
    (void)context;
    (void)t_ns;
    if (refused_status != PLR_OK)
        return; /* the first is of interest */
    refused_status = status;
    refused_kind = subject;
    refused_setting = culprit;
}

void setUp(void) {
    faulty_port_init(&port, 1);
    plr_session_options_default(&options);
    options.observer.refused = on_refused;
    refused_status = PLR_OK;
    refused_kind = PLR_KIND_NONE;
    refused_setting = NULL;
}

void tearDown(void) {
}

static void begin(void) {
    const plr_port functions = faulty_port_functions(&port);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&session, &functions, &options));
}

static void send(plr_message message) {
    faulty_port_send(&port, &message);
}

static void run(void) {
    while (plr_session_step(&session) != PLR_STEP_CLOSED)
        continue;
}

static plr_pose pose_now(void) {
    plr_pose pose;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose(&session.filter, &pose));
    return pose;
}

static void assert_pose_near(const plr_pose *expected, double tolerance_m) {
    const plr_pose pose = pose_now();
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(tolerance_m, expected->p[i], pose.p[i]);
    for (int i = 0; i < 9; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, expected->R[i], pose.R[i]);
}

static void assert_pose_is_that_of(double t_s) {
    const plr_pose expected = drive_pose(t_s);
    assert_pose_near(&expected, 1e-3);
}

static const plr_pose IDENTITY = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};

/* --- settings --- */

static void test_option_wins_over_config_over_header(void) {
    const plr_wire_setting override = {plr_setting_by_name("slots")->id, 5};
    plr_message header = drive_header();
    header.as.header.pixel_sigma_px = 3;
    header.as.header.gyro_sigma_radps = 0.5;
    options.overrides = &override;
    options.override_count = 1;
    begin();
    send(header);
    send(drive_config("slots", 4));
    send(drive_config("pixel-sigma", 6));
    send(drive_twist(0));
    run();
    TEST_ASSERT_EQUAL_UINT16(5, plr_filter_config(&session.filter)->slots);
    TEST_ASSERT_EQUAL_DOUBLE(6, plr_filter_config(&session.filter)->pixel_sigma_px);
    TEST_ASSERT_EQUAL_DOUBLE(0.5, plr_filter_config(&session.filter)->gyro_sigma);
}

static void test_the_config_in_force_is_sent_with_the_build(void) {
    plr_message answer;
    begin();
    send(drive_header());
    send(drive_config("slots", 4));
    send(drive_twist(0));
    run();
    TEST_ASSERT_TRUE(faulty_port_answer(&port, &answer));
    TEST_ASSERT_EQUAL_INT(PLR_KIND_CONFIG, answer.kind);
    TEST_ASSERT_EQUAL_UINT32(plr_build_fingerprint(), answer.as.config.build_fingerprint);
    TEST_ASSERT_EQUAL_UINT16(PLR_MAX_LANDMARKS, answer.as.config.max_landmarks);
    TEST_ASSERT_EQUAL_UINT16(PLR_MAX_OBSERVATIONS, answer.as.config.max_observations);
    TEST_ASSERT_EQUAL_UINT8(PLR_BLOCK_OBSERVATIONS, answer.as.config.block_observations);
    TEST_ASSERT_EQUAL_UINT8(sizeof(plr_real), answer.as.config.real_bytes);
    TEST_ASSERT_EQUAL_UINT8(plr_setting_count(), answer.as.config.count);
    const uint8_t slots = plr_setting_by_name("slots")->id;
    for (unsigned i = 0; i < answer.as.config.count; i++)
        if (answer.as.config.settings[i].id == slots)
            TEST_ASSERT_EQUAL_DOUBLE(4, answer.as.config.settings[i].value);
}

static void test_a_config_value_out_of_limits_is_refused_by_name_and_the_rest_taken(void) {
    plr_message config = drive_config("pixel-sigma", 6), answer;
    config.as.config.count = 3;
    config.as.config.settings[1] =
        (plr_wire_setting){plr_setting_by_name("slots")->id, PLR_MAX_LANDMARKS + 1.0};
    config.as.config.settings[2] = (plr_wire_setting){201, 1};
    begin();
    send(drive_header());
    send(config);
    send(drive_twist(0));
    run();
    TEST_ASSERT_EQUAL_INT(PLR_KIND_CONFIG, refused_kind);
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, refused_status);
    TEST_ASSERT_EQUAL_STRING("slots", refused_setting->name);
    TEST_ASSERT_EQUAL_UINT32(2, session.totals.refused);
    TEST_ASSERT_EQUAL_DOUBLE(6, plr_filter_config(&session.filter)->pixel_sigma_px);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_TEXT, &answer));
    TEST_ASSERT_NOT_NULL(strstr(answer.as.text.text, "slots"));
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_TEXT, &answer));
    TEST_ASSERT_NOT_NULL(strstr(answer.as.text.text, "201"));
}

static void test_settings_that_contradict_refuse_the_data_until_they_are_mended(void) {
    begin();
    send(drive_header());
    send(drive_config("landmark-sigma", 1)); /* body takes it from the pixels */
    send(drive_twist(0));
    run();
    TEST_ASSERT_EQUAL_INT(PLR_KIND_CONFIG, refused_kind);
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, refused_status);
    TEST_ASSERT_NOT_NULL(refused_setting);
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_READY, session.phase);
    send(drive_config("landmark-sigma", 0));
    send(drive_twist(0.1));
    run();
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_RUNNING, session.phase);
}

static void check_calibration_refused(plr_message header) {
    setUp();
    begin();
    send(header);
    send(drive_twist(0));
    send(drive_stereo(0));
    run();
    TEST_ASSERT_EQUAL_INT(PLR_KIND_HEADER, refused_kind);
    TEST_ASSERT_EQUAL_INT(PLR_E_CALIBRATION, refused_status);
    TEST_ASSERT_EQUAL_UINT32(3, session.totals.refused);
    send(drive_header());
    send(drive_twist(0.1));
    run();
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_RUNNING, session.phase);
}

static void test_a_calibration_without_sense_is_refused_and_a_better_one_taken(void) {
    plr_message header = drive_header();
    header.as.header.calibration.baseline_m = 0;
    check_calibration_refused(header);
    header = drive_header();
    header.as.header.calibration.fx_px = (double)NAN;
    check_calibration_refused(header);
    header = drive_header();
    header.as.header.calibration.T_CB.R[0] = 2;
    check_calibration_refused(header);
}

static void test_world_in_float32_is_warned_of_and_in_float64_not(void) {
    plr_message answer;
    begin();
    send(drive_header());
    send(drive_config("model", PLR_MODEL_WORLD));
    send(drive_twist(0));
    run();
    const bool warned = faulty_port_answer_of(&port, PLR_KIND_TEXT, &answer);
    TEST_ASSERT_EQUAL(PLR_REAL == 32, warned);
    if (warned)
        TEST_ASSERT_NOT_NULL(strstr(answer.as.text.text, "float32"));
}

static void test_overrides_that_no_setting_allows_are_refused_at_init(void) {
    const plr_port functions = faulty_port_functions(&port);
    plr_wire_setting override = {plr_setting_by_name("slots")->id, -1};
    options.overrides = &override;
    options.override_count = 1;
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, plr_session_init(&session, &functions, &options));
    override = (plr_wire_setting){222, 1};
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, plr_session_init(&session, &functions, &options));
}

/* --- where the pose starts --- */

static void test_start_wins_over_truth(void) {
    begin();
    send(drive_header());
    send(drive_start(2)); /* says that the body stands where it will be at 2 s */
    send(drive_twist(2));
    plr_message truth = drive_truth(2);
    truth.as.truth.T_WB = IDENTITY;
    send(truth);
    send(drive_stereo(2));
    run();
    assert_pose_is_that_of(2);
}

static void test_the_first_truth_counts_where_there_is_no_start(void) {
    begin();
    send(drive_header());
    send(drive_twist(3));
    send(drive_truth(3));
    send(drive_stereo(3));
    send(drive_twist(3.1));
    plr_message later = drive_truth(3.1);
    later.as.truth.T_WB.p[0] += 50;
    send(later);
    send(drive_stereo(3.1));
    run();
    assert_pose_is_that_of(3.1);
}

/* The twist of 3.0 s carries the body from the TRUTH at 3.05 s on. */
static void test_twists_may_precede_the_truth(void) {
    plr_message answer;
    begin();
    send(drive_header());
    send(drive_twist(2.9));
    send(drive_twist(3));
    send(drive_truth(3.05));
    send(drive_stereo(3.1));
    run();
    assert_pose_is_that_of(3.1);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_POSE, &answer));
    TEST_ASSERT_EQUAL_UINT16(0, answer.as.pose.reset_count); /* a start is no reset */
}

static void test_twists_may_precede_the_start(void) {
    begin();
    send(drive_header());
    send(drive_start(3.05));
    send(drive_twist(2.9));
    send(drive_twist(3));
    send(drive_stereo(3.1));
    run();
    assert_pose_is_that_of(3.1);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
}

static void test_without_either_it_is_identity(void) {
    begin();
    send(drive_header());
    send(drive_twist(5));
    send(drive_stereo(5));
    send(drive_truth(5.1)); /* behind the first frame: for evaluation alone */
    run();
    assert_pose_near(&IDENTITY, 1e-9);
}

static void test_identity_can_be_asked_for(void) {
    options.start = PLR_START_IDENTITY;
    begin();
    send(drive_header());
    send(drive_start(5));
    send(drive_truth(5));
    send(drive_twist(5));
    send(drive_stereo(5));
    run();
    assert_pose_near(&IDENTITY, 1e-9);
}

static void test_who_asks_for_truth_gets_no_frame_before_it(void) {
    options.start = PLR_START_TRUTH;
    begin();
    send(drive_header());
    send(drive_start(5));
    send(drive_twist(5));
    send(drive_stereo(5));
    run();
    TEST_ASSERT_EQUAL_INT(PLR_KIND_STEREO, refused_kind);
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, refused_status);
    send(drive_truth(5.05));
    send(drive_stereo(5.1));
    run();
    assert_pose_is_that_of(5.1);
}

static void test_who_asks_for_a_start_gets_no_frame_before_it(void) {
    options.start = PLR_START_RECORDED;
    begin();
    send(drive_header());
    send(drive_twist(5));
    send(drive_truth(5));
    send(drive_stereo(5));
    run();
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, refused_status);
    send(drive_start(5.05));
    send(drive_stereo(5.1));
    run();
    assert_pose_is_that_of(5.1);
}

static void test_a_start_behind_the_first_frame_is_refused_and_identity_taken(void) {
    begin();
    send(drive_header());
    send(drive_start(7));
    send(drive_twist(5));
    send(drive_stereo(5));
    run();
    TEST_ASSERT_EQUAL_INT(PLR_KIND_START, refused_kind);
    TEST_ASSERT_EQUAL_INT(PLR_E_TIME, refused_status);
    assert_pose_near(&IDENTITY, 1e-9);
}

static void test_a_start_that_is_no_pose_is_refused_and_truth_taken(void) {
    plr_message start = drive_start(5);
    start.as.start.T_WB.R[4] = 3;
    begin();
    send(drive_header());
    send(start);
    send(drive_twist(5));
    send(drive_truth(5));
    send(drive_stereo(5));
    run();
    TEST_ASSERT_EQUAL_INT(PLR_KIND_START, refused_kind);
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, refused_status);
    assert_pose_is_that_of(5);
}

static void test_the_start_covariance_is_taken_packed_row_by_row(void) {
    plr_message start = drive_start(5);
    double P[36];
    start.as.start.has_covariance = true;
    for (int i = 0, k = 0; i < 6; i++)
        for (int j = 0; j <= i; j++, k++)
            start.as.start.P_xi[k] = i == j ? 1.0 + i : 0.03125 * (i + 2 * j);
    begin();
    send(drive_header());
    send(start);
    plr_message stereo = drive_stereo(5);
    stereo.as.stereo.count = 0;
    send(stereo);
    run();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&session.filter, P));
    for (int i = 0, k = 0; i < 6; i++)
        for (int j = 0; j <= i; j++, k++)
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, start.as.start.P_xi[k], P[6 * i + j]);
}

static void test_a_bias_prior_is_taken_whatever_the_pose_starts_from(void) {
    plr_message start = drive_start(5);
    double b[6], P_b[36];
    start.as.start.has_bias = true;
    for (int i = 0; i < 6; i++) {
        start.as.start.bias[i] = 0.25 * i;
        start.as.start.bias_variance[i] = 1e-4 * (1 + i);
    }
    options.start = PLR_START_IDENTITY;
    begin();
    send(drive_header());
    send(drive_config("bias", 1));
    send(start);
    send(drive_twist(5));
    run();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&session.filter, b, P_b));
    for (int i = 0; i < 6; i++) {
        TEST_ASSERT_EQUAL_DOUBLE(0.25 * i, b[i]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-10, 1e-4 * (1 + i), P_b[7 * i]);
    }
}

static void test_a_start_in_mid_flight_sets_the_pose_anew_and_is_counted(void) {
    plr_message answer, start = drive_start(6);
    start.as.start.T_WB.p[2] = 40;
    begin();
    send(drive_header());
    send(drive_twist(5));
    send(drive_stereo(5));
    send(start);
    send(drive_stereo(6));
    run();
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 40, pose_now().p[2]);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_POSE, &answer));
    TEST_ASSERT_EQUAL_UINT16(0, answer.as.pose.reset_count);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_POSE, &answer));
    TEST_ASSERT_EQUAL_UINT16(1, answer.as.pose.reset_count);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_option_wins_over_config_over_header);
    RUN_TEST(test_the_config_in_force_is_sent_with_the_build);
    RUN_TEST(test_a_config_value_out_of_limits_is_refused_by_name_and_the_rest_taken);
    RUN_TEST(test_settings_that_contradict_refuse_the_data_until_they_are_mended);
    RUN_TEST(test_a_calibration_without_sense_is_refused_and_a_better_one_taken);
    RUN_TEST(test_world_in_float32_is_warned_of_and_in_float64_not);
    RUN_TEST(test_overrides_that_no_setting_allows_are_refused_at_init);
    RUN_TEST(test_start_wins_over_truth);
    RUN_TEST(test_the_first_truth_counts_where_there_is_no_start);
    RUN_TEST(test_twists_may_precede_the_truth);
    RUN_TEST(test_twists_may_precede_the_start);
    RUN_TEST(test_without_either_it_is_identity);
    RUN_TEST(test_identity_can_be_asked_for);
    RUN_TEST(test_who_asks_for_truth_gets_no_frame_before_it);
    RUN_TEST(test_who_asks_for_a_start_gets_no_frame_before_it);
    RUN_TEST(test_a_start_behind_the_first_frame_is_refused_and_identity_taken);
    RUN_TEST(test_a_start_that_is_no_pose_is_refused_and_truth_taken);
    RUN_TEST(test_the_start_covariance_is_taken_packed_row_by_row);
    RUN_TEST(test_a_bias_prior_is_taken_whatever_the_pose_starts_from);
    RUN_TEST(test_a_start_in_mid_flight_sets_the_pose_anew_and_is_counted);
    return UNITY_END();
}
