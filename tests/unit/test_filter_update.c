// SPDX-License-Identifier: MIT
/* A stereo frame: who is refused, what is left out and counted, what a budget takes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "filter/gate.h"
#include "math/packed.h"
#include "state/covariance.h"
#include "support/matrices.h"
#include "support/reseal.h"
#include "support/rig.h"
#include "support/specimens.h"

static plr_observation seen[PLR_MAX_OBSERVATIONS + 1];

void setUp(void) {
    rig_set_up();
}

static plr_status update(const plr_frame *frame) {
    return plr_filter_update(&rig.filter, frame, &rig.report);
}

/* A frame of what the camera sees now, in an array that the test may spoil. */
static plr_frame look(void) {
    plr_frame frame = scene_look(&rig.world);
    memcpy(seen, frame.observations, frame.count * sizeof *seen);
    frame.observations = seen;
    return frame;
}

static void demand_sums(void) {
    const plr_report *r = &rig.report;
    TEST_ASSERT_EQUAL_UINT(r->observations, r->refused + r->duplicates + r->matched + r->created +
                                                r->poor + r->no_room);
    TEST_ASSERT_EQUAL_UINT(r->matched, r->used + r->gated + r->left_out);
    TEST_ASSERT_EQUAL_UINT(4 * (r->matched - r->gated), r->nis_dof);
    TEST_ASSERT_EQUAL_UINT(rig.filter.belief.count, r->active);
}

/* ---------------------------------------------------------------- refusals */

static void demand_refused_frame(plr_status expected, const plr_frame *frame) {
    rig_remember();
    rig_demand_refusal(expected, update(frame));
    TEST_ASSERT_EQUAL_INT(expected, rig.report.status);
    TEST_ASSERT_EQUAL_UINT64(frame->t_ns, rig.report.t_ns);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DEGRADED, rig.report.health);
    TEST_ASSERT_EQUAL_UINT16(rig.filter.belief.count, rig.report.active);
    TEST_ASSERT_EQUAL_UINT16(0, rig.report.used);
}

static void test_null_pointers_are_refused(void) {
    const plr_frame frame = look();
    rig_remember();
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_update(NULL, &frame, &rig.report));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, rig.report.status);
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_update(&rig.filter, NULL, &rig.report));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, rig.report.status);
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_update(&rig.filter, NULL, NULL));
}

static void test_a_frame_without_its_observations_is_refused(void) {
    rig_drive(2);
    plr_frame frame = look();
    frame.observations = NULL;
    demand_refused_frame(PLR_E_ARGUMENT, &frame);
    frame.count = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
}

static void test_more_observations_than_the_maximum_are_refused(void) {
    rig_drive(2);
    plr_frame frame = look();
    for (unsigned i = frame.count; i <= PLR_MAX_OBSERVATIONS; i++)
        seen[i] = (plr_observation){10000 + i, 500, 300, 490, 300};
    frame.count = PLR_MAX_OBSERVATIONS + 1;
    demand_refused_frame(PLR_E_ARGUMENT, &frame);
    frame.count = UINT16_MAX;
    demand_refused_frame(PLR_E_ARGUMENT, &frame);
    frame.count = PLR_MAX_OBSERVATIONS;
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    demand_sums();
}

static void test_a_frame_older_than_the_last_twist_is_late(void) {
    rig_drive(2);
    rig_twist();
    plr_frame frame = look();
    frame.t_ns = plr_filter_time(&rig.filter) - 1;
    demand_refused_frame(PLR_E_LATE, &frame);
    frame.t_ns = 0;
    demand_refused_frame(PLR_E_LATE, &frame);
    TEST_ASSERT_EQUAL_UINT32(2, rig.filter.totals.late);
}

static void test_a_frame_behind_a_gap_is_refused(void) {
    rig_drive(2);
    plr_frame frame = look();
    frame.t_ns += 2000000001;
    demand_refused_frame(PLR_E_GAP, &frame);
    frame.t_ns = UINT64_MAX;
    demand_refused_frame(PLR_E_GAP, &frame);
}

static void test_a_reading_that_cannot_be_held_until_the_frame_refuses_it(void) {
    const plr_twist spinning = {{0}, {0, 0, 3}};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, 1000000000, &spinning));
    plr_frame frame = look();
    frame.t_ns = UINT64_C(2500000000); /* 4.5 rad on */
    demand_refused_frame(PLR_E_RANGE, &frame);
}

