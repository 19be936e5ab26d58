// SPDX-License-Identifier: MIT
/* Lists that grow, and their quantiles. */
#include <math.h>
#include <unity.h>

#include "posix/samples.h"
#include "support/random.h"

static samples list;

void setUp(void) {
    samples_init(&list, sizeof(double));
}

void tearDown(void) {
    samples_free(&list);
}

static void add(double x) {
    samples_add(&list, &x);
}

static void test_what_is_added_is_kept_in_order_over_many_growths(void) {
    for (int i = 0; i < 100000; i++)
        add(i);
    TEST_ASSERT_EQUAL_size_t(100000, list.count);
    TEST_ASSERT_FALSE(list.out_of_memory);
    for (int i = 0; i < 100000; i += 37)
        TEST_ASSERT_EQUAL_DOUBLE(i, ((double *)list.items)[i]);
}

/* Of 1 to n, the quantile of share s is the ceil(s n)-th. */
static void test_quantiles_are_the_nearest_rank(void) {
    rng r = rng_seeded(1);
    double order[200];
    for (int i = 0; i < 200; i++)
        order[i] = i + 1;
    for (unsigned i = 199; i > 0; i--) {
        const unsigned j = rng_below(&r, i + 1);
        const double kept = order[i];
        order[i] = order[j];
        order[j] = kept;
    }
    for (int i = 0; i < 200; i++)
        add(order[i]);
    samples_sort_doubles(&list);
    TEST_ASSERT_EQUAL_DOUBLE(100, samples_quantile(&list, 0.5));
    TEST_ASSERT_EQUAL_DOUBLE(198, samples_quantile(&list, 0.99));
    TEST_ASSERT_EQUAL_DOUBLE(200, samples_quantile(&list, 1));
    TEST_ASSERT_EQUAL_DOUBLE(1, samples_quantile(&list, 0));
}

static void test_a_single_sample_is_every_quantile_and_none_is_no_number(void) {
    TEST_ASSERT_TRUE(isnan(samples_quantile(&list, 0.5)));
    samples_sort_doubles(&list);
    add(7);
    TEST_ASSERT_EQUAL_DOUBLE(7, samples_quantile(&list, 0.5));
    TEST_ASSERT_EQUAL_DOUBLE(7, samples_quantile(&list, 1));
}
