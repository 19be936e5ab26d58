// SPDX-License-Identifier: MIT
/* Going on after an interruption: on another clock, and perhaps from another place. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/axes.h"
#include "support/pose_of.h"
#include "support/reseal.h"
#include "support/scene.h"
#include "support/specimens.h"

static plr_filter filter, before;
static scene world;
static plr_config config;
static plr_report report;

void setUp(void) {
    scene_options options;
    scene_options_default(&options);
    scene_start(&world, &options);
    plr_config_default(&config);
    config.pixel_sigma_px = 1;
    each_axis(config.velocity_sigma, 0.05);
}

static void start(void) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &world.calibration, &config, NULL));
}

/* Drives; the filter's clock is `ahead_ns` ahead of the world's. */
static void drive(unsigned frames, plr_time_ns ahead_ns) {
    for (unsigned i = 0; i < frames; i++) {
        for (unsigned k = 0; k < 5; k++) {
            const plr_twist reading = scene_read(&world);
            TEST_ASSERT_EQUAL_INT(PLR_OK,
                                  plr_filter_predict(&filter, world.t_ns + ahead_ns, &reading));
            scene_move(&world, 20000000);
        }
        plr_frame seen = scene_look(&world);
        seen.t_ns += ahead_ns;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &seen, &report));
    }
}

static double error_m(void) {
    plr_pose truth;
    scene_pose(&world, &truth);
    const plr_pose estimate = pose_of(&filter);
    return hypot(hypot(estimate.p[0] - truth.p[0], estimate.p[1] - truth.p[1]),
                 estimate.p[2] - truth.p[2]);
}

static void diagonal(double P[36], double position, double rotation) {
    memset(P, 0, 36 * sizeof *P);
    for (unsigned i = 0; i < 6; i++)
        P[7 * i] = i < 3 ? position : rotation;
}

static void test_a_clock_that_begins_anew_is_followed(void) {
    const plr_twist reading = {{0}, {0}};
    start();
    drive(5, 3600000000000u);
    const unsigned held = plr_filter_landmark_count(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_E_TIME, plr_filter_predict(&filter, world.t_ns, &reading));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, world.t_ns, NULL));
    TEST_ASSERT_EQUAL_UINT64(world.t_ns, plr_filter_time(&filter));
    TEST_ASSERT_EQUAL_UINT(held, plr_filter_landmark_count(&filter));
    drive(5, 0);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, report.health);
    TEST_ASSERT_TRUE(error_m() < 0.1);
}

static void test_a_long_pause_is_bridged(void) {
    start();
    drive(5, 0);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, world.t_ns + 86400000000000u, NULL));
    drive(5, 86400000000000u);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, report.health);
    TEST_ASSERT_TRUE(error_m() < 0.1);
}

static void test_a_body_that_was_moved_meanwhile_is_found_again_by_its_landmarks(void) {
    double P_moved[36];
    diagonal(P_moved, 0.1, 1e-3);
    start();
    drive(10, 0);
    world.T_WB[3] += 0.4;
    world.T_WB[7] -= 0.3;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, world.t_ns, P_moved));
    TEST_ASSERT_TRUE(error_m() > 0.4);
    drive(2, 0);
    TEST_ASSERT_TRUE(error_m() < 0.1);
    drive(10, 0);
    TEST_ASSERT_TRUE(error_m() < 0.1);
}

/* Somebody carried the body 0.5 m while the odometry said that it stood. The trace of its position's
 * covariance afterwards, as metres. */
static double width_after_it_was_carried(plr_scene_policy policy) {
    double P[36];
    config.scene = (uint8_t)policy;
    start();
    drive(30, 0);
    world.T_WB[3] += 0.4;
    world.T_WB[7] -= 0.3;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, world.t_ns, NULL));
    TEST_ASSERT_TRUE(error_m() > 0.4);
    drive(1, 0); /* which waits for the next one */
    TEST_ASSERT_TRUE(report.reasons & PLR_REASON_TWIST_CONTRADICTED);
    TEST_ASSERT_EQUAL_UINT32(0, filter.totals.contradictions);
    drive(1, 0); /* the landmarks agree on where it is, and the pose follows them: but it is said */
    TEST_ASSERT_BITS(PLR_REASON_TWIST_CONTRADICTED | PLR_REASON_POSE_MAY_BE_WRONG, UINT32_MAX,
                     report.reasons);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DEGRADED, report.health);
    TEST_ASSERT_EQUAL_UINT32(1, filter.totals.contradictions);
    TEST_ASSERT_TRUE(error_m() < 0.1);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&filter, P));
    return sqrt(P[0] + P[7] + P[14]);
}

static void test_landmarks_that_agree_are_followed_without_an_allowance_and_it_is_said(void) {
    const double width_m = width_after_it_was_carried(PLR_SCENE_STANDS);
    TEST_ASSERT_TRUE(error_m() < 2 * width_m);
}

static void test_where_the_scene_may_move_the_covariance_holds_the_odometrys_pose_too(void) {
    TEST_ASSERT_TRUE(width_after_it_was_carried(PLR_SCENE_MAY_MOVE) > 0.45);
}

