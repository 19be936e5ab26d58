// SPDX-License-Identifier: MIT
/* Landmarks as the caller sees them: read, inserted, flushed. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/matrices.h"
#include "support/oracle.h"
#include "support/reseal.h"
#include "support/rig.h"
#include "support/specimens.h"

static uint32_t handed[PLR_MAX_LANDMARKS];
static unsigned handed_over;
static uint32_t unwanted; /* the sink refuses this id */

static int sink(void *context, const plr_landmark *landmark) {
    (void)context;
    if (landmark->id == unwanted)
        return 7;
    handed[handed_over++] = landmark->id;
    return 0;
}

void setUp(void) {
    handed_over = 0;
    unwanted = 0;
    rig_set_up();
    rig.map.sink = sink;
    rig_begin();
}

static plr_landmark known_landmark(void) {
    plr_landmark known = {
        .id = 5, .p_W_m = {8, 1, 0.5}, .P_W_m2 = {0.04, 0.01, 0, 0.01, 0.03, 0, 0, 0, 0.02}};
    return known;
}

/* ---------------------------------------------------------------- reading */

static void test_landmarks_are_where_the_world_has_them(void) {
    unsigned inside = 0, count = 0;
    rig_drive(30);
    for (unsigned slot = 0; slot < plr_filter_landmark_count(&rig.filter); slot++) {
        plr_landmark landmark;
        double error[3], weighted[3];
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&rig.filter, slot, &landmark));
        const double *truth = scene_landmark(&rig.world, landmark.id);
        for (int i = 0; i < 3; i++)
            error[i] = weighted[i] = landmark.p_W_m[i] - truth[i];
        double P[9];
        memcpy(P, landmark.P_W_m2, sizeof P);
        TEST_ASSERT_TRUE(oracle_solve_spd(3, 1, P, weighted));
        const double d2 = error[0] * weighted[0] + error[1] * weighted[1] + error[2] * weighted[2];
        inside += d2 < 11.345; /* 99 % of chi-square with 3 degrees of freedom */
        count++;
    }
    TEST_ASSERT_GREATER_THAN_UINT(20, count);
    TEST_ASSERT_TRUE(inside >= count * 9 / 10);
}

static void test_a_slot_beyond_the_last_is_refused(void) {
    plr_landmark landmark;
    rig_drive(3);
    rig_twist();
    rig_twist(); /* motion is pending: a refusal does not apply it */
    rig_remember();
    const unsigned count = plr_filter_landmark_count(&rig.filter);
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_landmark(&rig.filter, count, &landmark));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_landmark(&rig.filter, UINT32_MAX, &landmark));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_landmark(&rig.filter, 0, NULL));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_landmark(NULL, 0, &landmark));
    TEST_ASSERT_EQUAL_UINT(0, plr_filter_landmark_count(NULL));
}

static void test_reading_a_landmark_brings_it_up_to_the_pose(void) {
    plr_landmark before, after;
    rig_drive(3);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&rig.filter, 0, &before));
    const plr_pose was = pose_of(&rig.filter);
    for (int k = 0; k < 20; k++)
        rig_twist();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&rig.filter, 0, &after));
    const plr_pose is = pose_of(&rig.filter);
    TEST_ASSERT_GREATER_THAN_DOUBLE(0.1, largest_difference(was.p, is.p, 3));
    /* the body has moved, the landmark has not: neither in place nor in what is known of it */
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0, largest_difference(before.p_W_m, after.p_W_m, 3));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0, specimen_gap(3, before.P_W_m2, after.P_W_m2));
}

static void test_a_diverged_filter_shows_no_landmark(void) {
    plr_landmark landmark;
    rig_drive(3);
    spoil_covariance(&rig.filter);
    rig_remember();
    rig_demand_untouched(PLR_E_DIVERGED, plr_filter_landmark(&rig.filter, 0, &landmark));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_flush_map(&rig.filter));
    TEST_ASSERT_EQUAL_UINT(0, handed_over);
}

/* ---------------------------------------------------------------- inserting */

static void check_insert(plr_model_kind model) {
    const plr_landmark known = known_landmark();
    plr_landmark got;
    double P_xi[36];
    rig.config.model = (uint8_t)model;
    rig_begin();
    rig_drive(3);
    const unsigned slot = plr_filter_landmark_count(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_insert_known(&rig.filter, &known));
    TEST_ASSERT_EQUAL_UINT(slot + 1, plr_filter_landmark_count(&rig.filter));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&rig.filter, slot, &got));
    TEST_ASSERT_EQUAL_UINT32(5, got.id);
    TEST_ASSERT_TRUE(got.known);
    TEST_ASSERT_EQUAL_UINT32(0, got.times_seen);
    /* it comes out as it went in, whatever the pose is worth: its place is known by the world */
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0, largest_difference(known.p_W_m, got.p_W_m, 3));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0, specimen_gap(3, known.P_W_m2, got.P_W_m2));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P_xi));
    TEST_ASSERT_GREATER_THAN_DOUBLE(0, P_xi[0]);
}

