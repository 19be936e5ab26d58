// SPDX-License-Identifier: MIT
/* Health and its reasons from what happened in frames. */
#include <string.h>
#include <unity.h>

#include "supervise/supervise.h"

static plr_supervisor supervisor;
static plr_frame_evidence evidence;
static plr_frame_events *const events = &evidence.events;
static plr_readings_evidence *const readings = &evidence.readings;
static plr_report report;

void setUp(void) {
    plr_config config;
    plr_config_default(&config);
    memset(&evidence, 0, sizeof evidence);
    plr_supervise_begin(&supervisor, &config);
    evidence.has_gate = true;
    *readings = (plr_readings_evidence){.now_ns = 1000000000,
                                        .reading_ns = 1000000000, /* just now */
                                        .interval_s = PLR_R(0.01),
                                        .valid = true,
                                        .needed = true,
                                        .looks = true};
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

static void look(void) {
    plr_frame_decision decision;
    plr_supervise_frame(&supervisor, &evidence, &report, &decision);
}

static void judge(unsigned reasons, plr_health health) {
    plr_frame_decision decision;
    plr_supervise_frame(&supervisor, &evidence, &report, &decision);
    TEST_ASSERT_EQUAL_HEX32(reasons, decision.reasons);
    TEST_ASSERT_EQUAL_INT(health, decision.health);
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
    readings->now_ns += milliseconds * UINT64_C(1000000);
    readings->reading_ns = readings->now_ns;
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
    events->locked = true;
    judge(PLR_REASON_GATE_LOCKED | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_LOST);
    events->locked = false;
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
    events->sink_failed = true;
    judge(PLR_REASON_SINK_FAILED, PLR_HEALTH_DEGRADED);
    events->sink_failed = false;
    frame(10, 1);
    events->cut = 3;
    judge(PLR_REASON_RANGE_LIMITED, PLR_HEALTH_DEGRADED);
    events->cut = 0;
    frame(10, 1);
    report.no_room = 4; /* full slots are no fault */
    judge(PLR_REASON_NO_ROOM, PLR_HEALTH_GOOD);
    frame(10, 1);
    events->recovered = true;
    judge(PLR_REASON_NOT_POSITIVE | PLR_REASON_RECOVERED, PLR_HEALTH_DEGRADED);
    events->recovered = false;
    frame(10, 1);
    events->locked = true;
    judge(PLR_REASON_GATE_LOCKED | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_LOST);
    events->locked = false;
    demand_settling();
}

static void test_missing_and_refused_twists_degrade(void) {
    readings->now_ns += 79900000; /* 50 ms and three times the 10 ms in which they come: 80 */
    frame(10, 1);
    judge(0, PLR_HEALTH_GOOD);
    readings->now_ns += 200000;
    frame(10, 1);
    judge(PLR_REASON_NO_TWISTS, PLR_HEALTH_DEGRADED);
    readings->reading_ns = readings->now_ns;
    frame(10, 1);
    judge(0, PLR_HEALTH_GOOD);
    readings->refused++;
    frame(10, 1);
    judge(PLR_REASON_NO_TWISTS, PLR_HEALTH_DEGRADED);
    frame(10, 1); /* that one was before the last frame */
    judge(0, PLR_HEALTH_GOOD);
    readings->valid = false;
    frame(10, 1);
    judge(PLR_REASON_NO_TWISTS, PLR_HEALTH_DEGRADED);
    readings->needed = false; /* has no use for them */
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

/* Without a gate an innovation may be anything. */
static void test_an_innovation_without_measure_is_forgotten_as_others_are(void) {
    for (int k = 0; k < 3; k++) {
        frame_of_nis(1);
        look();
    }
    frame_of_nis(1e35);
    look();
    TEST_ASSERT_TRUE(supervisor.reasons & PLR_REASON_NIS_HIGH);
    for (int k = 0; k < 300; k++) {
        frame_of_nis(1);
        look();
    }
    TEST_ASSERT_EQUAL_HEX32(0, supervisor.reasons & ~(uint32_t)PLR_REASON_GATE_INERT);
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

/* Is a bias told as off its prior, `sigmas` of that away, if `share` of its variance is gone? */
static bool is_told(unsigned axis, double sigmas, double share) {
    plr_frame_decision decision;
    frame(10, 1);
    evidence.bias.estimated = true;
    for (unsigned k = 0; k < 6; k++) {
        evidence.bias.prior[k] = PLR_R(1e-4);
        evidence.bias.variance[k] = PLR_R(1e-4) * (plr_real)(k == axis ? 1 - share : 1);
        evidence.bias.off[k] = (plr_real)(k == axis ? 0.01 * sigmas : 0);
    }
    plr_supervise_frame(&supervisor, &evidence, &report, &decision);
    TEST_ASSERT_EQUAL(decision.reasons == 0, decision.health == PLR_HEALTH_GOOD);
    return (decision.reasons & PLR_REASON_BIAS_OFF_PRIOR) != 0;
}

/* An estimate of which half has been learnt should be within sqrt(1/2) of the prior's sigmas. */
static void test_a_bias_is_held_against_what_has_been_learnt_of_it(void) {
    for (unsigned axis = 0; axis < 6; axis++)
        for (int sign = -1; sign <= 1; sign += 2) {
            TEST_ASSERT_TRUE(is_told(axis, sign * 4.3, 0.99));
            TEST_ASSERT_FALSE(is_told(axis, sign * 4.1, 0.99));
            TEST_ASSERT_TRUE(is_told(axis, sign * 3.05, 0.5));
            TEST_ASSERT_FALSE(is_told(axis, sign * 2.9, 0.5));
        }
}

static void test_a_bias_of_which_little_is_known_is_not_judged(void) {
    TEST_ASSERT_FALSE(is_told(0, 5, 0));
    TEST_ASSERT_FALSE(is_told(0, 5, 0.2));
    TEST_ASSERT_FALSE(is_told(0, 5, -0.5)); /* it has walked since */
    TEST_ASSERT_TRUE(is_told(0, 5, 0.3));
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
    evidence.has_gate = false;
    for (int k = 0; k < 12; k++) {
        frame(100, 0);
        judge(0, PLR_HEALTH_GOOD);
    }
}

static void test_the_count_of_matches_cannot_overflow(void) {
    supervisor.matches_since_gated = UINT32_MAX / 2;
    for (int k = 0; k < 3; k++) {
        frame(100, 0);
        judge(PLR_REASON_GATE_INERT, PLR_HEALTH_GOOD);
    }
    TEST_ASSERT_LESS_THAN_UINT32(UINT32_MAX / 2, supervisor.matches_since_gated);
}

/* ---------------------------------------------------------------- the locked gate */

static bool is_locked(unsigned matched, unsigned gated) {
    const plr_search_evidence e = {matched, gated, false, 0};
    const plr_search_decision decision = plr_supervise_search(&supervisor, &e);
    TEST_ASSERT_FALSE(decision.wait || decision.hold_biases);
    /* landmarks that it made would agree with the wrong pose */
    TEST_ASSERT_EQUAL(supervisor.frames_mostly_gated > 0,
                      decision.make_none || decision.drop_rejected);
    return decision.drop_rejected;
}

static void test_ten_frames_of_four_fifths_rejected_lock(void) {
    for (int k = 0; k < 9; k++)
        TEST_ASSERT_FALSE(is_locked(5, 4));
    TEST_ASSERT_TRUE(is_locked(5, 4));
}

static void test_three_points_lock(void) {
    for (int k = 0; k < 9; k++)
        TEST_ASSERT_FALSE(is_locked(3, 3));
    TEST_ASSERT_TRUE(is_locked(3, 3));
}

static void test_after_a_lock_ten_more_lock_again(void) {
    for (int k = 0; k < 50; k++)
        TEST_ASSERT_EQUAL(k % 10 == 9, is_locked(20, 20));
}

static bool a_fixed_gate_is_open(void) {
    const plr_picture_evidence nothing = {0};
    return plr_supervise_picture(&supervisor, &nothing).opens_fixed_gate;
}

static void test_a_fixed_gate_is_open_from_a_lock_until_a_frame_is_seen(void) {
    for (int k = 0; k < 25; k++) {
        TEST_ASSERT_EQUAL(k >= 10, a_fixed_gate_is_open());
        (void)is_locked(20, 20);
    }
    (void)is_locked(20, 3);
    TEST_ASSERT_FALSE(a_fixed_gate_is_open());
}

static void test_a_fixed_gate_is_open_after_ten_frames_without_use(void) {
    for (int k = 0; k < 12; k++) {
        TEST_ASSERT_EQUAL(k >= 10, a_fixed_gate_is_open());
        frame(2, 2); /* too few to lock */
        look();
    }
    frame(2, 1);
    look();
    TEST_ASSERT_FALSE(a_fixed_gate_is_open());
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
}

/* ---------------------------------------------------------------- refusals */

static void refuse(unsigned reasons, plr_health health) {
    memset(&report, 0, sizeof report);
    plr_supervise_refused(&supervisor, &report);
    TEST_ASSERT_EQUAL_INT(health, report.health);
    TEST_ASSERT_EQUAL_HEX32(reasons, report.reasons);
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
    events->locked = true;
    judge(PLR_REASON_GATE_LOCKED | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_LOST);
    refuse(PLR_REASON_GATE_LOCKED | PLR_REASON_POSE_MAY_BE_WRONG, PLR_HEALTH_LOST);
}
