// SPDX-License-Identifier: MIT
/*
 * KITTI 0930_0020, frame 338: three of 70 points, on a car, saw another motion than the twists, the others
 * were too far off to notice a difference, and so all 70 "agreed": the twists counted as contradicted, and
 * the pose followed the car.
 *
 * Wheels that turn while the robot stands, among distant points: the few near ones, which alone could tell, were
 * rejected as if they moved, and the pose went 6 m with health GOOD.
 *
 * Five points in sight were too few to contradict the twists: whatever a dead gyro or stopped wheels said was
 * believed, new landmarks were born where that put the camera, and health was GOOD 40 m off.
 */
#include <math.h>
#include <unity.h>

#include "pelorus/pelorus.h"
#include "support/axes.h"
#include "support/random.h"
#include "support/rig.h"

enum { NEAR = 4, FAR = 24, COUNT = NEAR + FAR, AGREEING = 30 };

static plr_filter filter;
static rng pixels; /* without noise the picture would count as frozen */
static unsigned near_points, count;
static float far_m;
static plr_observation seen[COUNT];

void setUp(void) {
    pixels = rng_seeded(5);
    near_points = NEAR;
    count = COUNT;
    far_m = 60;
    const plr_calibration camera = scene_bare_camera(500, 320, 240, 0.2);
    plr_config config;
    plr_config_default(&config);
    config.bias = 0;
    config.slots = COUNT;
    config.pixel_sigma_px = 1;
    each_axis(config.velocity_sigma, 0.1);
    each_axis(config.gyro_sigma, 0.002);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &camera, &config, NULL));
}

/* One frame of a camera that stands while the wheels say `ahead_mps`; the first points have moved
 * sideways. */
static void look(unsigned frame, double ahead_mps, unsigned moving, float moved_px) {
    const plr_time_ns t_ns = 100000000ULL * frame;
    const plr_twist wheels = {{0, 0, ahead_mps}, {0, 0, 0}};
    for (unsigned i = 0; i < count; i++) {
        const float depth = i < near_points ? 5 : far_m;
        const float u = 60 + 520 * (float)((i * 7) % COUNT) / COUNT;
        const float v = 40 + 400 * (float)((i * 11) % COUNT) / COUNT;
        const float off = (i < moving ? moved_px : 0) + (float)(0.3 * rng_normal(&pixels));
        const plr_observation o = {i + 1, u + off, v, u + off - 100 / depth, v, 0};
        seen[i] = o;
    }
    const plr_frame of = {t_ns, PLR_NO_BUDGET, (uint16_t)count, seen};
    plr_report report;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, t_ns, &wheels));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &of, &report));
}

/* An event needs a before. */
static void agree(void) {
    for (unsigned frame = 1; frame <= AGREEING; frame++)
        look(frame, 0, 0, 0);
}

static double sideways(void) {
    const plr_pose pose = pose_of(&filter);
    return fabs(pose.p[0]);
}

static void test_a_seventh_of_the_points_is_no_contradiction_of_the_twists(void) {
    agree();
    look(AGREEING + 1, 0, NEAR, 15);
    look(AGREEING + 2, 0, NEAR, 15);
    TEST_ASSERT_EQUAL_UINT32(0, filter.totals.contradictions);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.02, sideways());
}

static void test_the_few_that_can_tell_are(void) {
    near_points = 5;
    far_m = 200;
    agree();
    for (unsigned frame = 1; frame <= 30; frame++)
        look(AGREEING + frame, 2, 0, 0);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT32(1, filter.totals.contradictions);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.5, fabs(pose_of(&filter).p[2])); /* of 6 m by the wheels */
}

/* The whole picture moves by 15 px: the camera has been turned. */
static void test_all_the_points_are(void) {
    agree();
    look(AGREEING + 1, 0, COUNT, 15);
    look(AGREEING + 2, 0, COUNT, 15); /* and confirms it */
    TEST_ASSERT_EQUAL_UINT32(1, filter.totals.contradictions);
}

static uint32_t contradictions_of_five(unsigned moving) {
    setUp();
    count = near_points = 5;
    agree();
    look(AGREEING + 1, 0, moving, 30);
    look(AGREEING + 2, 0, moving, 30);
    return filter.totals.contradictions;
}

static void test_five_points_contradict_the_twists_if_all_of_them_agree(void) {
    TEST_ASSERT_EQUAL_UINT32(1, contradictions_of_five(5));
    TEST_ASSERT_EQUAL_UINT32(0, contradictions_of_five(4)); /* they may lie on one car */
}

/* Never GOOD and far off. The first five frames of each phase do not count, it takes some to tell. */
static void demand_no_false_health(unsigned frames, double told_share) {
    for (unsigned k = 0; k < frames; k++) {
        double e[6];
        rig_drive_told(1, told_share);
        if (k >= 5 && rig.report.health == PLR_HEALTH_GOOD)
            TEST_ASSERT_LESS_THAN_DOUBLE(100, rig_squared_error(e));
    }
}

static void test_stopped_wheels_among_five_points_are_told_and_covered(void) {
    for (uint64_t seed = 1; seed <= 5; seed++) {
        rig_set_up();
        rig.options.seed = seed;
        rig.options.most_seen = 5;
        rig_begin();
        demand_no_false_health(30, 1);
        demand_no_false_health(100, 0);
        demand_no_false_health(100, 1);
    }
}
