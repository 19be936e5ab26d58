// SPDX-License-Identifier: MIT
/* A filter whose memory was changed by something else says so, and does nothing else. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "filter/guard.h"
#include "math/packed.h"
#include "support/rig.h"
#include "support/state_bytes.h"

/* Landmarks: every bit of them all is flipped, and a sum is made over all each time. */
enum { FEW = 8 };

static plr_filter sound;
static state_bytes state;

static int take(void *context, const plr_landmark *landmark) {
    (void)context;
    (void)landmark;
    return 0;
}

void setUp(void) {
    rig_set_up();
    rig.options.most_seen = FEW;
    rig.map.sink = take;
    rig_begin();
    rig_drive(5);
    rig_twist();
    memcpy(&sound, &rig.filter, sizeof sound);
    state_bytes_save(&state, &rig.filter);
}

static void flip(size_t byte, unsigned bit) {
    ((unsigned char *)&rig.filter)[byte] ^= (unsigned char)(1U << bit);
}

/* ---------------------------------------------------------------- what is found */

/* Whether a frame tells that this bit was flipped. Puts back what a refusal writes, and not all the
 * room of a desktop's filter. */
static bool is_found(size_t byte, unsigned bit) {
    flip(byte, bit);
    const plr_frame nothing = {.t_ns = rig.world.t_ns, .budget = PLR_NO_BUDGET};
    const plr_status status = plr_filter_update(&rig.filter, &nothing, NULL);
    flip(byte, bit);
    rig.filter.totals = sound.totals;
    return status == PLR_E_DAMAGED || (byte < sizeof(uint32_t) && status == PLR_E_NOT_READY);
}

static void demand_found(size_t from, size_t to) {
    for (size_t byte = from; byte < to; byte++)
        for (unsigned bit = 0; bit < 8; bit++) {
            char at[64];
            snprintf(at, sizeof at, "byte %u, bit %u was flipped and not found", (unsigned)byte,
                     bit);
            TEST_ASSERT_TRUE_MESSAGE(is_found(byte, bit), at);
        }
    TEST_ASSERT_EQUAL_MEMORY(&sound, &rig.filter, sizeof sound);
}

static void test_every_flipped_bit_of_what_outlives_a_call_is_found(void) {
    const size_t P = offsetof(plr_filter, belief.P);
    demand_found(0, sizeof sound.magic);
    demand_found(offsetof(plr_filter, config), offsetof(plr_filter, source.alignment));
    demand_found(offsetof(plr_filter, source.reading_ns),
                 offsetof(plr_filter, belief.slots) +
                     sound.belief.count * sizeof *sound.belief.slots);
    demand_found(P, P + plr_packed_row(12 + 3 * sound.belief.count) * sizeof *sound.belief.P);
    demand_found(offsetof(plr_filter, supervisor), sizeof sound);
}

static void test_what_no_call_looks_at_may_be_changed(void) {
    const plr_pose before = pose_of(&rig.filter);
    memset(&rig.filter.work, 0xA5, sizeof rig.filter.work);
    memset(rig.filter.belief.slots + sound.belief.count, 0xA5, sizeof *sound.belief.slots);
    const plr_pose after = pose_of(&rig.filter);
    TEST_ASSERT_EQUAL_MEMORY(&before, &after, sizeof before);
    rig_drive(3);
}

/* Which a plain sum would not see: neighbours, and words that enter the same of the sums side by side. */
static void test_words_that_change_places_are_found(void) {
    const plr_frame nothing = {.t_ns = rig.world.t_ns, .budget = PLR_NO_BUDGET};
    plr_real *P = rig.filter.belief.P + 60;
    for (unsigned apart = 1; apart <= 16; apart++) {
        const plr_real x = P[0], y = P[apart];
        TEST_ASSERT_FALSE(x <= y && x >= y);
        P[0] = y;
        P[apart] = x;
        TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_update(&rig.filter, &nothing, NULL));
        P[0] = x;
        P[apart] = y;
    }
}

/* Of the camera as it is estimated only a frame makes use: a reading does not look at it. */
static void test_what_a_reading_does_not_use_is_found_by_a_query_and_a_frame(void) {
    const plr_frame nothing = {.t_ns = rig.world.t_ns, .budget = PLR_NO_BUDGET};
    plr_calibration_result told;
    double P_xi[36];
    flip(offsetof(plr_filter, camera.estimate.t) + 1, 3);
    rig_twist();
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_calibration(&rig.filter, &told));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_update(&rig.filter, &nothing, NULL));
    memcpy(&rig.filter, &sound, sizeof sound);
    flip(offsetof(plr_filter, belief.P) + 1, 3);
    rig_twist();
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_pose_covariance(&rig.filter, P_xi));
}

