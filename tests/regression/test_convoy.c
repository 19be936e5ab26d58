// SPDX-License-Identifier: MIT
/*
 * Six points in ten move along with the body at 0.8 of its speed, four stand. The pictures' majority was taken
 * for a contradiction of the twists, and the pose followed it: 4 m off after 30 s, where twists alone are off
 * by 0.3 m. The points that stand agree with the twists: it is the scene that moves.
 */
#include <math.h>
#include <unity.h>

#include "pelorus/pelorus.h"
#include "support/random.h"

enum { COUNT = 20, TWISTS = 5, QUIET = 100, EVENT = 300 };

static const double SPEED_MPS = 1, CONVOY = 0.8, SHARE = 0.6, STEP_S = 0.02;
static const double FOCAL_PX = 500, CENTRE_PX[2] = {320, 240}, BASELINE_M = 0.2, PIXEL_PX = 2;

typedef struct point {
    double at[3]; /* in the world: right, down, ahead */
    uint32_t id;
    bool moves;
} point;

static plr_filter filter;
static plr_report report;
static point points[COUNT];
static uint32_t next_id;
static double body_m; /* of way, ahead */
static rng chance, pixels, readings;

static bool is_seen(const point *p) {
    const double ahead = p->at[2] - body_m;
    return ahead > 1 && ahead < 60 && fabs(FOCAL_PX * p->at[0] / ahead) < CENTRE_PX[0] &&
           fabs(FOCAL_PX * p->at[1] / ahead) < CENTRE_PX[1];
}

static void place(point *p) {
    const double ahead = rng_uniform(&chance, 3, 25);
    p->at[0] = ahead / FOCAL_PX * rng_uniform(&chance, -CENTRE_PX[0], CENTRE_PX[0]);
    p->at[1] = ahead / FOCAL_PX * rng_uniform(&chance, -CENTRE_PX[1], CENTRE_PX[1]);
    p->at[2] = body_m + ahead;
    p->moves = rng_uniform(&chance, 0, 1) < SHARE;
    p->id = ++next_id;
}

static void begin(uint64_t seed) {
    const plr_calibration camera = {.fx_px = FOCAL_PX,
                                    .fy_px = FOCAL_PX,
                                    .cx_px = CENTRE_PX[0],
                                    .cy_px = CENTRE_PX[1],
                                    .baseline_m = BASELINE_M,
                                    .T_CB.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    plr_config config;
    plr_config_default(&config);
    config.pixel_sigma_px = PIXEL_PX;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &camera, &config, NULL));
    chance = rng_seeded(seed);
    pixels = rng_seeded(seed + 1000);
    readings = rng_seeded(seed + 2000);
    body_m = 0;
    next_id = 0;
    for (unsigned k = 0; k < COUNT; k++)
        place(&points[k]);
}

static void drive(unsigned frame, bool convoy) {
    const plr_time_ns frame_ns = 100000000, t_ns = frame_ns * (frame + 1);
    plr_observation seen[COUNT];
    for (unsigned i = 0; i < TWISTS; i++) {
        plr_twist u = {{0, 0, SPEED_MPS}, {0, 0, 0}};
        for (int k = 0; k < 3; k++) {
            u.v_B_mps[k] += 0.1 * rng_normal(&readings);
            u.w_B_radps[k] += 0.01 * rng_normal(&readings);
        }
        TEST_ASSERT_EQUAL_INT(
            PLR_OK, plr_filter_predict(&filter, t_ns - frame_ns + i * frame_ns / TWISTS, &u));
        body_m += STEP_S * SPEED_MPS;
        for (unsigned k = 0; convoy && k < COUNT; k++)
            points[k].at[2] += points[k].moves ? STEP_S * CONVOY * SPEED_MPS : 0;
    }
    for (unsigned k = 0; k < COUNT; k++) {
        if (!is_seen(&points[k]))
            place(&points[k]);
        const point *p = &points[k];
        const double per_m = FOCAL_PX / (p->at[2] - body_m);
        const double z[3] = {CENTRE_PX[0] + per_m * p->at[0], CENTRE_PX[1] + per_m * p->at[1],
                             CENTRE_PX[0] + per_m * (p->at[0] - BASELINE_M)};
        seen[k] = (plr_observation){.id = p->id};
        seen[k].uL_px = (float)(z[0] + PIXEL_PX * rng_normal(&pixels));
        seen[k].vL_px = (float)(z[1] + PIXEL_PX * rng_normal(&pixels));
        seen[k].uR_px = (float)(z[2] + PIXEL_PX * rng_normal(&pixels));
        seen[k].vR_px = (float)(z[1] + PIXEL_PX * rng_normal(&pixels));
    }
    const plr_frame pictures = {t_ns, PLR_NO_BUDGET, COUNT, seen};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &pictures, &report));
}

static double error_m(void) {
    plr_pose pose;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose(&filter, &pose));
    return sqrt(pose.p[0] * pose.p[0] + pose.p[1] * pose.p[1] +
                (pose.p[2] - body_m) * (pose.p[2] - body_m));
}

/* Points that stand leave sight soon, those of the convoy stay: after 10 s they are 18 of 20. Where for
 * seconds none stands, as in one drive of the five, nothing is left to tell. */
static void test_the_pose_does_not_follow_a_convoy(void) {
    unsigned near = 0;
    for (uint64_t seed = 1; seed <= 5; seed++) {
        unsigned told = 0;
        begin(seed);
        for (unsigned k = 0; k < QUIET; k++)
            drive(k, false);
        for (unsigned k = 0; k < EVENT; k++) {
            drive(QUIET + k, true);
            told += (report.reasons &
                     (PLR_REASON_SCENE_DISAGREES | PLR_REASON_TWIST_CONTRADICTED)) != 0;
        }
        near += error_m() < 0.8;
        TEST_ASSERT_GREATER_THAN_UINT(EVENT * 8 / 10, told);
    }
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(4, near);
}

/* What the convoy does while all points stand again is not held against the pose. */
static void test_it_is_good_again_when_all_stand(void) {
    begin(7);
    for (unsigned k = 0; k < QUIET; k++)
        drive(k, false);
    for (unsigned k = 0; k < EVENT; k++)
        drive(QUIET + k, true);
    unsigned good = 0;
    for (unsigned k = 0; k < 100; k++) {
        drive(QUIET + EVENT + k, false);
        good += report.health == PLR_HEALTH_GOOD;
    }
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, report.health);
    TEST_ASSERT_GREATER_THAN_UINT(10, good);
}
