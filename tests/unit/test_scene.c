// SPDX-License-Identifier: MIT
/* Whether what is seen agrees with itself (MATH 17): noise does, and so does what is usual on a drive. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "filter/scene.h"
#include "support/random.h"

static plr_filter filter;
static rng chance;

void setUp(void) {
    chance = rng_seeded(67);
    plr_scene_clear(&filter);
}

/* Of the rejected ones `again` were rejected before. */
static plr_scene_verdict add_of(unsigned matched, unsigned rejected, unsigned again, double nis) {
    plr_report report;
    memset(&report, 0, sizeof report);
    report.matched = (uint16_t)matched;
    report.gated = (uint16_t)rejected;
    report.gated_again = (uint16_t)again;
    report.nis = (float)nis;
    return plr_scene_add(&filter, &report);
}

static plr_scene_verdict add(unsigned matched, unsigned rejected, double nis) {
    return add_of(matched, rejected, rejected, nis);
}

/* A frame of 20 points with noise as it is stated: `again` are rejected again, and of the others this share
 * for once. */
static plr_scene_verdict add_matches(unsigned again, double wrong) {
    unsigned rejected = again;
    double nis = 0;
    for (unsigned i = again; i < 20; i++) {
        double e[4];
        const bool outlier = rng_uniform(&chance, 0, 1) < wrong;
        rng_normals(&chance, 1, e, 4);
        if (!outlier)
            nis += e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3];
        rejected += outlier;
    }
    return add_of(20, rejected, again, nis);
}

static plr_scene_verdict add_noise(unsigned again) {
    return add_matches(again, 0.01);
}

static unsigned told_of_noise(unsigned frames, unsigned rejected) {
    unsigned told = 0;
    for (unsigned k = 0; k < frames; k++)
        told += add_noise(rejected) != PLR_SCENE_AGREES;
    return told;
}

static void test_noise_agrees(void) {
    TEST_ASSERT_LESS_OR_EQUAL_UINT(20, told_of_noise(10000, 0));
}

static void test_some_more_that_are_rejected_again_are_told(void) {
    told_of_noise(200, 0);
    (void)add_noise(4);
    TEST_ASSERT_EQUAL_INT(PLR_SCENE_WORSE, add_noise(4));
}

static void test_worse_fits_without_a_rejection_are_told(void) {
    told_of_noise(200, 0);
    TEST_ASSERT_EQUAL_INT(PLR_SCENE_WORSE, add(20, 0, 3 * 80));
}

static void test_bad_tracks_that_last_become_usual(void) {
    told_of_noise(200, 0);
    TEST_ASSERT_GREATER_THAN_UINT(2, told_of_noise(100, 4));
    TEST_ASSERT_EQUAL_UINT(0, told_of_noise(100, 4));
}

/* The limit goes by the deviation of what was seen. */
static void test_bad_tracks_that_come_and_go_become_usual(void) {
    unsigned told = 0;
    for (unsigned k = 0; k < 20; k++) {
        told = told_of_noise(10, 0);
        told += told_of_noise(10, 4);
    }
    TEST_ASSERT_EQUAL_UINT(0, told);
}

/* The rejections say how many are off, whatever they are said to be off by. */
static void test_three_tenths_may_be_rejected_again_and_no_more_however_usual_that_is(void) {
    for (unsigned k = 0; k < 300; k++)
        (void)add(100, 29, 4 * 71);
    TEST_ASSERT_EQUAL_INT(PLR_SCENE_AGREES, add(100, 29, 4 * 71));
    for (unsigned k = 0; k < 300; k++)
        (void)add(100, 31, 4 * 69);
    TEST_ASSERT_EQUAL_INT(PLR_SCENE_SPLIT, add(100, 31, 4 * 69));
}

