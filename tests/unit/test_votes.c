// SPDX-License-Identifier: MIT
/* Points are asked whether twists or pictures are right (MATH 17): of a robot whose twists say 0.2 m a
 * frame and whose pictures say 0.04 m. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "filter/consistency.h"
#include "filter/trial.h"
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

/* Frames in which the pictures' motion goes to and fro along an axis, by so many m or rad. */
static void toss(unsigned axis, double by, unsigned frames) {
    for (unsigned k = 0; k < frames; k++) {
        moved[axis] = (plr_real)(k % 2 ? by : -by);
        look();
    }
}

/* One frame without a match. */
static bool look_at_nothing(void) {
    const plr_frame frame = {0, PLR_NO_BUDGET, 0, NULL};
    filter.frame_number++;
    return plr_votes_add(&filter, &frame, 0, &believed, &applied, &correction, moved);
}

static void demand_that_each_is_asked_once(void) {
    for (unsigned t = 0; t < PLR_TRIALS; t++)
        for (unsigned i = 0; i < COUNT && filter.own.votes.trials[t].frames > 0; i++)
            for (unsigned other = 0; other < t; other++)
                TEST_ASSERT_FALSE(plr_trial_is_of(&filter.own.votes.trials[t], seen[i].id) &&
                                  plr_trial_is_of(&filter.own.votes.trials[other], seen[i].id));
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

/* Where most points go a third way, the pictures are wrong for sure, and the twists not right for it. */
static void test_nothing_is_decided_while_most_fit_neither(void) {
    filter.own.votes.voter_count = PLR_VOTERS;
    filter.own.votes.counts[PLR_VOTE_TWISTS] = 4;
    filter.own.votes.counts[PLR_VOTE_NEITHER] = 6;
    TEST_ASSERT_FALSE(look_at_nothing());
    TEST_ASSERT_FALSE(plr_votes_trust_twists(&filter));
    filter.own.votes.counts[PLR_VOTE_NEITHER] = 3;
    TEST_ASSERT_TRUE(look_at_nothing());
}

/* Pictures that toss the pose to and fro lead nowhere: points that stand contradict each step. */
static void test_nothing_is_decided_while_the_pictures_lead_nowhere(void) {
    place(COUNT, 0, 12);
    for (unsigned k = 0; k < 40; k++) {
        moved[2] = PLR_R(k % 2 ? 0.3 : -0.3);
        TEST_ASSERT_EQUAL(k < 3 ? false : plr_votes_trust_twists(&filter), look());
    }
    TEST_ASSERT_GREATER_THAN_DOUBLE(2.5, (double)filter.own.votes.voter_count);
    TEST_ASSERT_FALSE(plr_votes_trust_twists(&filter));
}

/* While the twists are trusted a contradiction is taken back at once, however the pictures toss. */
static void test_while_trusted_a_contradiction_is_taken_back_at_once(void) {
    filter.consistency.contradicted = 0;
    filter.own.votes.trusted_frames = 50;
    filter.own.votes.voter_count = PLR_VOTERS;
    filter.own.votes.counts[PLR_VOTE_TWISTS] = 1;
    for (unsigned k = 0; k < 10; k++) {
        moved[2] = PLR_R(k % 2 ? 0.3 : -0.3);
        TEST_ASSERT_FALSE(look_at_nothing());
    }
    filter.consistency.contradicted = 1;
    TEST_ASSERT_TRUE(look_at_nothing());
}

/* A tenth of the votes keeps the pictures' six from ending it. */
static void test_a_share_for_the_twists_keeps_them_trusted(void) {
    filter.consistency.contradicted = 0;
    filter.own.votes.trusted_frames = 50;
    filter.own.votes.voter_count = 2;
    filter.own.votes.counts[PLR_VOTE_TWISTS] = 2;
    filter.own.votes.counts[PLR_VOTE_PICTURES] = 10;
    look_at_nothing();
    TEST_ASSERT_TRUE(plr_votes_trust_twists(&filter));
    filter.own.votes.counts[PLR_VOTE_PICTURES] = 30;
    look_at_nothing();
    TEST_ASSERT_FALSE(plr_votes_trust_twists(&filter));
}

/* Votes of long ago keep their share as they fade: they trusted the twists for ever once. */
static void test_trust_ends_a_hundred_frames_after_the_last_vote(void) {
    place(5, PICTURES_M, 12);
    TEST_ASSERT_GREATER_THAN_UINT(0, until_verdict(40));
    filter.consistency.contradicted = 0;
    for (unsigned k = 0; k < 99; k++) {
        look_at_nothing();
        TEST_ASSERT_TRUE(plr_votes_trust_twists(&filter));
    }
    look_at_nothing();
    TEST_ASSERT_FALSE(plr_votes_trust_twists(&filter));
}

static void test_votes_fade(void) {
    filter.own.votes.counts[PLR_VOTE_PICTURES] = 4;
    for (unsigned k = 0; k < 50; k++)
        look_at_nothing();
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 4 * pow(0.98, 50),
                              (double)filter.own.votes.counts[PLR_VOTE_PICTURES]);
}

/* Points that cannot decide make room for others. */
static void test_all_points_have_their_turn(void) {
    bool asked[COUNT] = {false};
    place(COUNT, 0, 400);
    memset(moved, 0, sizeof moved);
    for (unsigned k = 0; k < 200; k++) {
        TEST_ASSERT_FALSE(look());
        demand_that_each_is_asked_once();
        for (unsigned i = 0; i < COUNT; i++)
            for (unsigned t = 0; t < PLR_TRIALS; t++)
                asked[i] = asked[i] || plr_trial_is_of(&filter.own.votes.trials[t], seen[i].id);
    }
    for (unsigned i = 0; i < COUNT; i++)
        TEST_ASSERT_TRUE(asked[i]);
}

