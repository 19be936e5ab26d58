// SPDX-License-Identifier: MIT
/*
 * 03, frame 136, float32: a landmark at 3.2 km had its initial covariance computed in metres, where
 * the rounding of its range variance (1e9 m^2) drowned the bearing's (80 m^2); brought to the polar
 * chart the bearing variance came out negative, and the filter diverged.
 */
#include <unity.h>

#include "filter/predict.h"
#include "math/packed.h"
#include "pelorus/pelorus.h"
#include "state/covariance.h"
#include "state/motion.h"
#include "support/scene.h"

static plr_filter filter;

void setUp(void) {
    const plr_calibration camera = scene_bare_camera(552, 682, 239, 0.6);
    plr_config config;
    plr_config_default(&config);
    config.bias = 1;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &camera, &config, NULL));
}

/* Both bearing variances: (s / f)^2 across, half of it along the rows' mean, less off the axis. */
static void check_bearing_variances(double sigma_rad) {
    const unsigned row = plr_covariance_row(&filter.belief, 0);
    const double full = sigma_rad * sigma_rad;
    for (unsigned i = row; i < row + 2; i++) {
        const double variance = (double)filter.belief.P[plr_packed_at(i, i)];
        TEST_ASSERT_DOUBLE_WITHIN(0.4 * full, 0.6 * full, variance);
    }
}

static void test_a_point_three_kilometres_away_keeps_its_bearing_through_birth_and_motion(void) {
    const float disparity = 0.11F; /* 3 km */
    const plr_observation seen = {
        .id = 1, .uL_px = 390, .vL_px = 140, .uR_px = 390 - disparity, .vR_px = 140};
    const plr_frame frame = {.t_ns = 1, .budget = PLR_NO_BUDGET, .count = 1, .observations = &seen};
    const plr_twist ahead = {.v_B_mps = {0, 0, 15}};
    plr_report report;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &frame, &report));
    TEST_ASSERT_EQUAL_UINT16(1, report.created);
    check_bearing_variances(2.0 / 552);

    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, 2, &ahead));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, 100000000, &ahead));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_prior(&filter));
    TEST_ASSERT_TRUE(plr_covariance_is_positive(&filter.belief));
}