/* A match that is wrong for one frame is no scene that moves. */
static void test_wrong_matches_say_nothing_unless_they_are_most_of_a_frame(void) {
    unsigned told = 0;
    for (unsigned k = 0; k < 10000; k++)
        told += add_matches(0, 0.3) != PLR_SCENE_AGREES;
    TEST_ASSERT_LESS_OR_EQUAL_UINT(20, told);
    plr_scene_clear(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_SCENE_AGREES, add_of(100, 59, 0, 4 * 41));
    plr_scene_clear(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_SCENE_SPLIT, add_of(100, 61, 0, 4 * 39));
}

static void test_few_matches_are_not_judged(void) {
    for (unsigned k = 0; k < 100; k++)
        TEST_ASSERT_EQUAL_INT(PLR_SCENE_AGREES, add(3, 3, 0)); /* their sum tends to 10 */
    TEST_ASSERT_EQUAL_INT(PLR_SCENE_SPLIT, add(4, 4, 0));
}

/* Of few points noise alone does much: only the share of three tenths counts. */
static void test_few_matches_are_not_held_against_what_is_usual(void) {
    for (unsigned k = 0; k < 300; k++)
        TEST_ASSERT_EQUAL_INT(PLR_SCENE_AGREES, add(8, 0, 8 * 3));
    TEST_ASSERT_EQUAL_INT(PLR_SCENE_AGREES, add(8, 1, 8 * 12));
}

static void test_of_a_frame_without_matches_nothing_is_said(void) {
    TEST_ASSERT_EQUAL_INT(PLR_SCENE_SPLIT, add(100, 100, 0));
    TEST_ASSERT_EQUAL_INT(PLR_SCENE_AGREES, add(0, 0, 0));
}

static void test_the_noise_settings_are_judged_by_eighty_degrees_of_freedom(void) {
    (void)add(20, 0, 1.61 * 80);
    TEST_ASSERT_EQUAL_HEX32(0, plr_scene_noise_reasons(&filter)); /* 80, and not more */
    (void)add(20, 0, 1.61 * 80);
    TEST_ASSERT_EQUAL_HEX32(PLR_REASON_NIS_HIGH, plr_scene_noise_reasons(&filter));
    (void)add(20, 0, 1.4 * 80);
    TEST_ASSERT_EQUAL_HEX32(0, plr_scene_noise_reasons(&filter));
    plr_scene_clear(&filter);
    (void)add(21, 0, 0.29 * 84);
    TEST_ASSERT_EQUAL_HEX32(PLR_REASON_NIS_LOW, plr_scene_noise_reasons(&filter));
    (void)add(21, 0, 0.4 * 84);
    TEST_ASSERT_EQUAL_HEX32(0, plr_scene_noise_reasons(&filter));
}

/* Without a gate an innovation may be anything. */
static void test_an_innovation_without_measure_is_forgotten_as_others_are(void) {
    (void)add(20, 0, HUGE_VAL);
    TEST_ASSERT_EQUAL_HEX32(0, plr_scene_noise_reasons(&filter)); /* of 80 degrees of freedom */
    (void)add(20, 0, 1e38);
    TEST_ASSERT_EQUAL_HEX32(PLR_REASON_NIS_HIGH, plr_scene_noise_reasons(&filter));
    told_of_noise(300, 0);
    TEST_ASSERT_EQUAL_HEX32(0, plr_scene_noise_reasons(&filter));
    TEST_ASSERT_LESS_OR_EQUAL_UINT(2, told_of_noise(1000, 0));
}

/* Rejected ones have no part in it: neither their innovations nor their degrees of freedom. */
static void test_what_is_rejected_says_nothing_of_the_noise(void) {
    (void)add(100, 79, 84);
    TEST_ASSERT_EQUAL_HEX32(0, plr_scene_noise_reasons(&filter));
    (void)add(100, 79, 3 * 84);
    TEST_ASSERT_EQUAL_HEX32(PLR_REASON_NIS_HIGH, plr_scene_noise_reasons(&filter));
}
