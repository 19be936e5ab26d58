// SPDX-License-Identifier: MIT
/*
 * Starry Night's twists with 100 points: no frames for three quarters of a second in a fast turn, with a
 * gyro that lags. The motion's uncertainty was one radian, so the prediction of every point counted as too
 * uncertain, and 28 points that agreed with each other were left out. The pose stayed 0.5 rad off, the landmarks
 * were dropped, and points of before brought a pose that was wrong with health GOOD.
 */
#include <math.h>
#include <unity.h>

#include "pelorus/pelorus.h"
#include "support/axes.h"
#include "support/pose_of.h"
#include "support/random.h"
#include "support/scene.h"

enum { COUNT = 20, FRAMES_BEFORE = 20 };

static const double FOCAL_PX = 500, TURN = 0.35; /* rad, about the camera's y axis */

static plr_filter filter;
static plr_report report;
static rng pixels;
static double points[COUNT][3];
static unsigned count;

/* To the right, so that they are in sight before the camera turns there and after. */
static void place_points(double nearest_m, double farthest_m) {
    for (unsigned i = 0; i < COUNT; i++) {
        const double depth = nearest_m + (farthest_m - nearest_m) * i / COUNT;
        points[i][0] = depth * (0.05 + 0.45 * ((i * 7) % COUNT) / COUNT);
        points[i][1] = depth * (-0.4 + 0.8 * ((i * 11) % COUNT) / COUNT);
        points[i][2] = depth;
    }
}

void setUp(void) {
    pixels = rng_seeded(8);
    count = COUNT;
    place_points(3, 8);
    const plr_calibration camera = scene_bare_camera(FOCAL_PX, 320, 240, 0.2);
    plr_config config;
    plr_config_default(&config);
    config.bias = 0;
    config.slots = COUNT;
    config.pixel_sigma_px = 1;
    each_axis(config.velocity_sigma, 0.05);
    each_axis(config.gyro_sigma, 2); /* 1.5 rad in 0.75 s */
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &camera, &config, NULL));
}

/* A frame at angle `turn`, after twists that say that the camera stands. Each point is moved by a random
 * angle besides. */
static void look(plr_time_ns t_ns, double turn, double scattered_rad) {
    const plr_twist stands = {{0, 0, 0}, {0, 0, 0}};
    plr_observation seen[COUNT];
    for (unsigned i = 0; i < count; i++) {
        const double *p = points[i], by = turn + scattered_rad * rng_normal(&pixels);
        const double x = cos(by) * p[0] - sin(by) * p[2], z = sin(by) * p[0] + cos(by) * p[2];
        const double u = 320 + FOCAL_PX * x / z + 0.5 * rng_normal(&pixels);
        const double v = 240 + FOCAL_PX * p[1] / z + 0.5 * rng_normal(&pixels);
        const plr_observation o = {i + 1,    (float)u, (float)v, (float)(u - FOCAL_PX * 0.2 / z),
                                   (float)v, 0};
        seen[i] = o;
    }
    const plr_frame frame = {t_ns, PLR_NO_BUDGET, (uint16_t)count, seen};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, t_ns, &stands));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &frame, &report));
}

static plr_time_ns see_the_points_well(void) {
    for (unsigned k = 1; k <= FRAMES_BEFORE; k++)
        look(100000000ULL * k, 0, 0);
    return 100000000ULL * FRAMES_BEFORE;
}

/* The turn about y: R(0, 2) is its sine. */
static double turned_by(void) {
    return asin(pose_of(&filter).R[2]);
}

static void test_points_that_agree_tell_a_turn_of_which_nothing_was_known(void) {
    look(see_the_points_well() + 750000000U, TURN, 0);
    TEST_ASSERT_GREATER_THAN_UINT16(COUNT * 3 / 4, report.used);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, TURN, turned_by());
}

static void test_distant_points_tell_it_too(void) {
    place_points(60, 160);
    look(see_the_points_well() + 750000000U, TURN, 0);
    TEST_ASSERT_GREATER_THAN_UINT16(COUNT * 3 / 4, report.used);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, TURN, turned_by());
}

static void test_points_that_do_not_agree_tell_none(void) {
    look(see_the_points_well() + 750000000U, TURN, 0.1);
    TEST_ASSERT_LESS_THAN_UINT16(3, report.used);
}

static void test_five_points_are_too_few_for_that(void) {
    count = 5;
    look(see_the_points_well() + 750000000U, TURN, 0);
    TEST_ASSERT_LESS_THAN_UINT16(3, report.used);
}
