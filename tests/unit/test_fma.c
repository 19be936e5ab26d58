// SPDX-License-Identifier: MIT
/* The fused multiply-add in software against the C library's, which is exact. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "pelorus/config.h"
#include "support/random.h"

static float from_bits(uint32_t bits) {
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static uint32_t to_bits(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static void assert_same(float a, float b, float c) {
    const float expected = fmaf(a, b, c);
    const float got[] = {plr_fmaf_exact(a, b, c), plr_fmaf_portable(a, b, c)};
    char message[120];
    snprintf(message, sizeof message, "%a * %a + %a", (double)a, (double)b, (double)c);
    for (int way = 0; way < 2; way++)
        if (isnan(expected))
            TEST_ASSERT_TRUE_MESSAGE(isnan(got[way]), message);
        else
            TEST_ASSERT_EQUAL_HEX32_MESSAGE(to_bits(expected), to_bits(got[way]), message);
}

static void test_any_three_bit_patterns(void) {
    rng r = rng_seeded(31);
    for (int i = 0; i < 300000; i++) {
        const uint64_t ab = rng_bits(&r), c = rng_bits(&r);
        assert_same(from_bits((uint32_t)ab), from_bits((uint32_t)(ab >> 32)),
                    from_bits((uint32_t)c));
    }
}

/* Numbers of few bits and near exponents: sums that fall halfway between two float32. */
static void test_sums_near_a_tie(void) {
    rng r = rng_seeded(32);
    for (int i = 0; i < 300000; i++) {
        const float a = (float)(1 + (int)rng_below(&r, 1 << 13)) * from_bits(0x3F000000);
        const float b = (float)(1 + (int)rng_below(&r, 1 << 13));
        const float c =
            ldexpf((float)((int)rng_below(&r, 1 << 24) - (1 << 23)), (int)rng_below(&r, 60) - 30);
        assert_same(a, b, c);
        assert_same(a, -b, c);
    }
}

/* c is all but the product, so that only its rounding error is left. */
static void test_cancellation(void) {
    rng r = rng_seeded(33);
    for (int i = 0; i < 100000; i++) {
        const float a = (float)rng_normal(&r), b = (float)rng_normal(&r);
        assert_same(a, b, -(a * b));
        assert_same(a, b, nextafterf(-(a * b), 0));
    }
}

/* Results at and below the smallest normal number, where a float32 holds fewer bits. */
static void test_subnormal_results(void) {
    rng r = rng_seeded(34);
    for (int i = 0; i < 300000; i++) {
        const float a = ldexpf((float)rng_normal(&r), -60 - (int)rng_below(&r, 20));
        const float b = ldexpf((float)rng_normal(&r), -60 - (int)rng_below(&r, 20));
        const float c = ldexpf((float)rng_normal(&r), -120 - (int)rng_below(&r, 30));
        assert_same(a, b, c);
    }
}

/* The exact product lies halfway between two float32, and an addend too small for a double to hold
 * beside it decides: rounding twice would go wrong. */
static void test_double_rounding_is_avoided(void) {
    const float halfway = 1 + ldexpf(1, -12); /* its square is 1 + 2^-11 + 2^-24 */
    for (int e = -100; e < -30; e++)
        for (int sign = -1; sign <= 1; sign += 2) {
            assert_same(halfway, halfway, (float)sign * ldexpf(1, e));
            assert_same(-halfway, halfway, (float)sign * ldexpf(1, e));
        }
}

/* The same between two subnormal numbers, which lie farther apart than their last bits in a double say. */
static void test_double_rounding_is_avoided_between_subnormals(void) {
    const float a = ldexpf(1 + ldexpf(1, -23), -75), b = ldexpf(1 - ldexpf(1, -23), -75);
    for (int k = -4; k < 4; k++) {
        const float c = ldexpf(1, -127) + (float)k * ldexpf(1, -149);
        assert_same(a, b, c); /* less than half a step above c, by 2^-196 */
        assert_same(-a, b, c);
        assert_same(a, b, -c);
    }
}

/* Sums a few double roundings beside the middle between two float32: none may be moved onto it. */
static void test_sums_just_beside_a_tie(void) {
    rng r = rng_seeded(35);
    for (int i = 0; i < 100000; i++) {
        const float a = (float)rng_uniform(&r, 1, 2), b = ldexpf(1, -24) / a;
        assert_same(a, b, 1);
        assert_same(-a, b, -1);
        assert_same(a, b, -1);
    }
}

static void test_zeros_infinities_and_the_largest_numbers(void) {
    const uint32_t special[] = {0x00000000, 0x80000000, 0x7F800000, 0xFF800000, 0x7FC00000,
                                0x00000001, 0x80000001, 0x007FFFFF, 0x00800000, 0x7F7FFFFF,
                                0xFF7FFFFF, 0x3F800000, 0xBF800000, 0x3F7FFFFF, 0x34000000};
    enum { N = sizeof special / sizeof *special };
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            for (int k = 0; k < N; k++)
                assert_same(from_bits(special[i]), from_bits(special[j]), from_bits(special[k]));
}