static void test_a_point_out_of_sight_makes_room(void) {
    place(COUNT, 0, 12);
    look();
    look_at_nothing();
    for (unsigned t = 0; t < PLR_TRIALS; t++)
        TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.own.votes.trials[t].frames);
}

static void test_points_of_a_map_are_not_asked(void) {
    place(COUNT, 0, 12);
    for (unsigned i = 0; i < COUNT; i++)
        filter.slots[i].known = 1;
    look();
    for (unsigned t = 0; t < PLR_TRIALS; t++)
        TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.own.votes.trials[t].frames);
}

/* Nobody is left out before the verdict. After it those who vote otherwise are, until one votes for the
 * twists again. */
static void test_who_moves_is_left_out_while_the_twists_are_trusted(void) {
    unsigned left_out = 0;
    place(5, PICTURES_M, 14);
    while (!look()) {
        demand_that_each_is_asked_once();
        for (unsigned i = 0; i < COUNT; i++)
            TEST_ASSERT_EQUAL_UINT8(0, filter.slots[i].moving);
    }
    for (unsigned i = 0; i < 5; i++)
        filter.slots[i].moving = 1;
    for (unsigned k = 0; k < 25; k++)
        look();
    for (unsigned i = 0; i < COUNT; i++)
        left_out += filter.slots[i].moving;
    TEST_ASSERT_LESS_THAN_UINT(5, filter.slots[0].moving + filter.slots[1].moving +
                                      filter.slots[2].moving + filter.slots[3].moving +
                                      filter.slots[4].moving);
    TEST_ASSERT_GREATER_THAN_UINT(5, left_out);
}

/* The pictures' turn may be noise while their way is right. */
static void test_the_pictures_way_counts_with_the_twists_turn(void) {
    place(0, PICTURES_M, 12);
    toss(4, 0.02, 40);
    TEST_ASSERT_GREATER_THAN_DOUBLE(2, (double)filter.own.votes.counts[PLR_VOTE_PICTURES]);
}

/* When wheels grip again the pictures' way changes at once, and its mean does not. */
static void test_the_end_of_a_slip_is_no_vote_for_the_twists(void) {
    for (unsigned frames = 4; frames <= 12; frames++) {
        setUp();
        place(0, PICTURES_M, 6);
        for (unsigned k = 0; k < frames; k++)
            TEST_ASSERT_FALSE(look());
        for (unsigned i = 0; i < COUNT; i++)
            spots[i].step_m = WAY_M;
        memset(moved, 0, sizeof moved);
        TEST_ASSERT_EQUAL_UINT(0, until_verdict(15));
        TEST_ASSERT_LESS_THAN_DOUBLE(0.5, (double)filter.own.votes.counts[PLR_VOTE_TWISTS]);
    }
}

/* Where distant points toss the pictures' way to and fro, nobody takes that for the twists' being right. */
static void test_steps_to_and_fro_are_no_votes_for_the_twists(void) {
    place(0, PICTURES_M, 6);
    toss(0, 0.05, 60);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.5, (double)filter.own.votes.counts[PLR_VOTE_TWISTS]);
    TEST_ASSERT_GREATER_THAN_DOUBLE(2, (double)filter.own.votes.counts[PLR_VOTE_PICTURES]);
}

/* Noise of either motion that explains the difference: nobody votes. */
static void test_noise_of_either_motion_leaves_it_open(void) {
    plr_real *const noise[2] = {believed.L, applied.JL};
    for (unsigned which = 0; which < 2; which++) {
        setUp();
        place(5, PICTURES_M, 12);
        noise[which][14] = PLR_R(2); /* m */
        TEST_ASSERT_EQUAL_UINT(0, until_verdict(10));
        for (unsigned i = 0; i < PLR_VOTE_OPEN; i++)
            TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.own.votes.counts[i]);
    }
}

/* The difference is a twist of the body, and turns with it. */
static void test_the_difference_turns_with_the_body(void) {
    const plr_real quarter[9] = {-1, 0, 1, 0, 0, 0, -1, 0, -1}; /* about y, less the identity */
    look_at_nothing();
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, PICTURES_M - WAY_M, (double)filter.own.votes.difference[2]);
    memcpy(applied.E, quarter, sizeof quarter);
    memset(applied.p, 0, sizeof applied.p);
    memset(moved, 0, sizeof moved);
    look_at_nothing();
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, WAY_M - PICTURES_M, (double)filter.own.votes.difference[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, (double)filter.own.votes.difference[2]);
}

/* The windows speak of a contradiction after three frames, but not against trusted twists. */
static void test_no_majority_contradicts_trusted_twists(void) {
    const plr_real nu[6] = {0, 0, -50, 0, 0, 0};
    plr_real Lambda[PLR_POSE_TRIANGLE] = {0};
    for (unsigned k = 0; k < 6; k++)
        Lambda[plr_upper_row(6, k)] = 1000;
    for (unsigned trusted = 0; trusted < 2; trusted++) {
        plr_consistency_clear(&filter);
        filter.own.votes.trusted_frames = (plr_real)(50 * trusted);
        for (unsigned k = 0; k < 5; k++)
            plr_consistency_add(&filter, &believed, &applied, nu, Lambda, moved, NULL, false);
        TEST_ASSERT_EQUAL(!trusted, filter.consistency.contradicted);
    }
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
