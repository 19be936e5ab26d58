// SPDX-License-Identifier: MIT
/* Whether points agree with each other where they differ from the twists (MATH 17): those of wheels that
 * slip all lean to the same side, those of a scene of which a part moves do not. */
#include <math.h>
#include <unity.h>

#include "filter/dissent.h"
#include "filter/tracks.h"
#include "support/random.h"
#include "support/specimens.h"

enum { POINTS = 20, FRAMES = 60 };

static plr_filter filter;
static plr_dissent dissent;
static rng chance;
static const plr_real alone[6] = {1, 0, 0, 1, 0, 1}; /* predicted by the others without doubt */

void setUp(void) {
    chance = rng_seeded(91);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, false, 4);
    plr_consistency_window *w = &filter.consistency.windows[1];
    w->sum[0] = 20; /* of 5 frames; V is the identity: the pictures know the motion well */
    for (unsigned k = 0, at = 0; k < 6; at += 6 - k, k++)
        w->variance[at] = 5;
    plr_dissent_begin(&filter, &dissent);
}

/* A point whose innovations lean by `lean` a frame along the first axis, in its sigmas, where n says
 * `expected`. */
static plr_slot track(double lean) {
    plr_slot slot = {0};
    for (int k = 0; k < FRAMES; k++) {
        plr_real e[3];
        for (int r = 0; r < 3; r++)
            e[r] = (plr_real)(rng_normal(&chance) + (r == 0 ? lean : 0));
        plr_track_add(&slot, e);
    }
    return slot;
}

static void add(double lean, double expected, const plr_real M[6]) {
    const plr_slot slot = track(lean);
    const plr_real a[18] = {(plr_real)expected};
    plr_dissent_add(&dissent, &slot, a, M);
}

static void test_points_that_all_lean_agree(void) {
    for (int i = 0; i < POINTS; i++)
        add(1, 1, alone);
    TEST_ASSERT_FALSE(plr_dissent_is_found(&dissent));
}

/* Landmarks follow their points, and lag: how far they lean together is not known beforehand. */
static void test_by_how_much_does_not_matter(void) {
    for (int i = 0; i < POINTS; i++)
        add(0.3, 1, alone);
    TEST_ASSERT_FALSE(plr_dissent_is_found(&dissent));
}

static void test_near_points_lean_more_than_far_ones(void) {
    for (int i = 0; i < POINTS; i++)
        add(i % 2 ? 1.4 : 0.07, i % 2 ? 1 : 0.05, alone);
    TEST_ASSERT_FALSE(plr_dissent_is_found(&dissent));
}

static void test_points_of_which_a_part_leans_do_not_agree(void) {
    for (int i = 0; i < POINTS; i++)
        add(i < 12 ? 1 : -0.3, 1, alone);
    TEST_ASSERT_TRUE(plr_dissent_is_found(&dissent));
}

static void test_noise_agrees(void) {
    unsigned found = 0;
    for (int drive = 0; drive < 2000; drive++) {
        plr_dissent_begin(&filter, &dissent);
        for (int i = 0; i < POINTS; i++)
            add(0, 1, alone);
        found += plr_dissent_is_found(&dissent);
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT(4, found); /* chi-square of 19 above 50: once in 7,000 */
}

/* A near point knows the motion better than all others together: they cannot say how it should lean. */
static void test_a_point_that_the_others_cannot_predict_has_no_voice(void) {
    static const plr_real unsure[6] = {20, 0, 0, 20, 0, 20};
    for (int i = 0; i < POINTS; i++)
        add(i < 17 ? 1 : 0, i < 17 ? 1 : 3, i < 17 ? alone : unsure);
    TEST_ASSERT_FALSE(plr_dissent_is_found(&dissent));
}

static void test_few_points_say_little_about_each_other(void) {
    for (int i = 0; i < 5; i++)
        add(i < 3 ? 2 : -2, 1, alone);
    TEST_ASSERT_FALSE(plr_dissent_is_found(&dissent));
    add(-2, 1, alone);
    TEST_ASSERT_TRUE(plr_dissent_is_found(&dissent));
}

static void test_it_is_not_asked_where_twists_and_pictures_agree(void) {
    filter.consistency.windows[1].sum[0] = 5; /* chi-square 5 */
    plr_dissent_begin(&filter, &dissent);
    for (int i = 0; i < POINTS; i++)
        add(i < 12 ? 1 : -0.3, 1, alone);
    TEST_ASSERT_FALSE(plr_dissent_is_found(&dissent));
}

static void test_a_point_without_innovations_counts_for_nothing(void) {
    const plr_slot born = {0};
    const plr_real a[18] = {1}, nowhere[18] = {0};
    const plr_slot slot = track(1);
    plr_dissent_add(&dissent, &born, a, alone);
    plr_dissent_add(&dissent, &slot, nowhere, alone);
    TEST_ASSERT_EQUAL_UINT(0, dissent.points);
}

/* Among points that do not agree, a point moves by less evidence. */
static void test_a_doubted_track_moves_earlier(void) {
    plr_slot slot = {.innovation_sum = {5, 0, 0}, .innovation_variance = PLR_R(1.6)};
    const plr_real none[3] = {0};
    plr_slot same = slot;
    plr_track_add(&same, none);
    TEST_ASSERT_EQUAL_UINT8(0, same.moving);
    plr_track_doubt(&slot);
    TEST_ASSERT_EQUAL_UINT8(0, slot.moving); /* 15.6 */
    slot.innovation_sum[1] = 1;
    plr_track_doubt(&slot);
    TEST_ASSERT_EQUAL_UINT8(1, slot.moving); /* 16.3 */
}

/* 1 - 0.9^frames. */
static void test_the_share_of_a_track_grows_with_its_frames(void) {
    const plr_real e[3] = {0};
    plr_slot slot = {0};
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, (double)plr_track_share(&slot));
    for (int k = 1; k <= 200; k++) {
        plr_track_add(&slot, e);
        TEST_ASSERT_DOUBLE_WITHIN(2e-3, 1 - pow(0.9, k), (double)plr_track_share(&slot));
    }
}
