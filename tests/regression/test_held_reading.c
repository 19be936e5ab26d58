// SPDX-License-Identifier: MIT
/*
 * Twists stop and frames go on: the last reading is held, and its error with it. Charged as if it
 * stood for many short readings, the pose came out ten times surer than it was.
 */
#include <unity.h>

#include "pelorus/pelorus.h"
#include "support/axes.h"
#include "support/scene.h"

static plr_filter filter;
static const double sigma_mps = 0.5;

static void start(plr_mode mode) {
    const plr_calibration camera = scene_bare_camera(500, 320, 240, 0.2);
    const plr_twist ahead = {.v_B_mps = {1, 0, 0}};
    plr_config config;
    plr_config_default(&config);
    config.mode = (uint8_t)mode;
    config.bias = 0;
    each_axis(config.velocity_sigma, sigma_mps);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &camera, &config, NULL));
    for (unsigned k = 0; k <= 1; k++) /* readings stand for 0.1 s */
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, k * 100000000ULL, &ahead));
}

static void look(plr_time_ns t_ns) {
    const plr_frame frame = {.t_ns = t_ns, .budget = PLR_NO_BUDGET};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &frame, NULL));
}

static double variance_ahead(void) {
    double P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&filter, P));
    return P[0];
}

/* sigma^2 tau^2 of the first reading, sigma^2 h^2 of the one held for h = 1 s. */
static const double expected = 0.25 * (0.01 + 1.0);

static void test_a_reading_held_for_a_second_costs_what_a_constant_error_does(void) {
    start(PLR_MODE_SLAM);
    look(1100000000ULL);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3 * expected, expected, variance_ahead());
}

static void test_it_costs_the_same_however_many_frames_cut_it(void) {
    start(PLR_MODE_SLAM);
    for (unsigned k = 1; k <= 40; k++)
        look(100000000ULL + k * 25000000ULL);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3 * expected, expected, variance_ahead());
}

static void test_frames_a_nanosecond_apart_do_no_harm(void) {
    start(PLR_MODE_SLAM);
    look(1100000000ULL);
    look(1100000001ULL);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3 * expected, expected, variance_ahead());
}

static void test_within_its_interval_a_reading_is_charged_once(void) {
    start(PLR_MODE_SLAM);
    look(150000000ULL);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.25 * (0.01 + 0.1 * 0.05), variance_ahead());
}
