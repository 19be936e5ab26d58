// SPDX-License-Identifier: MIT
/* Health and its reasons from what happened in frames. */
#include <string.h>
#include <unity.h>

#include "filter/health.h"
#include "support/specimens.h"

static plr_filter filter;
static plr_frame_events events;
static plr_report report;

void setUp(void) {
    rng chance = rng_seeded(53);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, false, 4);
    filter.par.gate_d2 = PLR_R(13.3);
    memset(&events, 0, sizeof events);
}

void tearDown(void) {
}

/* A frame of `matched` matches of which `gated` were rejected, the rest used, with NIS at its mean. */
static void frame(unsigned matched, unsigned gated) {
    memset(&report, 0, sizeof report);
    report.matched = (uint16_t)matched;
    report.gated = (uint16_t)gated;
    report.used = (uint16_t)(matched - gated);
    report.nis_dof = (uint16_t)(4 * report.used);
    report.nis = (float)report.nis_dof;
}

static void judge(unsigned reasons, plr_health health) {
    plr_health_judge(&filter, &events, &report);
    TEST_ASSERT_EQUAL_HEX32(reasons, report.reasons);
    TEST_ASSERT_EQUAL_INT(health, report.health);
}

static void test_a_frame_with_enough_of_everything_is_good(void) {
    frame(20, 2);
    judge(0, PLR_HEALTH_GOOD);
    frame(3, 0);
    judge(0, PLR_HEALTH_GOOD);
}

static void test_fewer_than_three_used_degrade(void) {
    frame(2, 0);
    judge(PLR_REASON_FEW_OBSERVATIONS, PLR_HEALTH_DEGRADED);
    frame(9, 7);
    judge(PLR_REASON_FEW_OBSERVATIONS, PLR_HEALTH_DEGRADED);
}

static void test_ten_frames_without_one_used_are_lost(void) {
    for (int k = 0; k < 9; k++) {
        frame(0, 0);
        judge(PLR_REASON_FEW_OBSERVATIONS, PLR_HEALTH_DEGRADED);
    }
    frame(0, 0);
    judge(PLR_REASON_FEW_OBSERVATIONS | PLR_REASON_NO_OBSERVATIONS, PLR_HEALTH_LOST);
    frame(0, 0);
    judge(PLR_REASON_FEW_OBSERVATIONS | PLR_REASON_NO_OBSERVATIONS, PLR_HEALTH_LOST);
    frame(5, 0);
    judge(0, PLR_HEALTH_GOOD);
}

static void test_each_event_has_its_reason(void) {
    frame(10, 1);
    report.blocks_failed = 1;
    judge(PLR_REASON_BLOCK_FAILED, PLR_HEALTH_DEGRADED);
    frame(10, 1);
    report.refused = 1;
    judge(PLR_REASON_REFUSED_INPUT, PLR_HEALTH_DEGRADED);
    frame(10, 1);
    report.duplicates = 2;
    judge(PLR_REASON_REFUSED_INPUT, PLR_HEALTH_DEGRADED);
    frame(10, 1);
    report.left_out = 1;
    judge(PLR_REASON_BUDGET, PLR_HEALTH_DEGRADED);
    frame(10, 1);
    events.sink_failed = true;
    judge(PLR_REASON_SINK_FAILED, PLR_HEALTH_DEGRADED);
    events.sink_failed = false;
    frame(10, 1);
    events.cut = 3;
    judge(PLR_REASON_RANGE_LIMITED, PLR_HEALTH_DEGRADED);
    TEST_ASSERT_EQUAL_UINT32(3, filter.totals.range_limited);
    events.cut = 0;
    frame(10, 1);
    events.locked = true;
    judge(PLR_REASON_GATE_LOCKED, PLR_HEALTH_LOST);
    events.locked = false;
    frame(10, 1);
    report.no_room = 4; /* full slots are no fault */
    judge(PLR_REASON_NO_ROOM, PLR_HEALTH_GOOD);
}

static void test_innovations_above_twice_their_mean_degrade(void) {
    frame(10, 0);
    report.nis = 80;
    judge(0, PLR_HEALTH_GOOD);
    report.nis = 80.01F;
    judge(PLR_REASON_NIS_HIGH, PLR_HEALTH_DEGRADED);
    frame(4, 0); /* 16 degrees of freedom say too little */
    report.nis = 1000;
    judge(0, PLR_HEALTH_GOOD);
}

static void test_a_gate_that_rejects_none_of_a_thousand_is_inert(void) {
    for (int k = 0; k < 9; k++) {
        frame(100, 0);
        judge(0, PLR_HEALTH_GOOD);
    }
    frame(99, 0);
    judge(0, PLR_HEALTH_GOOD);
    frame(1, 0);
    report.used = 3; /* not what this test is about */
    judge(PLR_REASON_GATE_INERT, PLR_HEALTH_GOOD);
    frame(100, 0);
    judge(PLR_REASON_GATE_INERT, PLR_HEALTH_GOOD);
    frame(100, 1); /* one rejection: the count begins anew */
    judge(0, PLR_HEALTH_GOOD);
    frame(100, 0);
    judge(0, PLR_HEALTH_GOOD);
}

static void test_a_gate_that_is_off_is_not_inert(void) {
    filter.par.gate_d2 = 0;
    for (int k = 0; k < 12; k++) {
        frame(100, 0);
        judge(0, PLR_HEALTH_GOOD);
    }
    filter.par.gate_residual2 = PLR_R(900); /* but the other gate is on */
    frame(100, 0);
    judge(PLR_REASON_GATE_INERT, PLR_HEALTH_GOOD);
}

