// SPDX-License-Identifier: MIT
/* Settings in force: override over CONFIG over HEADER over default. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "session/layers.h"
#include "support/session_drive.h"

static plr_header header;
static plr_config_message wanted;
static plr_wire_setting overrides[8];
static unsigned override_count;
static plr_config config;
static const plr_setting *culprit;

void setUp(void) {
    header = drive_header().as.header;
    memset(&wanted, 0, sizeof wanted);
    override_count = 0;
}

static plr_status compose(void) {
    const plr_layers layers = {&header, &wanted, overrides, override_count};
    return plr_layers_compose(&config, &layers, &culprit);
}

static plr_wire_setting value(const char *name, double x) {
    return (plr_wire_setting){plr_setting_by_name(name)->id, x};
}

static void want(const char *name, double x) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_layers_want(&wanted, value(name, x)));
}

static void override(const char *name, double x) {
    overrides[override_count++] = value(name, x);
}

static void test_with_nothing_said_everything_is_at_its_default(void) {
    plr_config standard;
    plr_config_default(&standard);
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *s = plr_setting_at(i);
        TEST_ASSERT_EQUAL_DOUBLE(plr_config_get(&standard, s), plr_config_get(&config, s));
    }
}

static void test_each_layer_wins_over_those_below(void) {
    header.pixel_sigma_px = 3;
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_DOUBLE(3, config.pixel_sigma_px);
    want("pixel-sigma", 4);
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_DOUBLE(4, config.pixel_sigma_px);
    override("pixel-sigma", 5);
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_DOUBLE(5, config.pixel_sigma_px);
    override("pixel-sigma", 6);
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_DOUBLE(6, config.pixel_sigma_px);
}

static void test_the_header_says_twist_timing_and_all_seven_noises(void) {
    header.twist_timing = PLR_TWIST_MID;
    header.pixel_sigma_px = 1.5;
    header.velocity_sigma_mps = 0.25;
    header.gyro_sigma_radps = 0.125;
    header.bias_velocity_sigma_mps = 0.5;
    header.bias_gyro_sigma_radps = 0.0625;
    header.bias_velocity_walk = 1e-3;
    header.bias_gyro_walk = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_UINT8(PLR_TWIST_MID, config.twist_timing);
    TEST_ASSERT_EQUAL_DOUBLE(1.5, config.pixel_sigma_px);
    TEST_ASSERT_EACH_EQUAL_DOUBLE(0.25, config.velocity_sigma, 3);
    TEST_ASSERT_EACH_EQUAL_DOUBLE(0.125, config.gyro_sigma, 3);
    TEST_ASSERT_EQUAL_DOUBLE(0.5, config.bias_velocity_sigma_mps);
    TEST_ASSERT_EQUAL_DOUBLE(0.0625, config.bias_gyro_sigma_radps);
    TEST_ASSERT_EQUAL_DOUBLE(1e-3, config.bias_velocity_walk);
    TEST_ASSERT_EQUAL_DOUBLE(0, config.bias_gyro_walk);
}

static void test_the_header_says_the_process_and_what_an_imu_needs(void) {
    header.process = PLR_PROCESS_IMU;
    header.gyro_noise = 0.25;
    header.accel_noise = 0.5;
    header.gyro_walk = 0.125;
    header.accel_walk = 0.0625;
    header.bias_accel_sigma_mps2 = 0.75;
    header.gravity_mps2 = 9.75;
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_UINT8(PLR_PROCESS_IMU, config.process);
    TEST_ASSERT_EQUAL_DOUBLE(0.25, config.gyro_noise);
    TEST_ASSERT_EQUAL_DOUBLE(0.5, config.accel_noise);
    TEST_ASSERT_EQUAL_DOUBLE(0.125, config.gyro_walk);
    TEST_ASSERT_EQUAL_DOUBLE(0.0625, config.accel_walk);
    TEST_ASSERT_EQUAL_DOUBLE(0.75, config.bias_accel_sigma_mps2);
    TEST_ASSERT_EQUAL_DOUBLE(9.75, config.gravity_mps2);
    TEST_ASSERT_EQUAL_DOUBLE(0.1,
                             config.bias_gyro_sigma_radps); /* a real part's, where none is said */
    header.bias_gyro_sigma_radps = 0.002;
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_DOUBLE(0.002, config.bias_gyro_sigma_radps);
    override("process", PLR_PROCESS_TWIST);
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_UINT8(PLR_PROCESS_TWIST, config.process);
}

/* Biases of an IMU are always estimated: what a HEADER says of those of twists switches nothing off. */
static void test_a_header_without_biases_of_twists_leaves_those_of_an_imu(void) {
    header.process = PLR_PROCESS_IMU;
    header.bias_velocity_sigma_mps = header.bias_gyro_sigma_radps = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_UINT8(1, config.bias);
}

