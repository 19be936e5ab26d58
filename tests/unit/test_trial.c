// SPDX-License-Identifier: MIT
/* One point says which motion it fits (MATH 17): that of the twists, 0.2 m a frame forward, or that of
 * the pictures, 0.04 m. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "filter/trial.h"
#include "pelorus/pelorus.h"
#include "sensor/stereo.h"
#include "support/exact_camera.h"
#include "support/random.h"
#include "support/scene.h"

#define WAY_M      0.2
#define PICTURES_M 0.04
#define SIGMA_PX   0.5
#define WRONG_PX   50

static plr_filter filter;
static plr_candidates candidates;
static rng pixels;
static plr_trial trial;

void setUp(void) {
    const plr_calibration camera = scene_bare_camera(500, 320, 240, 0.2);
    plr_config config;
    plr_config_default(&config);
    config.pixel_sigma_px = SIGMA_PX;
    exact_camera(&config);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &camera, &config, NULL));
    memset(&candidates, 0, sizeof candidates);
    for (unsigned h = 0; h < PLR_MOTIONS; h++)
        candidates.motion[h].R[0] = candidates.motion[h].R[4] = candidates.motion[h].R[8] = 1;
    candidates.motion[PLR_BY_TWISTS].p[2] = PLR_R(WAY_M);
    candidates.motion[PLR_BY_PICTURES].p[2] = PLR_R(PICTURES_M);
    candidates.motion[PLR_BY_PICTURES_WAY].p[2] = PLR_R(PICTURES_M);
    pixels = rng_seeded(3);
}

/* What the camera sees of a point at (x, y, z), in m; `off_px` is added to the left pixel's u. */
static plr_observation look_at(double x_m, double y_m, double z_m, double off_px) {
    const double sigma[3] = {sqrt((double)plr_stereo_variance(&filter, 0)),
                             sqrt((double)plr_stereo_variance(&filter, 1)),
                             sqrt((double)plr_stereo_variance(&filter, 2))};
    const double u = 500 * x_m / z_m + 320, v = 500 * y_m / z_m + 240;
    plr_observation seen;
    memset(&seen, 0, sizeof seen);
    seen.id = 7;
    seen.uL_px = (float)(u + sigma[0] * rng_normal(&pixels) + off_px);
    seen.uR_px = (float)(u - 100 / z_m + sigma[1] * rng_normal(&pixels));
    seen.vL_px = seen.vR_px = (float)(v + sigma[2] * rng_normal(&pixels));
    return seen;
}

/* Asks a point at (1, 0.7, z_m) that comes nearer by step_m a frame, until it votes. In frame `wrong`
 * its match is wrong. */
static plr_vote ask(double z_m, double step_m, unsigned frames, unsigned wrong) {
    plr_observation seen = look_at(1, 0.7, z_m, 0);
    plr_trial_begin(&filter, &trial, &seen);
    for (unsigned k = 1; k <= frames && plr_trial_vote(&trial) == PLR_VOTE_OPEN; k++) {
        z_m -= step_m;
        seen = look_at(1, 0.7, z_m, k == wrong ? WRONG_PX : 0);
        TEST_ASSERT_TRUE(plr_trial_follow(&filter, &trial, &seen, &candidates));
    }
    return plr_trial_vote(&trial);
}

static void test_a_point_votes_for_the_motion_that_it_fits(void) {
    TEST_ASSERT_EQUAL_INT(PLR_VOTE_TWISTS, ask(8, WAY_M, 30, 0));
    TEST_ASSERT_EQUAL_INT(PLR_VOTE_PICTURES, ask(8, PICTURES_M, 30, 0));
}

static void test_the_pictures_way_alone_is_enough(void) {
    candidates.motion[PLR_BY_PICTURES].p[0] = PLR_R(0.5);
    TEST_ASSERT_EQUAL_INT(PLR_VOTE_PICTURES, ask(8, PICTURES_M, 30, 0));
}

static void test_a_point_that_goes_its_own_way_votes_for_neither(void) {
    TEST_ASSERT_EQUAL_INT(PLR_VOTE_NEITHER, ask(8, -0.4, 30, 0));
    TEST_ASSERT_EQUAL_INT(PLR_VOTE_NEITHER, ask(14, 0.7, 15, 0));
}

/* To be the better one is not enough: after 10 frames 27 is expected, and 56 is four sigmas above. */
static void test_the_better_motion_must_fit_too(void) {
    static const struct {
        plr_real cost[PLR_MOTIONS]; /* by twists, by pictures, by their way alone */
        plr_vote vote;
    } cases[] = {
        {{50, 200, 200}, PLR_VOTE_TWISTS},   {{70, 200, 200}, PLR_VOTE_OPEN},
        {{200, 50, 200}, PLR_VOTE_PICTURES}, {{200, 70, 200}, PLR_VOTE_OPEN},
        {{200, 200, 50}, PLR_VOTE_PICTURES}, {{50, 60, 200}, PLR_VOTE_OPEN},
        {{90, 200, 200}, PLR_VOTE_NEITHER},
    };
    memset(&trial, 0, sizeof trial);
    trial.frames = 10;
    trial.y[PLR_BY_TWISTS][2] = PLR_R(0.1);
    trial.covariance[5] = PLR_R(1e-6);
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; i++) {
        memcpy(trial.cost, cases[i].cost, sizeof trial.cost);
        TEST_ASSERT_EQUAL_INT_MESSAGE(cases[i].vote, plr_trial_vote(&trial), "case of the table");
    }
}