static void test_a_frame_at_the_time_of_the_last_is_taken(void) {
    rig_drive(2);
    const plr_time_ns now = plr_filter_time(&rig.filter);
    plr_frame frame = look();
    TEST_ASSERT_EQUAL_UINT64(now, frame.t_ns);
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    demand_sums();
}

static void test_a_report_is_not_needed(void) {
    static plr_filter with;
    rig_drive(2);
    const plr_frame frame = look();
    rig_remember();
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    memcpy(&with, &rig.filter, sizeof with);
    memcpy(&rig.filter, &rig.before, sizeof rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, NULL));
    TEST_ASSERT_TRUE(specimen_same_state(&with, &rig.filter));
}

/* ---------------------------------------------------------------- cleaning */

static void test_pixels_that_lie_in_no_image_are_left_out(void) {
    static const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY, 1e6, -1e6, 1e30,
                                 -3e38};
    enum { KINDS = sizeof bad / sizeof *bad };
    rig_drive(3);
    plr_frame frame = look();
    TEST_ASSERT_GREATER_THAN_UINT(4 * KINDS / 2, frame.count);
    for (unsigned k = 0; k < KINDS; k++) {
        float *const field[4] = {&seen[k].uL_px, &seen[k].vL_px, &seen[k].uR_px, &seen[k].vR_px};
        *field[k % 4] = (float)bad[k];
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(KINDS, rig.report.refused);
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_REFUSED_INPUT);
    demand_sums();
    TEST_ASSERT_TRUE(specimen_gives_finite_numbers(&rig.filter));
}

static void test_every_copy_of_a_doubled_id_is_left_out(void) {
    rig_drive(3);
    plr_frame frame = look();
    seen[5].id = seen[2].id; /* a pair, and three of a kind, none of them next to another */
    seen[9].id = seen[7].id;
    seen[11].id = seen[7].id;
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(5, rig.report.duplicates);
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_REFUSED_INPUT);
    demand_sums();
}

static void test_a_malformed_copy_does_not_make_its_twin_a_duplicate(void) {
    rig_drive(3);
    plr_frame frame = look();
    seen[5] = seen[2];
    seen[5].uL_px = (float)NAN;
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(1, rig.report.refused);
    TEST_ASSERT_EQUAL_UINT(0, rig.report.duplicates);
    demand_sums();
}

/* ---------------------------------------------------------------- what a frame does */

static void test_counts_add_up_through_a_drive(void) {
    plr_totals sum = {0};
    rig.config.slots = 15;
    rig.options.outliers = 0.05;
    rig_begin();
    for (unsigned k = 0; k < 60; k++) {
        rig_drive(1);
        const plr_report *r = &rig.report;
        demand_sums();
        sum.observations += r->observations;
        sum.matched += r->matched;
        sum.used += r->used;
        sum.gated += r->gated;
        sum.created += r->created;
        sum.evicted += r->evicted;
        TEST_ASSERT_EQUAL_UINT64(rig.world.t_ns, r->t_ns);
        TEST_ASSERT_EQUAL_UINT16(PLR_NO_BUDGET, r->budget);
    }
    const plr_totals *t = &rig.filter.totals;
    TEST_ASSERT_EQUAL_UINT64(sum.observations, t->observations);
    TEST_ASSERT_EQUAL_UINT64(sum.matched, t->matched);
    TEST_ASSERT_EQUAL_UINT64(sum.used, t->used);
    TEST_ASSERT_EQUAL_UINT64(sum.gated, t->gated);
    TEST_ASSERT_EQUAL_UINT64(sum.created, t->created);
    TEST_ASSERT_EQUAL_UINT64(sum.evicted, t->evicted);
    TEST_ASSERT_EQUAL_UINT64(t->created, t->evicted + rig.filter.belief.count);
    TEST_ASSERT_EQUAL_UINT32(60, t->frames);
    TEST_ASSERT_EQUAL_UINT32(600, t->twists);
    TEST_ASSERT_GREATER_THAN_UINT(0, sum.gated);
    TEST_ASSERT_GREATER_THAN_UINT(0, sum.evicted);
}

static void test_a_landmark_counts_how_often_it_was_seen_and_rejected(void) {
    rig_drive(5);
    plr_landmark before, after;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&rig.filter, 0, &before));
    plr_frame frame = look();
    unsigned i = 0;
    while (seen[i].id != before.id)
        TEST_ASSERT_LESS_THAN_UINT(frame.count, ++i);
    seen[i].uL_px += 100;
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&rig.filter, 0, &after));
    TEST_ASSERT_EQUAL_UINT32(before.id, after.id);
    TEST_ASSERT_EQUAL_UINT32(before.times_seen + 1, after.times_seen);
    TEST_ASSERT_EQUAL_UINT32(before.times_gated + 1, after.times_gated);
    TEST_ASSERT_EQUAL_UINT64(frame.t_ns, after.last_seen_ns);
}

