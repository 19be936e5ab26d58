// SPDX-License-Identifier: MIT
/* Health and its reasons from what happened in frames. */
#include <string.h>
#include <unity.h>

#include "filter/consistency.h"
#include "filter/health.h"
#include "filter/scene.h"
#include "process/process.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "support/specimens.h"

static plr_filter filter;
static plr_frame_events events;
static plr_report report;

void setUp(void) {
    rng chance = rng_seeded(53);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, false, 4);
    filter.par.gate_d2 = PLR_R(13.3);
    filter.reading_ns = filter.t_ns; /* a twist came just now */
    filter.reading_valid = 1;
    filter.interval_s = PLR_R(0.01);
    memset(&events, 0, sizeof events);
}

/* A frame of `matched` matches of which `gated` were rejected again, the rest used, with NIS at its mean. */
static void frame(unsigned matched, unsigned gated) {
    memset(&report, 0, sizeof report);
    report.matched = (uint16_t)matched;
    report.gated = report.gated_again = (uint16_t)gated;
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
    frame(4, 2);
    judge(PLR_REASON_FEW_OBSERVATIONS, PLR_HEALTH_DEGRADED);
}

/* Once all is well again it is well only after so many frames, one after the other. */
static void demand_settling(void) {
    for (int k = 1; k < 15; k++) {
        frame(5, 0);
        judge(PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_DEGRADED);
    }
    frame(5, 0);
    judge(0, PLR_HEALTH_GOOD);
}

static void test_ten_frames_without_one_used_are_lost(void) {
    const unsigned lost = PLR_REASON_FEW_OBSERVATIONS | PLR_REASON_NO_OBSERVATIONS;
    for (int k = 0; k < 9; k++) {
        frame(0, 0);
        judge(PLR_REASON_FEW_OBSERVATIONS, PLR_HEALTH_DEGRADED);
    }
    frame(0, 0);
    judge(lost | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_LOST);
    frame(0, 0);
    judge(lost | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_LOST);
    demand_settling();
}

static void wait_ms(unsigned milliseconds) {
    filter.t_ns += milliseconds * UINT64_C(1000000);
    filter.reading_ns = filter.t_ns;
}

/* Frames may come slowly: then a second is what counts. */
static void test_a_second_without_one_used_is_lost(void) {
    frame(10, 1);
    judge(0, PLR_HEALTH_GOOD);
    wait_ms(1000);
    frame(0, 0);
    judge(PLR_REASON_FEW_OBSERVATIONS, PLR_HEALTH_DEGRADED);
    wait_ms(1);
    frame(0, 0);
    judge(PLR_REASON_FEW_OBSERVATIONS | PLR_REASON_NO_OBSERVATIONS | PLR_REASON_POSE_MAY_BE_WRONG,
          PLR_HEALTH_LOST);
    demand_settling();
}

static void test_a_bad_frame_begins_the_settling_anew(void) {
    frame(10, 1);
    events.locked = true;
    judge(PLR_REASON_GATE_LOCKED | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_LOST);
    events.locked = false;
    for (int k = 0; k < 14; k++) {
        frame(5, 0);
        judge(PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_DEGRADED);
    }
    frame(2, 0);
    judge(PLR_REASON_FEW_OBSERVATIONS | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_DEGRADED);
    demand_settling();
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
    report.no_room = 4; /* full slots are no fault */
    judge(PLR_REASON_NO_ROOM, PLR_HEALTH_GOOD);
    frame(10, 1);
    events.recovered = true;
    judge(PLR_REASON_NOT_POSITIVE | PLR_REASON_RECOVERED, PLR_HEALTH_DEGRADED);
    events.recovered = false;
    frame(10, 1);
    events.locked = true;
    judge(PLR_REASON_GATE_LOCKED | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_LOST);
    events.locked = false;
    demand_settling();
}

static void test_missing_and_refused_twists_degrade(void) {
    filter.t_ns += 79900000; /* 50 ms and three times the 10 ms in which they come: 80 */
    frame(10, 1);
    judge(0, PLR_HEALTH_GOOD);
    filter.t_ns += 200000;
    frame(10, 1);
    judge(PLR_REASON_NO_TWISTS, PLR_HEALTH_DEGRADED);
    filter.reading_ns = filter.t_ns;
    frame(10, 1);
    judge(0, PLR_HEALTH_GOOD);
    filter.totals.twists_refused++;
    frame(10, 1);
    judge(PLR_REASON_NO_TWISTS, PLR_HEALTH_DEGRADED);
    frame(10, 1); /* that one was before the last frame */
    judge(0, PLR_HEALTH_GOOD);
    filter.reading_valid = 0;
    frame(10, 1);
    judge(PLR_REASON_NO_TWISTS, PLR_HEALTH_DEGRADED);
    filter.config.mode = PLR_MODE_MAPPING; /* has no use for them */
    frame(10, 1);
    judge(0, PLR_HEALTH_GOOD);
}

/* A frame of 40 degrees of freedom: ten used, none rejected. */
static void frame_of_nis(double per_degree) {
    frame(10, 0);
    report.nis = (float)(40 * per_degree);
}

/* Two such frames are 68 degrees of freedom, three are 88. */
static void test_innovations_above_what_noise_explains_degrade(void) {
    for (int k = 0; k < 2; k++) {
        frame_of_nis(1.61);
        judge(0, PLR_HEALTH_GOOD);
    }
    frame_of_nis(1.61);
    judge(PLR_REASON_NIS_HIGH, PLR_HEALTH_DEGRADED);
    frame_of_nis(1.3); /* which brings the mean below 1.6 */
    judge(0, PLR_HEALTH_GOOD);
}

