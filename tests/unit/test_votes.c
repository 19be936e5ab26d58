// SPDX-License-Identifier: MIT
/* Points are asked whether twists or pictures are right (MATH 17): of a robot whose twists say 0.2 m a
 * frame and whose pictures say 0.04 m. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "filter/votes.h"
#include "math/dense.h"
#include "pelorus/pelorus.h"
#include "support/random.h"
#include "support/reseal.h"
#include "support/scene.h"

#define WAY_M      0.2  /* by twists, a frame */
#define PICTURES_M 0.04 /* by pictures */

enum { COUNT = 16 };

typedef struct spot {
    double x_m, y_m, z_m; /* in the camera */
    double step_m;        /* by which the camera comes nearer, a frame */
} spot;

static plr_filter filter;
static rng pixels;
static spot spots[COUNT];
static plr_observation seen[COUNT];
static plr_applied_motion believed, applied;
static plr_correction correction;
static plr_real moved[6];

/* The first `standing` points stand, the others move along, so that they come nearer by `step_m`. */
static void place(unsigned standing, double step_m, double nearest_m) {
    for (unsigned i = 0; i < COUNT; i++) {
        const spot s = {-2.0 + 4.0 * ((i * 7) % COUNT) / COUNT,
                        -1.5 + 3.0 * ((i * 11) % COUNT) / COUNT, nearest_m + 0.3 * i,
                        i < standing ? WAY_M : step_m};
        spots[i] = s;
    }
}

void setUp(void) {
    const plr_calibration camera = scene_bare_camera(500, 320, 240, 0.2);
    plr_config config;
    plr_config_default(&config);
    config.slots = COUNT;
    config.pixel_sigma_px = 0.5;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &camera, &config, NULL));
    pixels = rng_seeded(11);
    filter.count = COUNT;
    for (unsigned i = 0; i < COUNT; i++) {
        filter.slots[i].id = seen[i].id = 70000 * i + 1; /* of more than 16 bits */
        filter.work.order[i] = filter.work.slot_of[i] = (uint16_t)i;
    }
    filter.consistency.contradicted = 1;
    memset(&believed, 0, sizeof believed);
    memset(&correction, 0, sizeof correction);
    believed.p[2] = (plr_real)WAY_M;
    for (unsigned k = 0; k < 6; k++) {
        believed.L[7 * k] = PLR_R(0.002);
        correction.Lambda[plr_upper_row(6, k)] = 1;
    }
    applied = believed;
    memcpy(applied.JL, applied.L, sizeof applied.JL);
    memset(moved, 0, sizeof moved);
    moved[2] = (plr_real)(PICTURES_M - WAY_M);
}

/* One frame; the pose follows the pictures, as it does while the twists are contradicted. */
static bool look(void) {
    const plr_frame frame = {0, PLR_NO_BUDGET, COUNT, seen};
    for (unsigned i = 0; i < COUNT; i++) {
        spot *s = &spots[i];
        s->z_m -= s->step_m;
        const double u = 500 * s->x_m / s->z_m + 320, v = 500 * s->y_m / s->z_m + 240;
        const double noise[3] = {0.5 * rng_normal(&pixels), 0.5 * rng_normal(&pixels),
                                 0.35 * rng_normal(&pixels)};
        seen[i].uL_px = (float)(u + noise[0]);
        seen[i].uR_px = (float)(u - 100 / s->z_m + noise[1]);
        seen[i].vL_px = seen[i].vR_px = (float)(v + noise[2]);
    }
    filter.frame_number++;
    filter.p_WB[2] += WAY_M + (double)moved[2];
    return plr_votes_add(&filter, &frame, COUNT, &believed, &applied, &correction, moved);
}

/* Frames until the verdict, 0: none among so many. */
static unsigned until_verdict(unsigned frames) {
    for (unsigned k = 1; k <= frames; k++)
        if (look())
            return k;
    return 0;
}

static void test_points_that_stand_bring_the_pose_back(void) {
    place(5, PICTURES_M, 12);
    const unsigned frames = until_verdict(40);
    TEST_ASSERT_GREATER_THAN_UINT(0, frames);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, WAY_M * frames, filter.p_WB[2]);
    TEST_ASSERT_TRUE(plr_votes_trust_twists(&filter));
    TEST_ASSERT_EQUAL_UINT32(1, filter.totals.widened); /* the controller is told of the jump */
}

static void test_wheels_that_slip_find_no_support(void) {
    place(0, PICTURES_M, 12);
    TEST_ASSERT_EQUAL_UINT(0, until_verdict(100));
    TEST_ASSERT_FALSE(plr_votes_trust_twists(&filter));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, PICTURES_M * 100, filter.p_WB[2]);
    for (unsigned k = 0; k < 6; k++) /* the pictures' way is accepted */
        TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.own.votes.difference[k]);
}