static void test_a_gated_observation_moves_nothing(void) {
    rig_drive(5);
    plr_frame frame = look();
    for (unsigned i = 0; i < frame.count; i++)
        seen[i].uL_px += 300;
    rig_remember();
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(rig.report.matched, rig.report.gated);
    TEST_ASSERT_TRUE(same_bits(rig.before.belief.R_WB, rig.filter.belief.R_WB, 9));
    TEST_ASSERT_EQUAL_MEMORY(rig.before.belief.p_WB, rig.filter.belief.p_WB,
                             sizeof rig.filter.belief.p_WB);
    const unsigned n = plr_covariance_dim(&rig.before.belief);
    TEST_ASSERT_TRUE(same_bits(rig.before.belief.P, rig.filter.belief.P, n * (n + 1) / 2));
}

static void test_dead_reckoning_looks_at_nothing(void) {
    rig.config.mode = PLR_MODE_DEAD_RECKONING;
    rig_begin();
    rig_drive(5);
    TEST_ASSERT_EQUAL_UINT(0, rig.filter.belief.count);
    TEST_ASSERT_GREATER_THAN_UINT(0, rig.report.observations);
    TEST_ASSERT_EQUAL_UINT(0, rig.report.matched + rig.report.created + rig.report.poor);
    TEST_ASSERT_EQUAL_UINT32(5, rig.filter.totals.frames);
    TEST_ASSERT_EQUAL_UINT64(rig.world.t_ns, plr_filter_time(&rig.filter));
}

static void test_mapping_wants_the_pose_of_the_frames_own_time(void) {
    plr_pose T_WB;
    rig.config.mode = PLR_MODE_MAPPING;
    rig_begin();
    plr_frame frame = look();
    demand_refused_frame(PLR_E_MODE, &frame);
    scene_pose(&rig.world, &T_WB);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(&rig.filter, frame.t_ns, &T_WB));
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    demand_sums();
    frame.t_ns += 1;
    demand_refused_frame(PLR_E_MODE, &frame);
}

/* ---------------------------------------------------------------- budget */

static double spread_of_landmarks(void) {
    double sum = 0;
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++) {
        plr_landmark landmark;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&rig.filter, slot, &landmark));
        sum += landmark.P_W_m2[0] + landmark.P_W_m2[4] + landmark.P_W_m2[8];
    }
    return sum;
}

static void test_a_budget_is_kept_and_the_rest_counted(void) {
    rig_drive(5);
    plr_frame frame = look();
    rig_remember();
    double last = (double)INFINITY;
    unsigned through = 0;
    for (uint16_t budget = 0; budget <= frame.count; budget++) {
        memcpy(&rig.filter, &rig.before, sizeof rig.filter);
        frame.budget = budget;
        TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
        demand_sums();
        through = (unsigned)(rig.report.matched - rig.report.gated);
        TEST_ASSERT_EQUAL_UINT(budget < through ? budget : through, rig.report.used);
        TEST_ASSERT_EQUAL_UINT16(budget, rig.report.budget);
        TEST_ASSERT_EQUAL(rig.report.left_out > 0, (rig.report.reasons & PLR_REASON_BUDGET) != 0);
        double P[36];
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
        const double trace = P[0] + P[7] + P[14];
        TEST_ASSERT_TRUE(trace <= last * (1 + 1e-5)); /* more observations, no more uncertainty */
        last = trace;
    }
    TEST_ASSERT_GREATER_THAN_UINT(5, through);
    TEST_ASSERT_GREATER_THAN_DOUBLE(0, spread_of_landmarks());
}

