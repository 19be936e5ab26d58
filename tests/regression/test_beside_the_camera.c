// SPDX-License-Identifier: MIT
/*
 * klt 0930_0020 with biases, frame 182, float32: a landmark that the car had passed stood at
 * (6.9, -2.0, 0.6) m, beside the camera, with 22 degrees of bearing uncertainty. Its predicted pixels
 * had a sigma of 37,000 px, so that any residual passed the gate, and its variance shrank by more
 * digits than float32 has: the filter diverged. Such a landmark is no basis for a linearisation.
 */
#include <string.h>
#include <unity.h>

#include "pelorus/pelorus.h"
#include "support/reseal.h"
#include "support/scene.h"

static plr_filter filter;

void setUp(void) {
    const plr_calibration camera = scene_bare_camera(707, 602, 183, 0.54);
    plr_config config;
    plr_config_default(&config);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &camera, &config, NULL));
}

/* Puts a landmark into the state and shows the filter one observation of it in mid image. */
static plr_report show(double x, double y, double z, double sigma_m, bool is_known) {
    const plr_observation seen = {.id = 7, .uL_px = 620, .vL_px = 190, .uR_px = 560, .vR_px = 190};
    const plr_frame frame = {.t_ns = 1, .budget = PLR_NO_BUDGET, .count = 1, .observations = &seen};
    plr_landmark known = {.id = 7, .p_W_m = {x, y, z}};
    plr_report report;
    for (int i = 0; i < 3; i++)
        known.P_W_m2[4 * i] = sigma_m * sigma_m;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_insert_known(&filter, &known));
    filter.belief.slots[0].known = is_known;
    reseal(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &frame, &report));
    return report;
}

static void test_a_landmark_beside_the_camera_is_rejected_whatever_its_residual(void) {
    const plr_report report = show(6.86, -2.03, 0.596, 2.7, false);
    TEST_ASSERT_EQUAL_UINT16(1, report.matched);
    TEST_ASSERT_EQUAL_UINT16(1, report.gated);
    TEST_ASSERT_EQUAL_UINT16(0, report.used);
    TEST_ASSERT_NOT_EQUAL(PLR_HEALTH_DIVERGED, report.health);
}

static void test_the_same_uncertainty_ahead_of_the_camera_is_welcome(void) {
    const plr_report report = show(0.2, 0.1, 6.4, 0.5, false);
    TEST_ASSERT_EQUAL_UINT16(1, report.used);
}

/* Starry Night in localization, with a metre and a radian of doubt about the start: every landmark
 * was rejected for ever by the rule above, and the pose never found. */
static void test_a_known_landmark_may_tell_a_pose_that_is_not_known(void) {
    double P_xi[36] = {0};
    const plr_pose origin = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (int i = 0; i < 36; i += 7)
        P_xi[i] = 1;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&filter, 0, &origin, P_xi));
    const plr_report report = show(0.2, 0.1, 6.4, 0.1, true);
    TEST_ASSERT_EQUAL_UINT16(1, report.used);
}