static void test_the_count_of_matches_cannot_overflow(void) {
    filter.matches_since_gated = UINT32_MAX / 2;
    for (int k = 0; k < 3; k++) {
        frame(100, 0);
        judge(PLR_REASON_GATE_INERT, PLR_HEALTH_GOOD);
    }
    TEST_ASSERT_LESS_THAN_UINT32(UINT32_MAX / 2, filter.matches_since_gated);
}

/* ---------------------------------------------------------------- the locked gate */

static bool is_locked(unsigned matched, unsigned gated) {
    frame(matched, gated);
    return plr_health_gate_is_locked(&filter, &report);
}

static void test_ten_frames_of_four_fifths_rejected_lock(void) {
    for (int k = 0; k < 9; k++)
        TEST_ASSERT_FALSE(is_locked(5, 4));
    TEST_ASSERT_TRUE(is_locked(5, 4));
    TEST_ASSERT_EQUAL_UINT32(1, filter.totals.locks);
}

static void test_after_a_lock_ten_more_lock_again(void) {
    for (int k = 0; k < 50; k++)
        TEST_ASSERT_EQUAL(k % 10 == 9, is_locked(20, 20));
    TEST_ASSERT_EQUAL_UINT32(5, filter.totals.locks);
}

static void test_a_fixed_gate_is_open_from_a_lock_until_a_frame_is_seen(void) {
    for (int k = 0; k < 25; k++) {
        TEST_ASSERT_EQUAL(k >= 10, plr_health_fixed_gate_is_open(&filter));
        (void)is_locked(20, 20);
    }
    (void)is_locked(20, 3);
    TEST_ASSERT_FALSE(plr_health_fixed_gate_is_open(&filter));
}

static void test_a_fixed_gate_is_open_after_ten_frames_without_use(void) {
    for (int k = 0; k < 12; k++) {
        TEST_ASSERT_EQUAL(k >= 10, plr_health_fixed_gate_is_open(&filter));
        frame(4, 4); /* too few to lock */
        plr_health_judge(&filter, &events, &report);
    }
    frame(4, 3);
    plr_health_judge(&filter, &events, &report);
    TEST_ASSERT_FALSE(plr_health_fixed_gate_is_open(&filter));
}

static void test_a_frame_below_the_limits_breaks_the_row(void) {
    static const unsigned harmless[3][2] = {{4, 4}, {10, 7}, {0, 0}};
    for (int which = 0; which < 3; which++) {
        for (int k = 0; k < 9; k++)
            TEST_ASSERT_FALSE(is_locked(10, 8));
        TEST_ASSERT_FALSE(is_locked(harmless[which][0], harmless[which][1]));
        TEST_ASSERT_FALSE(is_locked(10, 8));
        TEST_ASSERT_FALSE(is_locked(0, 0)); /* and begin anew */
    }
    TEST_ASSERT_EQUAL_UINT32(0, filter.totals.locks);
}

/* ---------------------------------------------------------------- refusals and totals */

static void test_a_refused_frame_says_whether_the_filter_is_broken(void) {
    memset(&report, 0, sizeof report);
    plr_health_after_refusal(&filter, &report);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DEGRADED, report.health);
    TEST_ASSERT_EQUAL_HEX32(0, report.reasons);
    TEST_ASSERT_EQUAL_UINT16(4, report.active);
    filter.diverged = 1;
    plr_health_after_refusal(&filter, &report);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DIVERGED, report.health);
    TEST_ASSERT_EQUAL_HEX32(PLR_REASON_NOT_POSITIVE, report.reasons);
}

static void test_totals_are_the_sums_of_the_reports(void) {
    const plr_totals before = filter.totals;
    const plr_report one = {.observations = 11,
                            .matched = 10,
                            .used = 7,
                            .gated = 2,
                            .created = 3,
                            .evicted = 5,
                            .blocks_failed = 1};
    plr_health_count(&filter, &one);
    plr_health_count(&filter, &one);
    TEST_ASSERT_EQUAL_UINT64(before.observations + 22, filter.totals.observations);
    TEST_ASSERT_EQUAL_UINT64(before.matched + 20, filter.totals.matched);
    TEST_ASSERT_EQUAL_UINT64(before.used + 14, filter.totals.used);
    TEST_ASSERT_EQUAL_UINT64(before.gated + 4, filter.totals.gated);
    TEST_ASSERT_EQUAL_UINT64(before.created + 6, filter.totals.created);
    TEST_ASSERT_EQUAL_UINT64(before.evicted + 10, filter.totals.evicted);
    TEST_ASSERT_EQUAL_UINT32(before.blocks_failed + 2, filter.totals.blocks_failed);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_a_frame_with_enough_of_everything_is_good);
    RUN_TEST(test_fewer_than_three_used_degrade);
    RUN_TEST(test_ten_frames_without_one_used_are_lost);
    RUN_TEST(test_each_event_has_its_reason);
    RUN_TEST(test_innovations_above_twice_their_mean_degrade);
    RUN_TEST(test_a_gate_that_rejects_none_of_a_thousand_is_inert);
    RUN_TEST(test_a_gate_that_is_off_is_not_inert);
    RUN_TEST(test_the_count_of_matches_cannot_overflow);
    RUN_TEST(test_ten_frames_of_four_fifths_rejected_lock);
    RUN_TEST(test_after_a_lock_ten_more_lock_again);
    RUN_TEST(test_a_fixed_gate_is_open_from_a_lock_until_a_frame_is_seen);
    RUN_TEST(test_a_fixed_gate_is_open_after_ten_frames_without_use);
    RUN_TEST(test_a_frame_below_the_limits_breaks_the_row);
    RUN_TEST(test_a_refused_frame_says_whether_the_filter_is_broken);
    RUN_TEST(test_totals_are_the_sums_of_the_reports);
    return UNITY_END();
}
