// SPDX-License-Identifier: MIT
/* From a HEADER to a running filter: which settings, and what makes no sense. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/session_desk.h"

void setUp(void) {
    desk_clear(1);
}

/* --- settings --- */

static void test_option_wins_over_config_over_header(void) {
    const plr_wire_setting override = {plr_setting_by_name("slots")->id, 5};
    plr_message header = drive_header();
    header.as.header.pixel_sigma_px = 3;
    header.as.header.gyro_sigma_radps = 0.5;
    options.overrides = &override;
    options.override_count = 1;
    desk_begin();
    desk_send(header);
    desk_send(drive_config("slots", 4));
    desk_send(drive_config("pixel-sigma", 6));
    desk_send(drive_twist(0));
    desk_run();
    TEST_ASSERT_EQUAL_UINT16(5, plr_filter_config(&session.filter)->slots);
    TEST_ASSERT_EQUAL_DOUBLE(6, plr_filter_config(&session.filter)->pixel_sigma_px);
    TEST_ASSERT_EACH_EQUAL_DOUBLE(0.5, plr_filter_config(&session.filter)->gyro_sigma, 3);
}

static void test_the_config_in_force_is_sent_with_the_build(void) {
    plr_message answer;
    desk_begin_drive();
    desk_send(drive_config("slots", 4));
    desk_send(drive_twist(0));
    desk_run();
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
    desk_begin_drive();
    desk_send(config);
    desk_send(drive_twist(0));
    desk_run();
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
    plr_message answer;
    desk_begin_drive();
    desk_send(drive_config("landmark-sigma", 1)); /* body takes it from the pixels */
    desk_send(drive_twist(0));
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_KIND_CONFIG, refused_kind);
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, refused_status);
    TEST_ASSERT_NOT_NULL(refused_setting);
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_REJECTED, session.phase);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, PLR_KIND_TEXT, &answer));
    TEST_ASSERT_EQUAL_UINT8(PLR_SEVERITY_ERROR, answer.as.text.severity);
    TEST_ASSERT_NOT_NULL(strstr(answer.as.text.text, "landmark-sigma: model = body"));
    desk_send(drive_config("landmark-sigma", 0));
    desk_send(drive_twist(0.1));
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_STARTING, session.phase);
}

static void check_calibration_refused(plr_message header) {
    setUp();
    desk_begin();
    desk_send(header);
    desk_send(drive_twist(0));
    desk_send(drive_stereo(0));
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_KIND_HEADER, refused_kind);
    TEST_ASSERT_EQUAL_INT(PLR_E_CALIBRATION, refused_status);
    TEST_ASSERT_EQUAL_UINT32(3, session.totals.refused);
    desk_send(drive_header());
    desk_send(drive_twist(0.1));
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_STARTING, session.phase);
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
    desk_begin_drive();
    desk_send(drive_config("model", PLR_MODEL_WORLD));
    desk_send(drive_twist(0));
    desk_run();
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