static void test_the_pose_gains_what_was_allowed_and_nothing_else_changes(void) {
    double P[36], more[36], P_moved[36];
    rng chance = rng_seeded(21);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, true, 4);
    diagonal(P_moved, 0.04, 0.01);
    P_moved[1] = P_moved[6] = 0.01;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&filter, P));
    memcpy(&before, &filter, sizeof before);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, 77, P_moved));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&filter, more));
    for (unsigned i = 0; i < 36; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-5 * (fabs(P[i]) + 0.04), P[i] + P_moved[i], more[i]);
    TEST_ASSERT_EQUAL_MEMORY(before.belief.R_WB, filter.belief.R_WB, sizeof filter.belief.R_WB);
    TEST_ASSERT_EQUAL_MEMORY(before.belief.p_WB, filter.belief.p_WB, sizeof filter.belief.p_WB);
    TEST_ASSERT_EQUAL_MEMORY(before.belief.slots, filter.belief.slots, sizeof filter.belief.slots);
    TEST_ASSERT_EQUAL_MEMORY(before.belief.P, filter.belief.P, sizeof filter.belief.P);
    TEST_ASSERT_EQUAL_MEMORY(&before.totals, &filter.totals, sizeof filter.totals);
}

/* A resume forgets where the landmarks were when the body began to stand. */
static void test_a_body_that_stood_before_goes_on_undamaged(void) {
    rng chance = rng_seeded(23);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, true, 4);
    filter.belief.slots[2].anchored = 1;
    reseal(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, 77, NULL));
    TEST_ASSERT_EQUAL_UINT8(0, filter.belief.slots[2].anchored);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_save(&filter, NULL, NULL));
}

static void test_allowances_add_up_and_outlast_their_application(void) {
    double P[36], more[36], P_moved[36];
    rng chance = rng_seeded(22);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, true, 4);
    diagonal(P_moved, 0.04, 0.01);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&filter, P));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, 77, P_moved));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, 78, P_moved));
    const plr_frame empty = {.t_ns = 78, .budget = 1}; /* says nothing, and applies nothing */
    const plr_observation point = {77, 400, 300, 380, 300};
    const plr_frame frame = {78, 1, 1, &point}; /* a new point, for which it is applied */
    for (int applied = 0; applied < 2; applied++) {
        TEST_ASSERT_EQUAL_INT(PLR_OK,
                              plr_filter_update(&filter, applied ? &frame : &empty, &report));
        TEST_ASSERT_EQUAL_UINT16(applied, report.created);
        TEST_ASSERT_EQUAL_DOUBLE(applied ? 0 : (double)(PLR_R(0.04) + PLR_R(0.04)),
                                 (double)filter.motion.Q[0]);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&filter, more));
        for (unsigned i = 0; i < 36; i++)
            TEST_ASSERT_DOUBLE_WITHIN(1e-5 * (fabs(P[i]) + 0.04), P[i] + 2 * P_moved[i], more[i]);
    }
}

/* Where the landmarks are in the world does not depend on who carried the body away. */
static void test_a_body_that_was_moved_leaves_the_map_as_it_was(void) {
    double P_moved[36];
    plr_landmark known, now;
    rng chance = rng_seeded(23);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, true, 4);
    diagonal(P_moved, 0.04, 0.01);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&filter, 2, &known));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, 77, P_moved));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&filter, 2, &now));
    const double scale = known.P_W_m2[0] + known.P_W_m2[4] + known.P_W_m2[8];
    for (unsigned i = 0; i < 9; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-3 * scale, known.P_W_m2[i], now.P_W_m2[i]);
}

static void test_a_reading_of_before_says_nothing_afterwards(void) {
    const plr_twist still = {{0}, {0}}, fast = {{5, 0, 0}, {0}};
    config.twist_timing = PLR_TWIST_START;
    start();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, 1000000000, &fast));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, 500000000, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, 600000000, &still));
    const plr_pose pose = pose_of(&filter);
    TEST_ASSERT_EQUAL_DOUBLE(0, pose.p[0]);
}

static void test_a_frame_that_comes_before_any_twist_finds_the_body_where_it_stood(void) {
    start();
    drive(5, 0);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, 1000, NULL));
    const plr_pose here = pose_of(&filter);
    const plr_frame nothing = {.t_ns = 500001000, .budget = PLR_NO_BUDGET};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &nothing, NULL));
    const plr_pose later = pose_of(&filter);
    for (unsigned i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, here.p[i], later.p[i]);
}

static void refuses(plr_status expected, const double *P_moved) {
    memcpy(&before, &filter, sizeof before);
    TEST_ASSERT_EQUAL_INT(expected, plr_filter_resume(&filter, 5, P_moved));
    TEST_ASSERT_TRUE(specimen_same_state(&before, &filter));
    TEST_ASSERT_EQUAL_UINT32(before.totals.refused + 1, filter.totals.refused);
}

static void test_an_impossible_allowance_is_refused(void) {
    double P_moved[36];
    start();
    drive(1, 0);
    diagonal(P_moved, 1, (double)NAN);
    refuses(PLR_E_NOT_FINITE, P_moved);
    diagonal(P_moved, 1e15, 1);
    refuses(PLR_E_RANGE, P_moved);
    diagonal(P_moved, -1, 1);
    refuses(PLR_E_ARGUMENT, P_moved);
    diagonal(P_moved, 1, 1);
    P_moved[1] = 0.5;
    refuses(PLR_E_ARGUMENT, P_moved);
}

static void test_a_filter_that_has_not_begun_has_nothing_to_go_on_with(void) {
    start();
    refuses(PLR_E_MODE, NULL);
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_resume(NULL, 5, NULL));
    filter.magic = 0;
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_resume(&filter, 5, NULL));
}

static void test_mapping_resumes_its_clock_and_takes_no_allowance(void) {
    double P_moved[36];
    plr_pose pose;
    config.mode = PLR_MODE_MAPPING;
    start();
    scene_pose(&world, &pose);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(&filter, 900, &pose));
    diagonal(P_moved, 1, 1);
    refuses(PLR_E_MODE, P_moved);
    TEST_ASSERT_EQUAL_INT(PLR_E_TIME, plr_filter_move_to(&filter, 100, &pose));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, 50, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(&filter, 100, &pose));
}
