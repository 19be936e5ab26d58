// SPDX-License-Identifier: MIT
/* Which points may exclude the odometry. */
#include <unity.h>

#include "supervise/exclusion.h"

static plr_exclusion_evidence all;

void setUp(void) {
    all = (plr_exclusion_evidence){0};
}

/* Adds n points of squared residual d2 at the motion found, and by_odometry_d2 with the odometry. */
static void add(unsigned n, double d2, double by_odometry_d2, double tells) {
    const plr_excluding_point point = {.active = 1,
                                       .weight = d2 > 9 ? PLR_R(0.1) : PLR_R(1),
                                       .d2 = (plr_real)d2,
                                       .by_odometry_d2 = (plr_real)by_odometry_d2,
                                       .tells = (plr_real)tells};
    for (unsigned i = 0; i < n; i++)
        plr_exclusion_add(0, &all, &point);
}

static void test_points_that_fit_give_no_reason_to_search_again(void) {
    add(20, 1, 0, 1);
    add(2, 100, 0, 1);
    TEST_ASSERT_EQUAL_INT(PLR_MISFIT_NONE, plr_exclusion_misfit(0, &all, 1));
}

static void test_many_misfits_or_a_motion_far_from_the_odometry_do(void) {
    add(10, 1, 0, 1);
    add(10, 100, 0, 1);
    TEST_ASSERT_EQUAL_INT(PLR_MISFIT_MANY, plr_exclusion_misfit(0, &all, 1));
    setUp();
    add(20, 1, 0, 1);
    add(3, 10, 0, 1);
    TEST_ASSERT_EQUAL_INT(PLR_MISFIT_MANY, plr_exclusion_misfit(0, &all, 37));
    TEST_ASSERT_EQUAL_INT(PLR_MISFIT_NONE, plr_exclusion_misfit(0, &all, 35));
}

static void test_few_near_points_count_against_many_distant_ones(void) {
    add(20, 1, 0, 0.1);
    add(3, 10, 0, 1);
    TEST_ASSERT_EQUAL_INT(PLR_MISFIT_FEW, plr_exclusion_misfit(0, &all, 1));
}

static void test_most_points_agree_from_three_fifths_on(void) {
    add(6, 1, 0, 1);
    add(4, 100, 0, 1);
    TEST_ASSERT_TRUE(plr_exclusion_most_agree(&all));
    add(1, 100, 0, 1);
    TEST_ASSERT_FALSE(plr_exclusion_most_agree(&all));
}

static void test_points_exclude_the_odometry_four_against_one(void) {
    add(12, 1, 50, 1);
    add(3, 50, 1, 1);
    TEST_ASSERT_TRUE(plr_exclusion_has_support(0, &all, PLR_MISFIT_MANY));
    add(1, 50, 1, 1);
    TEST_ASSERT_FALSE(plr_exclusion_has_support(0, &all, PLR_MISFIT_MANY));
}

static void test_a_point_that_fits_both_motions_supports_neither(void) {
    add(20, 1, 5, 1);
    TEST_ASSERT_EQUAL_UINT(0, all.against);
    TEST_ASSERT_EQUAL_UINT(0, all.with);
    TEST_ASSERT_FALSE(plr_exclusion_has_support(0, &all, PLR_MISFIT_MANY));
}

static void test_of_three_to_five_all_must_agree(void) {
    add(5, 1, 50, 1);
    TEST_ASSERT_TRUE(plr_exclusion_has_support(0, &all, PLR_MISFIT_MANY));
    setUp();
    add(4, 1, 50, 1);
    add(1, 50, 60, 1);
    TEST_ASSERT_FALSE(plr_exclusion_has_support(0, &all, PLR_MISFIT_MANY));
    const uint64_t without = UINT64_C(1) << PLR_LIMIT_ALL_BELOW;
    TEST_ASSERT_TRUE(plr_exclusion_has_support(without, &all, PLR_MISFIT_MANY));
}

static void test_points_on_a_line_exclude_nothing(void) {
    TEST_ASSERT_TRUE(plr_exclusion_is_well_spread(0, PLR_R(0.2)));
    TEST_ASSERT_FALSE(plr_exclusion_is_well_spread(0, PLR_R(0.3)));
    const uint64_t without = UINT64_C(1) << PLR_LIMIT_WELL_SPREAD;
    TEST_ASSERT_TRUE(plr_exclusion_is_well_spread(without, PLR_R(0.3)));
}