static void test_a_known_landmark_comes_out_as_it_went_in(void) {
    check_insert(PLR_MODEL_BODY);
    check_insert(PLR_MODEL_WORLD);
}

static void test_insert_refuses_and_changes_nothing(void) {
    plr_landmark known = known_landmark();
    rig_drive(3);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_insert_known(&rig.filter, &known));
    rig_twist();
    rig_twist(); /* motion is pending: a refusal does not apply it */
    rig_remember();
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_insert_known(NULL, &known));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_insert_known(&rig.filter, NULL));
    rig_demand_untouched(PLR_E_EXISTS, plr_filter_insert_known(&rig.filter, &known));
    known.id = 6;
    known.p_W_m[2] = (double)NAN;
    rig_demand_untouched(PLR_E_NOT_FINITE, plr_filter_insert_known(&rig.filter, &known));
    known.p_W_m[2] = 1e10;
    rig_demand_untouched(PLR_E_RANGE, plr_filter_insert_known(&rig.filter, &known));
    known.p_W_m[2] = 2e5; /* beyond max-range */
    rig_demand_untouched(PLR_E_RANGE, plr_filter_insert_known(&rig.filter, &known));
    known = known_landmark();
    known.id = 6;
    known.P_W_m2[8] = (double)INFINITY;
    rig_demand_untouched(PLR_E_NOT_FINITE, plr_filter_insert_known(&rig.filter, &known));
    known.P_W_m2[8] = 1e13;
    rig_demand_untouched(PLR_E_RANGE, plr_filter_insert_known(&rig.filter, &known));
    known.P_W_m2[8] = -1;
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_insert_known(&rig.filter, &known));
}

static void test_a_full_ring_takes_no_known_landmark(void) {
    plr_landmark known = known_landmark();
    rig.config.slots = 3;
    rig_begin();
    for (uint32_t id = 1; id <= 3; id++) {
        known.id = id;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_insert_known(&rig.filter, &known));
    }
    known.id = 4;
    rig_remember();
    rig_demand_untouched(PLR_E_FULL, plr_filter_insert_known(&rig.filter, &known));
    TEST_ASSERT_EQUAL_UINT(0, handed_over);
}

static void test_a_known_landmark_pulls_the_pose_to_the_world(void) {
    /* two filters that start lost by a metre or so: one is given a map */
    double trace[2];
    for (int with = 0; with < 2; with++) {
        double P[36];
        rig.config.start_sigma = 0.5;
        rig_begin();
        for (uint32_t id = 100; with && id < 250; id++) {
            const plr_landmark known = scene_known(&rig.world, id, 0.01);
            const plr_status status = plr_filter_insert_known(&rig.filter, &known);
            TEST_ASSERT_TRUE(status == PLR_OK || status == PLR_E_FULL);
        }
        rig_drive(5);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
        trace[with] = P[0] + P[7] + P[14];
    }
    TEST_ASSERT_GREATER_THAN_DOUBLE(0.7, trace[0]);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.01, trace[1]);
}

/* ---------------------------------------------------------------- flushing */

static void test_flush_hands_every_landmark_to_the_sink(void) {
    rig_drive(5);
    const unsigned count = plr_filter_landmark_count(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_flush_map(&rig.filter));
    TEST_ASSERT_EQUAL_UINT(count, handed_over);
    TEST_ASSERT_EQUAL_UINT(0, plr_filter_landmark_count(&rig.filter));
    for (unsigned i = 0; i < count; i++)
        for (unsigned j = 0; j < i; j++)
            TEST_ASSERT_TRUE(handed[i] != handed[j]);
    rig_drive(3); /* and life goes on */
    TEST_ASSERT_GREATER_THAN_UINT(0, plr_filter_landmark_count(&rig.filter));
}

static void test_flush_keeps_what_the_sink_refuses(void) {
    plr_landmark before, after;
    rig_drive(5);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&rig.filter, 3, &before));
    unwanted = before.id;
    const unsigned count = plr_filter_landmark_count(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_E_IO, plr_filter_flush_map(&rig.filter));
    TEST_ASSERT_EQUAL_UINT(count - 1, handed_over);
    TEST_ASSERT_EQUAL_UINT(1, plr_filter_landmark_count(&rig.filter));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&rig.filter, 0, &after));
    TEST_ASSERT_EQUAL_UINT32(before.id, after.id);
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, largest_difference(before.P_W_m2, after.P_W_m2, 9));
}

static void test_flush_wants_a_sink(void) {
    rig.map.sink = NULL;
    rig_begin();
    rig_drive(3);
    rig_twist();
    rig_remember();
    rig_demand_untouched(PLR_E_MODE, plr_filter_flush_map(&rig.filter));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_flush_map(NULL));
}

static void test_an_empty_map_is_flushed_at_once(void) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_flush_map(&rig.filter));
    TEST_ASSERT_EQUAL_UINT(0, handed_over);
}
