// SPDX-License-Identifier: MIT
/*
 * KITTI 0930_0020, frame 338: three of 70 points, on a car, saw another motion than the twists, the others
 * were too far off to notice a difference, and so all 70 "agreed": the twists counted as contradicted, and
 * the pose followed the car.
 */
#include <math.h>
#include <unity.h>

#include "pelorus/pelorus.h"
#include "support/pose_of.h"
#include "support/scene.h"

enum { NEAR = 4, FAR = 24, COUNT = NEAR + FAR };

static plr_filter filter;
static plr_observation seen[COUNT];

void setUp(void) {
    const plr_calibration camera = scene_bare_camera(500, 320, 240, 0.2);
    plr_config config;
    plr_config_default(&config);
    config.bias = 0;
    config.slots = COUNT;
    config.pixel_sigma_px = 1;
    for (int i = 0; i < 3; i++) {
        config.velocity_sigma[i] = 0.1;
        config.gyro_sigma[i] = 0.002;
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &camera, &config, NULL));
}

/* One frame of a camera that stands; the near points have moved sideways, all of them or none. */
static void look(unsigned frame, unsigned moving, float moved_px) {
    const plr_time_ns t_ns = 100000000ULL * frame;
    const plr_twist still = {{0, 0, 0}, {0, 0, 0}};
    for (unsigned i = 0; i < COUNT; i++) {
        const float depth = i < NEAR ? 5 : 60;
        const float u = 60 + 520 * (float)((i * 7) % COUNT) / COUNT;
        const float v = 40 + 400 * (float)((i * 11) % COUNT) / COUNT;
        const float off = i < moving ? moved_px : 0;
        const plr_observation o = {i + 1, u + off, v, u + off - 100 / depth, v};
        seen[i] = o;
    }
    const plr_frame of = {t_ns, PLR_NO_BUDGET, COUNT, seen};
    plr_report report;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, t_ns, &still));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &of, &report));
}

static double sideways(void) {
    const plr_pose pose = pose_of(&filter);
    return fabs(pose.p[0]);
}

static void test_a_seventh_of_the_points_is_no_contradiction_of_the_twists(void) {
    for (unsigned frame = 1; frame <= 5; frame++)
        look(frame, 0, 0);
    look(6, NEAR, 15);
    TEST_ASSERT_EQUAL_UINT32(0, filter.totals.contradictions);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.02, sideways());
}

/* The whole picture moves by 15 px: the camera has been turned. */
static void test_all_the_points_are(void) {
    for (unsigned frame = 1; frame <= 5; frame++)
        look(frame, 0, 0);
    look(6, COUNT, 15);
    TEST_ASSERT_EQUAL_UINT32(1, filter.totals.contradictions);
}