/* Nor do they where points move in a third way, though these contradict the pictures too. */
static void test_wheels_that_slip_find_no_support_in_other_traffic(void) {
    place(0, PICTURES_M, 12);
    for (unsigned i = 0; i < 6; i++)
        spots[i].step_m = -0.1;
    TEST_ASSERT_EQUAL_UINT(0, until_verdict(60));
}

/* Two points may be one wrong track and a reflection. */
static void test_two_points_are_too_few(void) {
    place(2, PICTURES_M, 12);
    for (unsigned k = 0; k < 40; k++) {
        TEST_ASSERT_FALSE(look());
        TEST_ASSERT_FALSE(plr_votes_trust_twists(&filter));
    }
}

/* Pictures whose steps are noisy contradict every point; distant ones would rather have the smooth way of
 * the twists, and know nothing of it. */
static void test_distant_points_do_not_vote_for_the_twists(void) {
    place(0, 0, 300);
    for (unsigned i = 0; i < COUNT; i++) {
        spots[i].x_m *= 30;
        spots[i].y_m *= 30;
    }
    for (unsigned k = 0; k < 60; k++) {
        moved[2] = (plr_real)(-WAY_M + (k % 2 ? 1.5 : -1.5));
        moved[4] = PLR_R(k % 2 ? 0.002 : -0.002);
        TEST_ASSERT_FALSE(look());
    }
    TEST_ASSERT_FALSE(plr_votes_trust_twists(&filter));
}

/* Without a contradiction the pose is the twists' already; that they are right is remembered. */
static void test_without_a_contradiction_the_pose_stays(void) {
    filter.consistency.contradicted = 0;
    filter.consistency.drifting = 1;
    place(5, PICTURES_M, 12);
    for (unsigned k = 0; k < 40; k++)
        TEST_ASSERT_FALSE(look());
    TEST_ASSERT_TRUE(plr_votes_trust_twists(&filter));
    TEST_ASSERT_EQUAL_UINT32(0, filter.totals.widened);
}

static void test_without_doubt_nobody_is_asked(void) {
    filter.consistency.contradicted = 0;
    place(5, PICTURES_M, 12);
    look();
    for (unsigned t = 0; t < PLR_TRIALS; t++)
        TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.own.votes.trials[t].frames);
}

/* What a map or another sensor has confirmed is not taken back. */
static void test_a_pose_that_is_known_from_elsewhere_is_kept(void) {
    place(0, PICTURES_M, 12);
    for (unsigned k = 0; k < 5; k++)
        look();
    TEST_ASSERT_LESS_THAN_DOUBLE(-0.5, (double)filter.own.votes.difference[2]);
    plr_votes_keep_pose(&filter);
    TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.own.votes.difference[2]);
    for (unsigned t = 0; t < PLR_TRIALS; t++) /* the motion so far has been applied without them */
        TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.own.votes.trials[t].frames);
    filter.slots[3].known = 1;
    look();
    TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.own.votes.difference[2]);
}

static void test_setting_the_pose_forgets_the_votes(void) {
    const plr_pose here = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_reset(&filter));
    filter.own.votes.trusted_frames = 50;
    filter.own.votes.difference[0] = 7;
    reseal(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&filter, 0, &here, NULL));
    TEST_ASSERT_FALSE(plr_votes_trust_twists(&filter));
    TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.own.votes.difference[0]);
}

/* A robot that was switched off may have been carried. */
static void test_resuming_forgets_the_votes(void) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_reset(&filter));
    filter.clock_started = 1;
    filter.own.votes.difference[0] = 7;
    filter.own.votes.trials[2].frames = 5;
    reseal(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&filter, 1000, NULL));
    TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.own.votes.difference[0]);
    TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.own.votes.trials[2].frames);
}

/* An IMU has its motion where the votes are. */
static void test_with_an_imu_nothing_is_touched(void) {
    plr_core_motion before;
    filter.config.process = PLR_PROCESS_IMU;
    memset(&filter.own.core_motion, 0x3F, sizeof filter.own.core_motion);
    before = filter.own.core_motion;
    place(5, PICTURES_M, 12);
    TEST_ASSERT_EQUAL_UINT(0, until_verdict(40));
    plr_votes_clear(&filter);
    plr_votes_keep_pose(&filter);
    TEST_ASSERT_FALSE(plr_votes_trust_twists(&filter));
    TEST_ASSERT_EQUAL_MEMORY(&before, &filter.own.core_motion, sizeof before);
}
