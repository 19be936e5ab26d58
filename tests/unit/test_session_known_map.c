// SPDX-License-Identifier: MIT
/* Known landmarks: kept in order, found by id, refused where they make no sense. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "session/known_map.h"
#include "support/random.h"

enum { CAPACITY = 100 };

static plr_landmark memory[CAPACITY];
static plr_known_map map;

void setUp(void) {
    plr_known_map_init(&map, memory, CAPACITY);
}

static plr_landmark landmark(uint32_t id) {
    plr_landmark l;
    memset(&l, 0, sizeof l);
    l.id = id;
    l.p_W_m[0] = id;
    return l;
}

static plr_status add(uint32_t id) {
    const plr_landmark l = landmark(id);
    return plr_known_map_add(&map, &l);
}

static void test_landmarks_in_any_order_are_all_found_and_no_others(void) {
    rng r = rng_seeded(3);
    bool given[1000] = {false};
    while (map.count < CAPACITY) {
        const unsigned id = rng_below(&r, 1000);
        TEST_ASSERT_EQUAL_INT(given[id] ? PLR_E_EXISTS : PLR_OK, add(id));
        given[id] = true;
    }
    for (uint32_t id = 0; id < 1000; id++) {
        plr_landmark found;
        TEST_ASSERT_EQUAL(given[id], plr_known_map_source(&map, id, &found));
        if (given[id])
            TEST_ASSERT_EQUAL_DOUBLE(id, found.p_W_m[0]);
    }
    for (unsigned i = 1; i < map.count; i++)
        TEST_ASSERT_TRUE(memory[i - 1].id < memory[i].id);
}

static void test_a_full_map_refuses_new_ids_and_stays_as_it_is(void) {
    for (uint32_t id = 0; id < CAPACITY; id++)
        TEST_ASSERT_EQUAL_INT(PLR_OK, add(2 * id));
    TEST_ASSERT_EQUAL_INT(PLR_E_FULL, add(7));
    TEST_ASSERT_EQUAL_INT(PLR_E_EXISTS, add(8));
    TEST_ASSERT_EQUAL_UINT(CAPACITY, map.count);
    TEST_ASSERT_FALSE(plr_known_map_source(&map, 7, &memory[0]));
}

static void test_a_map_without_memory_is_full(void) {
    plr_known_map_init(&map, NULL, 10);
    TEST_ASSERT_EQUAL_INT(PLR_E_FULL, add(1));
    TEST_ASSERT_FALSE(plr_known_map_source(&map, 1, &memory[0]));
}

static void test_numbers_that_are_not_finite_are_refused(void) {
    plr_landmark l = landmark(1);
    l.p_W_m[2] = (double)NAN;
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_FINITE, plr_known_map_add(&map, &l));
    l = landmark(1);
    l.P_W_m2[8] = (double)INFINITY;
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_FINITE, plr_known_map_add(&map, &l));
    TEST_ASSERT_EQUAL_UINT(0, map.count);
}

static void test_the_source_answers_as_the_filter_expects(void) {
    plr_landmark found = landmark(99);
    TEST_ASSERT_EQUAL_INT(PLR_OK, add(5));
    TEST_ASSERT_FALSE(plr_known_map_source(&map, 6, &found));
    TEST_ASSERT_EQUAL_UINT32(99, found.id);
    TEST_ASSERT_TRUE(plr_known_map_source(&map, 5, &found));
    TEST_ASSERT_EQUAL_UINT32(5, found.id);
    TEST_ASSERT_TRUE(found.known);
}