static void test_the_header_may_tell_the_sigmas_of_single_axes(void) {
    const double way[3] = {0.25, 0.5, 0.75}, turn[3] = {0.125, 0.0625, 0.125};
    header.velocity_sigma_mps = 1;
    header.gyro_sigma_radps = 0.125;
    memcpy(header.velocity_sigma_axes_mps, way, sizeof way);
    header.gyro_sigma_axes_radps[0] = -1;
    header.gyro_sigma_axes_radps[1] = 0.0625;
    header.gyro_sigma_axes_radps[2] = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(way, config.velocity_sigma, 3);
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(turn, config.gyro_sigma, 3);
    override("velocity-sigma", 2); /* for all of them, whatever was told of one */
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EACH_EQUAL_DOUBLE(2, config.velocity_sigma, 3);
}

static void test_what_is_wanted_for_all_axes_last_takes_the_place_of_single_ones(void) {
    want("gyro-sigma", 0.5);
    want("gyro-sigma-z", 0.25);
    want("pixel-sigma", 3);
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_DOUBLE(0.5, config.gyro_sigma[1]);
    TEST_ASSERT_EQUAL_DOUBLE(0.25, config.gyro_sigma[2]);
    want("gyro-sigma", 0.125);
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EACH_EQUAL_DOUBLE(0.125, config.gyro_sigma, 3);
    TEST_ASSERT_EQUAL_DOUBLE(3, config.pixel_sigma_px);
}

static void test_a_bias_is_estimated_unless_the_header_tells_that_there_is_none(void) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_UINT8(1, config.bias);
    header.bias_gyro_sigma_radps = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_UINT8(1, config.bias);
    header.bias_velocity_sigma_mps = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_UINT8(0, config.bias);
    header.bias_gyro_sigma_radps = 0.01;
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_UINT8(1, config.bias);
    override("bias", 0);
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_UINT8(0, config.bias);
}

static void test_suggestions_that_make_no_sense_are_left_out(void) {
    plr_config standard;
    plr_config_default(&standard);
    header.pixel_sigma_px = (double)NAN;
    header.velocity_sigma_mps = (double)INFINITY;
    header.gyro_sigma_radps = -1e300;
    header.bias_gyro_sigma_radps = 1e300;
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EQUAL_DOUBLE(standard.pixel_sigma_px, config.pixel_sigma_px);
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(standard.velocity_sigma, config.velocity_sigma, 3);
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(standard.gyro_sigma, config.gyro_sigma, 3);
    TEST_ASSERT_EQUAL_DOUBLE(standard.bias_gyro_sigma_radps, config.bias_gyro_sigma_radps);
}

/* 0.5 m/s of a reading is not 0.5 m of a step. */
static void test_with_noise_per_step_the_sigmas_of_a_reading_are_left_out(void) {
    plr_config standard;
    plr_config_default(&standard);
    header.velocity_sigma_mps = 0.5;
    header.gyro_sigma_radps = 0.5;
    header.pixel_sigma_px = 7;
    override("noise", PLR_NOISE_STEP);
    override("velocity-sigma", 0.03);
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_EACH_EQUAL_DOUBLE(0.03, config.velocity_sigma, 3);
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(standard.gyro_sigma, config.gyro_sigma, 3);
    TEST_ASSERT_EQUAL_DOUBLE(7, config.pixel_sigma_px);
}

static void test_an_impossible_override_names_its_setting(void) {
    override("pixel-sigma", -1);
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, compose());
    TEST_ASSERT_EQUAL_STRING("pixel-sigma", culprit->name);
}

static void test_settings_that_contradict_each_other_name_the_one_to_change(void) {
    override("landmark-sigma", 1); /* body takes it from the pixels */
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, compose());
    TEST_ASSERT_NOT_NULL(culprit);
}

static void test_wanted_values_replace_each_other_and_bad_ones_change_nothing(void) {
    want("slots", 5);
    want("pixel-sigma", 2);
    want("slots", 7);
    TEST_ASSERT_EQUAL_UINT8(2, wanted.count);
    TEST_ASSERT_EQUAL_DOUBLE(7, wanted.settings[1].value);
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, plr_layers_want(&wanted, value("slots", 0)));
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, plr_layers_want(&wanted, value("slots", (double)NAN)));
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, plr_layers_want(&wanted, (plr_wire_setting){200, 1}));
    TEST_ASSERT_EQUAL_UINT8(2, wanted.count);
    TEST_ASSERT_EQUAL_DOUBLE(7, wanted.settings[1].value);
}

static void test_what_is_described_is_what_is_in_force(void) {
    plr_config_message described;
    plr_config again;
    override("slots", 9);
    override("mode", PLR_MODE_MAPPING);
    override("gyro-sigma", 0.1234567890123);
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    plr_layers_describe(&described, &config);
    TEST_ASSERT_EQUAL_UINT32(plr_build_fingerprint(), described.build_fingerprint);
    TEST_ASSERT_EQUAL_UINT8(plr_setting_count(), described.count);
    TEST_ASSERT_TRUE(plr_layers_agree(&described, &config));

    plr_config_default(&again);
    TEST_ASSERT_FALSE(plr_layers_agree(&described, &again));
    wanted = described;
    override_count = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, compose());
    TEST_ASSERT_TRUE(plr_layers_agree(&described, &config));
}
