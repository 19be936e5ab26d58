// SPDX-License-Identifier: MIT
/* The slots: who is found, who is evicted, who takes whose place (MATH 13). */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "state/covariance.h"
#include "state/slots.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/specimens.h"

enum { LANDMARKS = 6 };

static plr_filter filter, before;
static rng chance;
static plr_landmark taken;
static unsigned handed_over;
static int answer; /* of the sink */

static int sink(void *context, const plr_landmark *landmark) {
    TEST_ASSERT_EQUAL_PTR(&taken, context);
    taken = *landmark;
    handed_over++;
    return answer;
}

void setUp(void) {
    chance = rng_seeded(50);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, true, LANDMARKS);
    filter.map = (plr_map){.context = &taken, .sink = sink};
    filter.belief.capacity = LANDMARKS;
    filter.belief.frame_number = 10;
    handed_over = 0;
    answer = 0;
}

static void seen_in(const uint32_t frames[LANDMARKS]) {
    for (unsigned slot = 0; slot < LANDMARKS; slot++)
        filter.belief.slots[slot].last_frame = frames[slot];
}

static bool make_room(uint16_t *evicted, bool *sink_failed) {
    *evicted = 0;
    *sink_failed = false;
    return plr_slots_make_room(&filter.belief, &filter.camera, &filter.motion, &filter.map, evicted,
                               sink_failed);
}

static void test_a_landmark_is_found_by_its_id(void) {
    for (uint32_t id = 1; id <= LANDMARKS; id++)
        TEST_ASSERT_EQUAL_UINT16(id - 1, plr_slots_find(&filter.belief, id));
    TEST_ASSERT_EQUAL_UINT16(PLR_NO_SLOT, plr_slots_find(&filter.belief, LANDMARKS + 1));
    TEST_ASSERT_EQUAL_UINT16(PLR_NO_SLOT, plr_slots_find(&filter.belief, 0));
    filter.belief.count = 3; /* what lies beyond is no landmark any more */
    TEST_ASSERT_EQUAL_UINT16(PLR_NO_SLOT, plr_slots_find(&filter.belief, 4));
}

static void test_a_free_slot_costs_no_landmark(void) {
    uint16_t evicted;
    bool sink_failed;
    filter.belief.capacity = LANDMARKS + 1;
    TEST_ASSERT_TRUE(make_room(&evicted, &sink_failed));
    TEST_ASSERT_EQUAL_UINT(0, evicted);
    TEST_ASSERT_EQUAL_UINT(0, handed_over);
    TEST_ASSERT_EQUAL_UINT(LANDMARKS, filter.belief.count);
}

static void test_the_landmark_longest_unseen_goes(void) {
    uint16_t evicted;
    bool sink_failed;
    seen_in((const uint32_t[LANDMARKS]){10, 4, 7, 3, 9, 8});
    TEST_ASSERT_TRUE(make_room(&evicted, &sink_failed));
    TEST_ASSERT_EQUAL_UINT(1, evicted);
    TEST_ASSERT_FALSE(sink_failed);
    TEST_ASSERT_EQUAL_UINT(1, handed_over);
    TEST_ASSERT_EQUAL_UINT32(4, taken.id);
    TEST_ASSERT_EQUAL_UINT16(PLR_NO_SLOT, plr_slots_find(&filter.belief, 4));
}

static void test_of_equals_the_lowest_slot_goes(void) {
    uint16_t evicted;
    bool sink_failed;
    seen_in((const uint32_t[LANDMARKS]){10, 5, 5, 5, 9, 5});
    TEST_ASSERT_TRUE(make_room(&evicted, &sink_failed));
    TEST_ASSERT_EQUAL_UINT32(2, taken.id);
}

static void test_what_was_seen_in_this_frame_never_goes(void) {
    uint16_t evicted;
    bool sink_failed;
    seen_in((const uint32_t[LANDMARKS]){10, 10, 10, 10, 10, 10});
    before = filter;
    TEST_ASSERT_FALSE(make_room(&evicted, &sink_failed));
    TEST_ASSERT_FALSE(sink_failed);
    TEST_ASSERT_EQUAL_UINT(0, evicted);
    TEST_ASSERT_EQUAL_UINT(0, handed_over);
    TEST_ASSERT_EQUAL_MEMORY(&before, &filter, sizeof filter);
}

static void test_ages_are_right_when_the_frame_number_wraps(void) {
    uint16_t evicted;
    bool sink_failed;
    filter.belief.frame_number = 2;
    seen_in((const uint32_t[LANDMARKS]){2, 1, UINT32_MAX, UINT32_MAX - 5, 0, UINT32_MAX - 2});
    TEST_ASSERT_TRUE(make_room(&evicted, &sink_failed));
    TEST_ASSERT_EQUAL_UINT32(4, taken.id);
}