/* A wrong match costs all motions the same, and does not draw the point away. */
static void test_a_wrong_match_decides_nothing(void) {
    TEST_ASSERT_EQUAL_INT(PLR_VOTE_TWISTS, ask(8, WAY_M, 30, 2));
    TEST_ASSERT_EQUAL_INT(PLR_VOTE_PICTURES, ask(8, PICTURES_M, 30, 2));
}

/* Steps of the pictures that are mostly noise contradict a distant point: it has no say. */
static void test_a_point_of_unknown_range_does_not_vote_for_the_twists(void) {
    plr_observation seen = look_at(4, 3, 300, 0);
    plr_trial_begin(&filter, &trial, &seen);
    for (unsigned k = 0; k < 30; k++) {
        const plr_real toss = PLR_R(k % 2 ? 20 : -20);
        candidates.motion[PLR_BY_PICTURES].p[0] = toss;
        candidates.motion[PLR_BY_PICTURES_WAY].p[0] = toss;
        seen = look_at(4, 3, 300 - WAY_M * (k + 1), 0);
        TEST_ASSERT_TRUE(plr_trial_follow(&filter, &trial, &seen, &candidates));
        TEST_ASSERT_EQUAL_INT(PLR_VOTE_OPEN, plr_trial_vote(&trial));
    }
    TEST_ASSERT_GREATER_THAN_DOUBLE((double)trial.cost[PLR_BY_TWISTS] + 100,
                                    (double)trial.cost[PLR_BY_PICTURES]);
}

/* Where the noise of the way, or of the turn, explains what differs, nothing is said. */
static void test_noise_of_the_motions_leaves_it_open(void) {
    candidates.way_variance = PLR_R(0.3 * 0.3);
    TEST_ASSERT_EQUAL_INT(PLR_VOTE_OPEN, ask(8, WAY_M, 8, 0));
    candidates.way_variance = 0;
    TEST_ASSERT_EQUAL_INT(PLR_VOTE_TWISTS, ask(8, WAY_M, 8, 0));

    const double turn = 0.02; /* about the camera's y axis, by pictures */
    for (unsigned h = PLR_BY_PICTURES; h < PLR_MOTIONS; h++) {
        plr_real *R = candidates.motion[h].R;
        candidates.motion[h].p[2] = PLR_R(WAY_M);
        R[0] = R[8] = (plr_real)cos(turn);
        R[2] = (plr_real)sin(turn);
        R[6] = -R[2];
    }
    candidates.turn_variance = PLR_R(0.04 * 0.04);
    TEST_ASSERT_EQUAL_INT(PLR_VOTE_OPEN, ask(8, WAY_M, 8, 0));
    candidates.turn_variance = 0;
    TEST_ASSERT_EQUAL_INT(PLR_VOTE_TWISTS, ask(8, WAY_M, 8, 0));
}

static void test_a_point_behind_the_camera_is_given_up(void) {
    plr_observation seen = look_at(0.05, 0, 0.3, 0);
    plr_trial_begin(&filter, &trial, &seen);
    candidates.motion[PLR_BY_TWISTS].p[2] = PLR_R(0.5);
    TEST_ASSERT_FALSE(plr_trial_follow(&filter, &trial, &seen, &candidates));
}

/* The cost of the true motion is chi-square with three degrees of freedom a frame: derivative,
 * covariance and noise are right, with a motion whose own noise is in it too. */
static void test_the_true_motion_costs_what_is_expected(void) {
    enum { POINTS = 400, FRAMES = 10 };
    const double way_sigma = 0.02;
    double cost = 0;
    candidates.way_variance = (plr_real)(way_sigma * way_sigma);
    for (unsigned i = 0; i < POINTS; i++) {
        double x = -1 + 0.005 * i, y = 0.7, z = 6 + 0.01 * i;
        plr_observation seen = look_at(x, y, z, 0);
        plr_trial_begin(&filter, &trial, &seen);
        for (unsigned k = 0; k < FRAMES; k++) {
            x -= way_sigma * rng_normal(&pixels);
            y -= way_sigma * rng_normal(&pixels);
            z -= WAY_M + way_sigma * rng_normal(&pixels);
            seen = look_at(x, y, z, 0);
            TEST_ASSERT_TRUE(plr_trial_follow(&filter, &trial, &seen, &candidates));
        }
        cost += (double)trial.cost[PLR_BY_TWISTS];
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.08, 1, cost / (3.0 * FRAMES * POINTS));
}
