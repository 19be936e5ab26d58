// SPDX-License-Identifier: MIT
/* Every number of slots from one to the build's capacity, and nothing written beyond them. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "math/packed.h"
#include "state/covariance.h"
#include "support/matrices.h"
#include "support/rig.h"
#include "support/specimens.h"

void setUp(void) {
    rig_set_up();
    rig.options.landmarks = 500;
    rig.options.most_seen = SCENE_MAX_SEEN;
    rig.options.range_m = 40;
}

/* Rows of P that a filter of so many slots has. */
static unsigned rows_of(unsigned slots) {
    return (rig.config.bias ? 12U : 6U) + 3 * slots;
}

/* Marks all of P behind the rows in use, and all slots behind the last. */
static void mark_the_rest(void) {
    for (size_t i = plr_packed_row(rows_of(rig.config.slots)); i < PLR_PACKED_SIZE; i++)
        rig.filter.belief.P[i] = PLR_R(-4321);
    memset(rig.filter.belief.slots + rig.config.slots, 0xA5,
           (PLR_MAX_LANDMARKS - rig.config.slots) * sizeof *rig.filter.belief.slots);
}

static void demand_marks(const char *at) {
    for (size_t i = plr_packed_row(rows_of(rig.config.slots)); i < PLR_PACKED_SIZE; i++)
        if (!(rig.filter.belief.P[i] <= PLR_R(-4321) && rig.filter.belief.P[i] >= PLR_R(-4321)))
            TEST_FAIL_MESSAGE(at);
    const uint8_t *slots = (const uint8_t *)(rig.filter.belief.slots + rig.config.slots);
    for (size_t i = 0; i < (PLR_MAX_LANDMARKS - rig.config.slots) * sizeof *rig.filter.belief.slots;
         i++)
        if (slots[i] != 0xA5)
            TEST_FAIL_MESSAGE(at);
}

static void check_capacity(unsigned slots, uint8_t model, uint8_t bias) {
    char at[64];
    snprintf(at, sizeof at, "%u slots, model %u, bias %u", slots, model, bias);
    rig.config.slots = (uint16_t)slots;
    rig.config.model = model;
    rig.config.bias = bias;
    rig_begin();
    mark_the_rest();
    rig_drive(3);
    TEST_ASSERT_LESS_OR_EQUAL_UINT_MESSAGE(slots, rig.filter.belief.count, at);
    if (slots <= 20)
        TEST_ASSERT_EQUAL_UINT_MESSAGE(slots, rig.filter.belief.count, at);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(rig.filter.belief.count, rig.report.active, at);
    TEST_ASSERT_TRUE_MESSAGE(plr_covariance_is_positive(&rig.filter.belief), at);
    demand_marks(at);
    TEST_ASSERT_TRUE_MESSAGE(specimen_gives_finite_numbers(&rig.filter), at);
}

static void test_every_number_of_slots_works_and_is_kept(void) {
    for (unsigned slots = 1; slots <= PLR_MAX_LANDMARKS; slots += slots < 40 ? 1 : 27)
        check_capacity(slots, (uint8_t)(slots % 2), (uint8_t)(slots / 2 % 2));
    check_capacity(PLR_MAX_LANDMARKS, PLR_MODEL_BODY, 1);
}

/* All slots of the build in use at once: the largest P there is. */
static void test_the_build_can_be_filled_to_the_last_slot(void) {
    plr_observation seen[PLR_MAX_OBSERVATIONS];
    const unsigned count =
        PLR_MAX_LANDMARKS < PLR_MAX_OBSERVATIONS ? PLR_MAX_LANDMARKS : PLR_MAX_OBSERVATIONS;
    rig.config.slots = PLR_MAX_LANDMARKS;
    rig.config.bias = 1;
    rig_begin();
    for (unsigned i = 0; i < count; i++) {
        const float u = 100 + (float)(i * 7 % 700), v = 50 + (float)(i * 13 % 500);
        seen[i] = (plr_observation){i, u, v, u - 5 - (float)(i % 40), v};
    }
    plr_frame frame = {1000000000, PLR_NO_BUDGET, (uint16_t)count, seen};
    for (int k = 0; k < 3; k++) {
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
        frame.t_ns += 100000000;
    }
    TEST_ASSERT_EQUAL_UINT(count, rig.filter.belief.count);
    TEST_ASSERT_EQUAL_UINT(count, rig.report.used);
    TEST_ASSERT_TRUE(specimen_gives_finite_numbers(&rig.filter));
}

/* With room for all it sees, a filter knows no less than with room for one. */
static void test_more_slots_know_more(void) {
    double last = (double)INFINITY;
    for (unsigned slots = 1; slots <= 32 && slots <= PLR_MAX_LANDMARKS; slots *= 4) {
        double P[36];
        rig.config.slots = (uint16_t)slots;
        rig_begin();
        rig_drive(20);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
        const double trace = P[0] + P[7] + P[14];
        TEST_ASSERT_LESS_THAN_DOUBLE(last, trace);
        last = trace;
    }
}
