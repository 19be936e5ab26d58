// SPDX-License-Identifier: MIT
/* From a deadline to a number of observations, on a machine whose cost is known. */
#include <unity.h>

#include "session/budget.h"

static plr_budget budget;

/* A frame on a machine that needs fixed_us + each_us n; returns what it took. */
static unsigned run_frame(unsigned fixed_us, unsigned each_us, unsigned seen) {
    const unsigned allowed = plr_budget_next(&budget);
    const unsigned used = seen < allowed ? seen : allowed;
    const unsigned us = fixed_us + each_us * used;
    plr_budget_learn(&budget, 1000u * us, used);
    return us;
}

static void test_without_a_deadline_there_is_no_limit(void) {
    plr_budget_init(&budget, 0);
    plr_budget_learn(&budget, 1000000000, 1);
    TEST_ASSERT_EQUAL_UINT16(PLR_NO_BUDGET, plr_budget_next(&budget));
}

static void test_the_first_frame_may_use_one_block(void) {
    plr_budget_init(&budget, 2000);
    TEST_ASSERT_EQUAL_UINT16(PLR_BLOCK_OBSERVATIONS, plr_budget_next(&budget));
}

static void test_the_budget_settles_where_the_deadline_is_just_kept(void) {
    plr_budget_init(&budget, 2000);
    unsigned us = 0;
    for (int frame = 0; frame < 200; frame++)
        us = run_frame(500, 50, 100);
    TEST_ASSERT_TRUE(us <= 2000);
    TEST_ASSERT_UINT16_WITHIN(2, 30, plr_budget_next(&budget)); /* (2000 - 500) / 50 */
}

static void test_the_second_dearer_frame_lowers_the_budget_at_once(void) {
    plr_budget_init(&budget, 1000);
    for (int frame = 0; frame < 200; frame++)
        run_frame(0, 10, 100);
    const unsigned before = plr_budget_next(&budget);
    run_frame(0, 20, 100);
    TEST_ASSERT_EQUAL_UINT16(before, plr_budget_next(&budget)); /* might have been interrupted */
    run_frame(0, 20, 100);
    TEST_ASSERT_TRUE(plr_budget_next(&budget) <= before / 2 + 1);
    TEST_ASSERT_TRUE(run_frame(0, 20, 100) <= 1000);
}

static void test_a_single_interruption_changes_nothing(void) {
    plr_budget_init(&budget, 1000);
    for (int frame = 0; frame < 100; frame++)
        run_frame(0, 10, 100);
    const unsigned before = plr_budget_next(&budget);
    plr_budget_learn(&budget, UINT64_C(3600000000000), 10); /* an hour: a clock that jumped */
    TEST_ASSERT_EQUAL_UINT16(before, plr_budget_next(&budget));
}

static void test_frames_that_all_miss_the_deadline_leave_one_observation_and_recover(void) {
    plr_budget_init(&budget, 1000);
    for (int frame = 0; frame < 10; frame++)
        run_frame(5000, 10, 100);
    TEST_ASSERT_EQUAL_UINT16(1, plr_budget_next(&budget));
    for (int frame = 0; frame < 60; frame++)
        run_frame(0, 10, 100);
    TEST_ASSERT_UINT16_WITHIN(2, 99, plr_budget_next(&budget));
}

static void test_a_stalled_clock_and_an_unused_frame_teach_nothing(void) {
    plr_budget_init(&budget, 1000);
    plr_budget_learn(&budget, 0, 20);
    plr_budget_learn(&budget, 500000, 0);
    TEST_ASSERT_EQUAL_UINT16(PLR_BLOCK_OBSERVATIONS, plr_budget_next(&budget));
}

static void test_the_budget_never_reads_as_no_limit(void) {
    plr_budget_init(&budget, UINT32_MAX);
    plr_budget_learn(&budget, 1, 1000);
    TEST_ASSERT_EQUAL_UINT16(PLR_NO_BUDGET - 1, plr_budget_next(&budget));
}