/* The ones that tell most: those of the largest det(S). */
static void test_a_budget_takes_those_of_the_largest_det_S(void) {
    enum { BUDGET = 5 };
    double gain[SCENE_MAX_SEEN], least_used = (double)INFINITY, most_left = 0;
    rig_drive(5);
    plr_frame frame = look();
    frame.budget = BUDGET;
    (void)plr_filter_trace(&rig.filter);
    for (unsigned i = 0; i < frame.count; i++) {
        gain[i] = 0;
        for (unsigned slot = 0; slot < rig.filter.belief.count; slot++)
            if (rig.filter.belief.slots[slot].id == seen[i].id) {
                const plr_verdict verdict = specimen_judge(&rig.filter, slot, &seen[i]);
                gain[i] = verdict.accepted ? (double)verdict.det_S : 0;
            }
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(BUDGET, rig.report.used);
    bool is_used[SCENE_MAX_SEEN] = {false};
    for (unsigned k = 0; k < rig.filter.work.sightings.count; k++) {
        const plr_sighting *row = &rig.filter.work.sightings.at[k];
        is_used[row->seen - seen] = row->used;
    }
    for (unsigned i = 0; i < frame.count; i++) {
        if (is_used[i] && gain[i] < least_used)
            least_used = gain[i];
        if (!is_used[i] && gain[i] > most_left)
            most_left = gain[i];
    }
    TEST_ASSERT_GREATER_THAN_DOUBLE(0, most_left);
    TEST_ASSERT_TRUE(least_used >= most_left);
}

/* ---------------------------------------------------------------- divergence */

/* The frame that finds the covariance broken keeps the pose, drops the landmarks, makes new ones of
 * what it sees, and says all of it; the frames after it are used as ever. */
static void demand_recovery(const plr_frame *frame) {
    double P[36];
    const unsigned active = rig.filter.belief.count;
    const plr_totals totals = rig.filter.totals;
    const plr_pose before = pose_of(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(frame));
    TEST_ASSERT_EQUAL_INT(PLR_OK, rig.report.status);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DEGRADED, rig.report.health);
    TEST_ASSERT_BITS(PLR_REASON_NOT_POSITIVE | PLR_REASON_RECOVERED | PLR_REASON_POSE_MAY_BE_WRONG,
                     UINT32_MAX, rig.report.reasons);
    TEST_ASSERT_EQUAL_UINT64(frame->t_ns, rig.filter.totals.diverged_ns);
    TEST_ASSERT_EQUAL_UINT32(totals.recoveries + 1, rig.filter.totals.recoveries);
    TEST_ASSERT_EQUAL_UINT32(totals.widened + 1, rig.filter.totals.widened);
    TEST_ASSERT_EQUAL_UINT32(totals.refused, rig.filter.totals.refused);
    TEST_ASSERT_GREATER_THAN_UINT(3, rig.report.created);
    TEST_ASSERT_EQUAL_UINT(rig.report.created, rig.filter.belief.count);
    TEST_ASSERT_GREATER_THAN_UINT(3, active);
    const plr_pose after = pose_of(&rig.filter);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0, largest_difference(before.p, after.p, 3));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    for (int i = 0; i < 6; i++)
        TEST_ASSERT_TRUE(P[7 * i] > 0);
    TEST_ASSERT_TRUE(specimen_gives_finite_numbers(&rig.filter));
}

static void test_a_diverged_filter_recovers_in_the_same_frame_and_goes_on(void) {
    rig_drive(5);
    rig.filter.belief.P[plr_packed_at(0, 0)] = PLR_R(-1e3);
    reseal(&rig.filter);
    rig_twist();
    const plr_time_ns when = rig.world.t_ns;
    const plr_frame first = look();
    demand_recovery(&first);

    for (int k = 0; k < 10; k++)
        rig_twist();
    const plr_frame second = look();
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&second));
    TEST_ASSERT_GREATER_THAN_UINT(3, rig.report.used);
    TEST_ASSERT_FALSE(rig.report.reasons & (PLR_REASON_NOT_POSITIVE | PLR_REASON_RECOVERED));
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_POSE_MAY_BE_WRONG);
    TEST_ASSERT_EQUAL_UINT64(second.t_ns, plr_filter_time(&rig.filter));
    TEST_ASSERT_EQUAL_UINT64(when, rig.filter.totals.diverged_ns);
    TEST_ASSERT_EQUAL_UINT32(1, rig.filter.totals.recoveries);
}

/* An update whose subtraction would take more than there is: the filter stops before, and says so. */
static void test_an_update_that_loses_a_variance_recovers_too(void) {
    rig_drive(5);
    (void)plr_filter_trace(&rig.filter);
    const plr_frame frame = look();
    const unsigned row = plr_covariance_row(&rig.filter.belief, 0);
    for (unsigned i = 0; i < 3; i++)
        rig.filter.belief.P[plr_packed_at(row + i, 0)] = PLR_R(10); /* correlated beyond 1 */
    reseal(&rig.filter);
    demand_recovery(&frame);
}
