// SPDX-License-Identifier: MIT
/* What comes in as double: finite, a rotation, a covariance. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "math/finite.h"
#include "math/validate.h"
#include "support/matrices.h"
#include "support/random.h"

static rng chance;

void setUp(void) {
    chance = rng_seeded(48);
}

static void test_nan_and_infinity_are_found_at_every_place(void) {
    const double bad[3] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
    double x[5] = {0, -1e308, 1e308, 5e-324, -0.0};
    TEST_ASSERT_TRUE(plr_all_finite(x, 5));
    TEST_ASSERT_TRUE(plr_all_finite(x, 0));
    for (unsigned i = 0; i < 5; i++)
        for (int k = 0; k < 3; k++) {
            const double before = x[i];
            x[i] = bad[k];
            TEST_ASSERT_FALSE(plr_all_finite(x, 5));
            x[i] = before;
        }
}

static void test_rotations_pass_and_so_do_rounded_ones(void) {
    for (int run = 0; run < 100; run++) {
        double R[9];
        random_rotation(&chance, R);
        TEST_ASSERT_TRUE(plr_is_rotation(R));
        for (int i = 0; i < 9; i++)
            R[i] = round(R[i] * 1e4) / 1e4; /* four decimals, as calibration files have them */
        TEST_ASSERT_TRUE(plr_is_rotation(R));
    }
}

static void test_what_is_no_rotation_is_refused(void) {
    static const double mirror[9] = {1, 0, 0, 0, 1, 0, 0, 0, -1}, zero[9] = {0};
    static const double sheared[9] = {1, 0.01, 0, 0, 1, 0, 0, 0, 1};
    TEST_ASSERT_FALSE(plr_is_rotation(mirror));
    TEST_ASSERT_FALSE(plr_is_rotation(zero));
    TEST_ASSERT_FALSE(plr_is_rotation(sheared));
    for (int run = 0; run < 100; run++) {
        double R[9], spoilt[9];
        random_rotation(&chance, R);
        for (int i = 0; i < 9; i++) {
            memcpy(spoilt, R, sizeof R);
            spoilt[i] += 0.1;
            TEST_ASSERT_FALSE(plr_is_rotation(spoilt));
            spoilt[i] = (double)NAN;
            TEST_ASSERT_FALSE(plr_is_rotation(spoilt));
            memcpy(spoilt, R, sizeof R);
            for (int j = 0; j < 9; j++)
                spoilt[j] *= 1.002;
            TEST_ASSERT_FALSE(plr_is_rotation(spoilt));
        }
    }
}

static void test_covariances_pass_from_tiny_to_huge(void) {
    for (int run = 0; run < 200; run++) {
        double P[36];
        const unsigned n = 1 + rng_below(&chance, 6);
        random_spd(&chance, n, 1e-3, P);
        for (unsigned i = 0; i < n; i++)
            for (unsigned j = 0; j < n; j++)
                P[n * i + j] *= pow(10, 4.0 * (double)(i + j) - 20); /* metres beside microrad */
        TEST_ASSERT_TRUE(plr_is_covariance(P, n));
    }
}

static void test_exact_directions_are_allowed(void) {
    double P[36] = {0};
    TEST_ASSERT_TRUE(plr_is_covariance(P, 6));
    P[0] = 1; /* the others stay exact */
    TEST_ASSERT_TRUE(plr_is_covariance(P, 6));
    const double line[9] = {4, 2, 0, 2, 1, 0, 0, 0, 3}; /* rank 2 */
    TEST_ASSERT_TRUE(plr_is_covariance(line, 3));
}

static void test_what_is_no_covariance_is_refused(void) {
    const double negative[4] = {1, 0, 0, -1e-9};
    const double asymmetric[4] = {1, 0.5, 0.4, 1};
    const double indefinite[4] = {1, 1.1, 1.1, 1};
    const double tied_to_exact[4] = {0, 0.5, 0.5, 1};
    const double not_a_number[4] = {1, (double)NAN, (double)NAN, 1};
    const double infinite[4] = {(double)INFINITY, 0, 0, 1};
    /* each pair is fine, the three together are not */
    const double three[9] = {1, 0.9, -0.9, 0.9, 1, 0.9, -0.9, 0.9, 1};
    TEST_ASSERT_FALSE(plr_is_covariance(negative, 2));
    TEST_ASSERT_FALSE(plr_is_covariance(asymmetric, 2));
    TEST_ASSERT_FALSE(plr_is_covariance(indefinite, 2));
    TEST_ASSERT_FALSE(plr_is_covariance(tied_to_exact, 2));
    TEST_ASSERT_FALSE(plr_is_covariance(not_a_number, 2));
    TEST_ASSERT_FALSE(plr_is_covariance(infinite, 2));
    TEST_ASSERT_FALSE(plr_is_covariance(three, 3));
}

static void test_random_matrices_are_judged_by_their_eigenvalues(void) {
    /* 2 x 2: positive if the determinant is; away from zero by more than the tolerance */
    for (int run = 0; run < 1000; run++) {
        const double a = rng_uniform(&chance, 0.1, 2), d = rng_uniform(&chance, 0.1, 2);
        const double b = rng_uniform(&chance, -2, 2), determinant = a * d - b * b;
        const double P[4] = {a, b, b, d};
        if (fabs(determinant) > 1e-4)
            TEST_ASSERT_EQUAL(determinant > 0, plr_is_covariance(P, 2));
    }
}

static void test_more_than_six_rows_are_refused(void) {
    double P[49] = {0};
    TEST_ASSERT_FALSE(plr_is_covariance(P, 7));
}

static void test_a_landmark_needs_a_place_and_a_covariance(void) {
    double p[3] = {1, 2, 3}, P[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    TEST_ASSERT_TRUE(plr_is_place(p, P));
    p[1] = (double)INFINITY;
    TEST_ASSERT_FALSE(plr_is_place(p, P));
    p[1] = 2;
    P[4] = -1;
    TEST_ASSERT_FALSE(plr_is_place(p, P));
}