static void test_innovations_far_below_their_noise_are_said_and_do_no_harm(void) {
    for (int k = 0; k < 2; k++) {
        frame_of_nis(0.29);
        judge(0, PLR_HEALTH_GOOD);
    }
    frame_of_nis(0.29);
    judge(PLR_REASON_NIS_LOW, PLR_HEALTH_GOOD);
    frame_of_nis(0.4);
    judge(0, PLR_HEALTH_GOOD);
}

static void test_a_scene_of_which_much_is_rejected_is_in_doubt_until_it_has_settled(void) {
    frame(100, 31);
    judge(PLR_REASON_SCENE_DISAGREES | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_DEGRADED);
    frame(0, 0); /* of a frame without matches nothing is said */
    judge(PLR_REASON_FEW_OBSERVATIONS | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_DEGRADED);
    plr_scene_clear(&filter);
    demand_settling();
}

/* Noise does that too at times: the doubt lasts for as long as it did. */
static void test_a_scene_that_fits_worse_for_one_frame_is_in_doubt_for_one_more(void) {
    for (int k = 0; k < 300; k++) {
        frame(20, k % 30 == 0);
        judge(0, PLR_HEALTH_GOOD);
    }
    frame(20, 5);
    judge(PLR_REASON_SCENE_DISAGREES | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_DEGRADED);
    plr_scene_clear(&filter);
    frame(20, 0);
    judge(0, PLR_HEALTH_GOOD);
}

static void test_a_bias_beyond_its_prior_is_said(void) {
    static const double known[6] = {0};
    filter.config.bias = 1;
    filter.count = 0;
    plr_process_twist.lay_out(&filter);
    plr_covariance_begin_diagonal(&filter, PLR_BLOCK_BIAS, known);
    for (int k = 0; k < 6; k++) {
        filter.bias[k] = filter.bias_prior[k] = PLR_R(0.2);
        filter.bias_prior_sigma[k] = PLR_R(0.01);
    }
    for (int k = 0; k < 6; k++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            filter.bias[k] = PLR_R(0.2) + PLR_R(0.0419) * (plr_real)sign;
            frame(10, 1);
            judge(0, PLR_HEALTH_GOOD);
            filter.bias[k] = PLR_R(0.2) + PLR_R(0.0421) * (plr_real)sign;
            frame(10, 1);
            judge(PLR_REASON_BIAS_OFF_PRIOR, PLR_HEALTH_DEGRADED);
        }
        filter.bias[k] = PLR_R(0.2);
    }
    filter.bias[1] = PLR_R(0.2) + PLR_R(0.0421); /* no wonder after three hours of its walk */
    filter.par.bias_velocity_walk = PLR_R(1e-8);
    filter.bias_walked_s = 10000;
    frame(10, 1);
    judge(0, PLR_HEALTH_GOOD);
    filter.bias[1] = PLR_R(0.2) + PLR_R(0.060);
    frame(10, 1);
    judge(PLR_REASON_BIAS_OFF_PRIOR, PLR_HEALTH_DEGRADED);
    filter.bias[1] = PLR_R(0.2);
    filter.bias_walked_s = 0;
    filter.bias_prior_sigma[2] = 0; /* no prior, no limit */
    filter.bias[2] = 5;
    frame(10, 1);
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

static void test_three_points_lock(void) {
    for (int k = 0; k < 9; k++)
        TEST_ASSERT_FALSE(is_locked(3, 3));
    TEST_ASSERT_TRUE(is_locked(3, 3));
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
        frame(2, 2); /* too few to lock */
        plr_health_judge(&filter, &events, &report);
    }
    frame(2, 1);
    plr_health_judge(&filter, &events, &report);
    TEST_ASSERT_FALSE(plr_health_fixed_gate_is_open(&filter));
}

static void test_a_frame_below_the_limits_breaks_the_row(void) {
    static const unsigned harmless[3][2] = {{2, 2}, {10, 7}, {0, 0}};
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

static void refuse(unsigned reasons, plr_health health) {
    memset(&report, 0, sizeof report);
    plr_health_after_refusal(&filter, &report);
    TEST_ASSERT_EQUAL_INT(health, report.health);
    TEST_ASSERT_EQUAL_HEX32(reasons, report.reasons);
    TEST_ASSERT_EQUAL_UINT16(4, report.active);
}

static void test_a_refused_frame_says_how_it_stood_and_is_never_good(void) {
    frame(10, 1);
    judge(0, PLR_HEALTH_GOOD);
    refuse(0, PLR_HEALTH_DEGRADED);
    frame(10, 1);
    report.refused = 1;
    judge(PLR_REASON_REFUSED_INPUT, PLR_HEALTH_DEGRADED);
    refuse(PLR_REASON_REFUSED_INPUT, PLR_HEALTH_DEGRADED);
    frame(10, 1);
    events.locked = true;
    judge(PLR_REASON_GATE_LOCKED | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_LOST);
    refuse(PLR_REASON_GATE_LOCKED | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_LOST);
}

static void test_damaged_memory_is_the_end(void) {
    memset(&report, 0, sizeof report);
    plr_health_damaged(&filter, &report);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DIVERGED, report.health);
    TEST_ASSERT_EQUAL_HEX32(PLR_REASON_STATE_DAMAGED, report.reasons);
    TEST_ASSERT_EQUAL_UINT32(1, filter.totals.damaged);
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
