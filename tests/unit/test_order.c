// SPDX-License-Identifier: MIT
/* Heapsort of index arrays, against the sort of the C library. */
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "math/order.h"
#include "support/random.h"

enum { MOST = 300 };

static uint32_t keys[MOST];
static unsigned comparisons;
static rng chance;

void setUp(void) {
    chance = rng_seeded(47);
    comparisons = 0;
}

static bool key_before(const void *context, uint16_t a, uint16_t b) {
    const uint32_t *key = context;
    comparisons++;
    return key[a] < key[b] || (key[a] == key[b] && a < b);
}

static int compare(const void *a, const void *b) {
    const uint16_t i = *(const uint16_t *)a, j = *(const uint16_t *)b;
    if (keys[i] != keys[j])
        return keys[i] < keys[j] ? -1 : 1;
    return i < j ? -1 : i > j;
}

/* Sorts 0 .. n-1, shuffled, by keys that have been filled in. */
static void sort_and_check(unsigned n) {
    uint16_t indices[MOST], expected[MOST];
    for (unsigned i = 0; i < n; i++)
        indices[i] = (uint16_t)i;
    for (unsigned i = n; i > 1; i--) {
        const unsigned j = rng_below(&chance, i);
        const uint16_t swapped = indices[i - 1];
        indices[i - 1] = indices[j];
        indices[j] = swapped;
    }
    memcpy(expected, indices, n * sizeof *expected);
    qsort(expected, n, sizeof *expected, compare);
    plr_order_sort(indices, n, key_before, keys);
    if (n > 0)
        TEST_ASSERT_EQUAL_UINT16_ARRAY(expected, indices, n);
}

static void test_every_length_is_sorted(void) {
    for (unsigned n = 0; n <= MOST; n++) {
        for (unsigned i = 0; i < n; i++)
            keys[i] = (uint32_t)rng_bits(&chance);
        sort_and_check(n);
    }
}

static void test_equal_keys_follow_the_order_of_ties(void) {
    for (unsigned n = 0; n <= 60; n++) {
        for (unsigned i = 0; i < n; i++)
            keys[i] = rng_below(&chance, 4);
        sort_and_check(n);
    }
}

static void test_sorted_and_reversed_arrays_are_no_worse(void) {
    /* heapsort's bound: 2 n log2 n comparisons and a few */
    const unsigned bound = 2 * MOST * 9;
    for (int direction = 0; direction < 2; direction++) {
        uint16_t indices[MOST];
        for (unsigned i = 0; i < MOST; i++) {
            keys[i] = i;
            indices[i] = (uint16_t)(direction ? MOST - 1 - i : i);
        }
        comparisons = 0;
        plr_order_sort(indices, MOST, key_before, keys);
        for (unsigned i = 0; i < MOST; i++)
            TEST_ASSERT_EQUAL_UINT16(i, indices[i]);
        TEST_ASSERT_LESS_THAN_UINT(bound, comparisons);
    }
}

static void test_nothing_beyond_the_end_is_touched(void) {
    uint16_t indices[6] = {4, 2, 0, 77, 78, 79};
    for (unsigned i = 0; i < 6; i++)
        keys[i] = i;
    plr_order_sort(indices, 3, key_before, keys);
    const uint16_t expected[6] = {0, 2, 4, 77, 78, 79};
    TEST_ASSERT_EQUAL_UINT16_ARRAY(expected, indices, 6);
}
