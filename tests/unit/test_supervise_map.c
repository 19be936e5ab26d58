// SPDX-License-Identifier: MIT
/* A known map that comes in sight, against the pose: a correction within both covariances agrees. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "supervise/map.h"
#include "support/random.h"

/* The pose is known to 0.1 m and 0.02 rad, and the map halves these variances. */
#define SIGMA_M   0.1
#define SIGMA_RAD 0.02

enum { FRAMES = 15 };

static plr_supervisor s;
static plr_map_evidence e;
static plr_map_verdict verdict;
static rng chance;

void setUp(void) {
    chance = rng_seeded(71);
    memset(&s, 0, sizeof s);
    memset(&e, 0, sizeof e);
    e.known = e.adopted = 10;
    e.R_WB[1] = -1; /* a quarter turn */
    e.R_WB[3] = e.R_WB[8] = 1;
    for (unsigned k = 0; k < 6; k++) {
        e.P_before[7 * k] = (plr_real)pow(k < 3 ? SIGMA_M : SIGMA_RAD, 2);
        e.P_after[7 * k] = e.P_before[7 * k] / 2;
    }
}

static void move(double sigmas_0, double sigmas_4) {
    e.moved[0] = (plr_real)(sigmas_0 * SIGMA_M / sqrt(2));
    e.moved[4] = (plr_real)(sigmas_4 * SIGMA_RAD / sqrt(2));
}

static void test_corrections_as_their_covariance_says_agree(void) {
    for (unsigned run = 0; run < 3000; run++) {
        for (unsigned k = 0; k < 6; k++)
            e.moved[k] = (plr_real)(rng_normal(&chance) * sqrt((double)e.P_after[7 * k]));
        plr_map_add(&s, &e, &verdict);
        TEST_ASSERT_FALSE(verdict.disagrees);
    }
}

static void test_more_than_six_sigmas_disagree_and_say_by_how_much_in_the_body(void) {
    move(5.9, 0);
    plr_map_add(&s, &e, &verdict);
    TEST_ASSERT_FALSE(verdict.disagrees);
    move(0, 6.2);
    plr_map_add(&s, &e, &verdict);
    TEST_ASSERT_TRUE(verdict.disagrees);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0, (double)verdict.n[0]);
    TEST_ASSERT_GREATER_THAN_DOUBLE(6.2 * SIGMA_RAD / sqrt(2), (double)verdict.n[4]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0, (double)verdict.n[3]);
    TEST_ASSERT_EQUAL_UINT8(0, s.map_frames);
}

/* What one frame hides in its noise, the sum of fifteen shows; what comes later is no map that comes in. */
static void test_fifteen_frames_are_summed_up_and_no_more(void) {
    unsigned frames = 0;
    move(3, 0);
    plr_map_add(&s, &e, &verdict);
    for (e.adopted = 0; !verdict.disagrees && frames < 100; frames++) {
        memcpy(e.P_before, e.P_after, sizeof e.P_before); /* nothing more is told */
        plr_map_add(&s, &e, &verdict);
    }
    TEST_ASSERT_LESS_THAN_UINT(4, frames);
    setUp();
    plr_map_add(&s, &e, &verdict);
    for (e.adopted = 0; s.map_frames > 0; frames++)
        plr_map_add(&s, &e, &verdict);
    move(100, 0);
    plr_map_add(&s, &e, &verdict);
    TEST_ASSERT_FALSE(verdict.disagrees);
}

static void test_few_that_come_in_are_no_map_and_a_contradiction_is_the_odometrys(void) {
    move(100, 0);
    e.adopted = 3;
    plr_map_add(&s, &e, &verdict);
    TEST_ASSERT_FALSE(verdict.disagrees);
    e.adopted = 4; /* of ten */
    plr_map_add(&s, &e, &verdict);
    TEST_ASSERT_FALSE(verdict.disagrees);
    e.adopted = 10;
    s.doubt = PLR_DOUBT_CONTRADICTED;
    plr_map_add(&s, &e, &verdict);
    TEST_ASSERT_FALSE(verdict.disagrees);
    s.doubt = PLR_DOUBT_SETTLING;
    plr_map_add(&s, &e, &verdict);
    TEST_ASSERT_TRUE(verdict.disagrees);
}

/* An error of the calibration shifts the pose by what the map then takes back. */
static void test_the_calibrations_part_is_allowed(void) {
    e.calibration[0] = (plr_real)pow(10 * SIGMA_M, 2);
    move(10, 0);
    plr_map_add(&s, &e, &verdict);
    TEST_ASSERT_FALSE(verdict.disagrees);
    e.calibration[0] = 0;
    plr_map_forget(&s);
    plr_map_add(&s, &e, &verdict);
    TEST_ASSERT_TRUE(verdict.disagrees);
}