/* The weighing of a velocity against twists reads the biases' rows of P. */
static void test_beside_a_velocity_that_is_held_a_twist_looks_at_what_it_is_weighed_by(void) {
    const plr_twist twist = {{1, 0, 0}, {0, 0, 0}};
    rig.filter.source.velocities_known = 1;
    plr_guard_seal_whole(&rig.filter);
    flip(offsetof(plr_filter, belief.P) + 1, 3);
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED,
                          plr_filter_predict(&rig.filter, rig.filter.belief.t_ns + 1, &twist));
}

/* ---------------------------------------------------------------- what is refused */

/* Every call but init, and reset, refuses; none writes beside the counts. */
static void demand_refusals(void) {
    static plr_filter damaged;
    const plr_frame frame = {.t_ns = rig.world.t_ns, .budget = PLR_NO_BUDGET};
    const plr_twist twist = {{1, 0, 0}, {0, 0, 0}};
    plr_landmark landmark = {.id = 77, .p_W_m = {5, 0, 0}, .P_W_m2 = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    plr_filter *f = &rig.filter;
    plr_report report;
    plr_pose pose;
    plr_twist velocity;
    double x[36] = {0};
    memcpy(&damaged, f, sizeof damaged);
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_update(f, &frame, &report));
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DIVERGED, report.health);
    TEST_ASSERT_EQUAL_HEX32(PLR_REASON_STATE_DAMAGED, report.reasons);
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_predict(f, rig.world.t_ns, &twist));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_set_pose(f, 1, &rig_identity, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_move_to(f, 1, &rig_identity));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_set_bias(f, x, x));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_resume(f, 1, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_insert_known(f, &landmark));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_flush_map(f));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_landmark(f, 0, &landmark));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_save(f, NULL, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, state_bytes_restore(&state, f));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_pose(f, &pose));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_pose_covariance(f, x));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_velocity(f, &velocity));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_velocity_covariance(f, x));
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_bias(f, x, NULL));
    TEST_ASSERT_EQUAL_UINT(0, plr_filter_landmark_count(f));
    TEST_ASSERT_EQUAL_UINT32(0, plr_filter_saved_size(f, 1));
    TEST_ASSERT_EQUAL_DOUBLE(0, plr_filter_trace(f));
    TEST_ASSERT_EQUAL_UINT32(damaged.totals.damaged + 1, f->totals.damaged);
    damaged.totals.damaged++;
    TEST_ASSERT_EQUAL_MEMORY(&damaged, f, sizeof damaged);
}

static void test_a_damaged_pose_is_not_given_and_a_reset_mends_it(void) {
    rig.filter.belief.p_WB[1] += 1;
    demand_refusals();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_reset(&rig.filter));
    const plr_pose pose = pose_of(&rig.filter);
    TEST_ASSERT_EQUAL_DOUBLE(0, pose.p[1]);
}

static void test_a_count_beyond_the_slots_leads_no_call_out_of_bounds(void) {
    rig.filter.belief.count = 0x40000000;
    demand_refusals();
    rig.filter.belief.count = sound.belief.count;
    rig.filter.config.slots = 0xFFFF;
    rig.filter.totals.damaged = sound.totals.damaged;
    demand_refusals();
}

static void test_damaged_settings_are_mended_by_init_alone(void) {
    rig.filter.par.max_gap_ns ^= 1;
    demand_refusals();
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_reset(&rig.filter));
    rig_begin();
    rig_drive(3);
}

/* It would be jumped to. */
static void test_a_sink_that_points_elsewhere_is_not_called(void) {
    flip(offsetof(plr_filter, map.sink) + 1, 3);
    demand_refusals();
}

static void test_numbers_that_no_pose_has_are_damage_even_under_a_right_sum(void) {
    rig.filter.belief.R_WB[4] = (plr_real)NAN;
    plr_guard_seal_whole(&rig.filter);
    demand_refusals();
    memcpy(&rig.filter, &sound, sizeof sound);
    rig.filter.belief.R_WB[4] *= PLR_R(1.01);
    plr_guard_seal_whole(&rig.filter);
    demand_refusals();
    memcpy(&rig.filter, &sound, sizeof sound);
    rig.filter.belief.p_WB[0] = (double)INFINITY;
    plr_guard_seal_whole(&rig.filter);
    demand_refusals();
}