static void test_a_sink_that_fails_keeps_the_landmark(void) {
    uint16_t evicted;
    bool sink_failed;
    seen_in((const uint32_t[LANDMARKS]){10, 4, 7, 3, 9, 8});
    answer = -1;
    before = filter;
    TEST_ASSERT_FALSE(make_room(&evicted, &sink_failed));
    TEST_ASSERT_TRUE(sink_failed);
    TEST_ASSERT_EQUAL_UINT(0, evicted);
    TEST_ASSERT_EQUAL_UINT(1, handed_over);
    TEST_ASSERT_EQUAL_MEMORY(&before, &filter, sizeof filter);
}

static void test_without_a_sink_the_landmark_is_dropped(void) {
    uint16_t evicted;
    bool sink_failed;
    seen_in((const uint32_t[LANDMARKS]){10, 4, 7, 3, 9, 8});
    filter.map.sink = NULL;
    TEST_ASSERT_TRUE(make_room(&evicted, &sink_failed));
    TEST_ASSERT_EQUAL_UINT(1, evicted);
    TEST_ASSERT_EQUAL_UINT16(PLR_NO_SLOT, plr_slots_find(&filter.belief, 4));
}

/* The marginal of the others is what it was: rows and columns of one landmark go, no number of the
 * rest changes. */
static void test_removal_leaves_the_marginal_of_the_others(void) {
    for (unsigned slot = 0; slot < LANDMARKS; slot++) {
        setUp();
        before = filter;
        plr_slots_remove(&filter.belief, slot);
        TEST_ASSERT_EQUAL_UINT(LANDMARKS - 1, filter.belief.count);
        for (uint32_t a = 1; a <= LANDMARKS; a++) {
            const uint16_t to = plr_slots_find(&filter.belief, a), from = (uint16_t)(a - 1);
            if (from == slot) {
                TEST_ASSERT_EQUAL_UINT16(PLR_NO_SLOT, to);
                continue;
            }
            TEST_ASSERT_EQUAL_MEMORY(&before.belief.slots[from], &filter.belief.slots[to],
                                     sizeof(plr_slot));
            plr_landmark was, is;
            plr_slots_export(&before.belief, &before.camera, &before.motion, from,
                             &was); /* its place and its block, with the pose's */
            plr_slots_export(&filter.belief, &filter.camera, &filter.motion, to, &is);
            TEST_ASSERT_DOUBLE_WITHIN(0, 0, largest_difference(was.P_W_m2, is.P_W_m2, 9));
            TEST_ASSERT_DOUBLE_WITHIN(0, 0, largest_difference(was.p_W_m, is.p_W_m, 3));
        }
    }
}

static void test_an_appended_landmark_is_new_and_seen_now(void) {
    const plr_new_landmark landmark = {.x = {1, 2, 3}, .P = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    filter.belief.count = 2;
    memset(&filter.belief.slots[2], 0xFF,
           sizeof filter.belief.slots[2]); /* what lay there before is gone */
    plr_slots_append(&filter.belief, 77, false, &landmark);
    const plr_slot *slot = &filter.belief.slots[2];
    TEST_ASSERT_EQUAL_UINT(3, filter.belief.count);
    TEST_ASSERT_EQUAL_UINT32(77, slot->id);
    TEST_ASSERT_EQUAL_UINT32(1, slot->times_seen);
    TEST_ASSERT_EQUAL_UINT32(0, slot->times_gated);
    TEST_ASSERT_EQUAL_UINT32(10, slot->last_frame);
    TEST_ASSERT_EQUAL_UINT64(filter.belief.t_ns, slot->last_seen_ns);
    TEST_ASSERT_EQUAL_UINT8(0, slot->known);
    TEST_ASSERT_EQUAL_DOUBLE(3, (double)slot->x[2]);
}

static void test_a_known_landmark_is_not_seen_by_being_known(void) {
    const plr_new_landmark landmark = {.x = {1, 2, 3}, .P = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    filter.belief.count = 2;
    plr_slots_append(&filter.belief, 77, true, &landmark);
    TEST_ASSERT_EQUAL_UINT32(0, filter.belief.slots[2].times_seen);
    TEST_ASSERT_EQUAL_UINT8(1, filter.belief.slots[2].known);
}

static void test_export_is_symmetric_and_holds_the_counts(void) {
    filter.belief.slots[3].times_seen = 12;
    filter.belief.slots[3].times_gated = 4;
    filter.belief.slots[3].last_seen_ns = 99;
    filter.belief.slots[3].known = 1;
    plr_landmark landmark;
    plr_slots_export(&filter.belief, &filter.camera, &filter.motion, 3, &landmark);
    TEST_ASSERT_EQUAL_UINT32(4, landmark.id);
    TEST_ASSERT_EQUAL_UINT32(12, landmark.times_seen);
    TEST_ASSERT_EQUAL_UINT32(4, landmark.times_gated);
    TEST_ASSERT_EQUAL_UINT64(99, landmark.last_seen_ns);
    TEST_ASSERT_TRUE(landmark.known);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            TEST_ASSERT_DOUBLE_WITHIN(0, landmark.P_W_m2[3 * i + j], landmark.P_W_m2[3 * j + i]);
    TEST_ASSERT_GREATER_THAN_DOUBLE(0, oracle_smallest_eigenvalue(3, landmark.P_W_m2));
}
