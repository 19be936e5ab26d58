// SPDX-License-Identifier: MIT
/* The random numbers that the other tests rest on. */
#include <math.h>
#include <unity.h>

#include "support/random.h"

static void test_same_seed_gives_same_numbers(void) {
    rng a = rng_seeded(7), b = rng_seeded(7), c = rng_seeded(8);
    const uint64_t first = rng_bits(&a);
    TEST_ASSERT_EQUAL_UINT64(first, rng_bits(&b));
    TEST_ASSERT_NOT_EQUAL_UINT64(first, rng_bits(&c));
}

/* First outputs for seed 0 as the generator's authors publish them. */
static void test_bits_are_splitmix64(void) {
    rng r = rng_seeded(0);
    TEST_ASSERT_EQUAL_HEX64(UINT64_C(0xE220A8397B1DCDAF), rng_bits(&r));
    TEST_ASSERT_EQUAL_HEX64(UINT64_C(0x6E789E6AA1B965F4), rng_bits(&r));
}

static void test_uniform_fills_its_interval_and_no_more(void) {
    rng r = rng_seeded(1);
    double least = 3, most = -2;
    for (int i = 0; i < 10000; i++) {
        const double x = rng_uniform(&r, -2, 3);
        least = fmin(least, x);
        most = fmax(most, x);
    }
    TEST_ASSERT_TRUE(least >= -2 && least < -1.99);
    TEST_ASSERT_TRUE(most < 3 && most > 2.99);
}

static void test_below_reaches_every_number(void) {
    rng r = rng_seeded(2);
    unsigned seen[7] = {0};
    for (int i = 0; i < 1000; i++)
        seen[rng_below(&r, 7)]++;
    for (int i = 0; i < 7; i++)
        TEST_ASSERT_GREATER_THAN_UINT(90, seen[i]);
}

static void test_normals_have_the_moments_of_a_normal(void) {
    enum { N = 100000 };
    static double x[N];
    rng r = rng_seeded(3);
    rng_normals(&r, 2, x, N);
    double mean = 0, variance = 0, fourth = 0;
    for (int i = 0; i < N; i++) {
        mean += x[i] / N;
        variance += x[i] * x[i] / N;
        fourth += x[i] * x[i] * x[i] * x[i] / N;
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 0, mean);
    TEST_ASSERT_DOUBLE_WITHIN(0.08, 4, variance);
    TEST_ASSERT_DOUBLE_WITHIN(2, 48, fourth);
}
