// SPDX-License-Identifier: MIT
/* SO(3): the series against closed forms in long double and against the matrix exponential. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "math/small.h"
#include "math/so3.h"
#include "support/matrices.h"
#include "support/random.h"
#include "support/rigid.h"

enum { RUNS = 500 };

static const double eps = REAL_EPSILON;
static const double pi = 3.14159265358979323846;

/* A rotation vector of the given length, rounded, and the same in the filter's precision. */
static void random_theta(rng *r, double length, double twin[3], plr_real theta[3]) {
    random_direction(r, length, twin, 3);
    round_to_real(twin, 3);
    to_reals(theta, twin, 3);
}

/* The rotation of the matrix exponential. */
static void exponential(double R[9], const double theta[3]) {
    const double xi[6] = {0, 0, 0, theta[0], theta[1], theta[2]};
    double M[16];
    rigid_exp(M, xi);
    for (int i = 0; i < 3; i++)
        memcpy(R + 3 * i, M + 4 * i, 3 * sizeof *R);
}

/* Asserts that a coefficient is right to 4 roundings of its first term, 1 / whole. Towards pi the
 * terms all but cancel in `a`, therefore not of its value. */
static void assert_coefficient(int whole, long double expected, plr_real got) {
    TEST_ASSERT_DOUBLE_WITHIN(4 * eps / whole, (double)expected, (double)got);
}

/* Closed forms lose digits to cancellation at small t; from 0.5 on, long double has enough. */
static void test_series_agree_with_closed_forms(void) {
    for (int i = 0; i <= 100; i++) {
        const long double most = (long double)pi, t_wanted = 0.5L + (most - 0.5L) * i / 100;
        const plr_real theta2 = (plr_real)(t_wanted * t_wanted);
        const long double t = sqrtl((long double)theta2), t2 = t * t;
        const long double s = sinl(t), c = cosl(t);
        plr_so3_series got;
        plr_so3_series_at(&got, theta2);
        assert_coefficient(1, s / t, got.a);
        assert_coefficient(2, (1 - c) / t2, got.b);
        assert_coefficient(6, (t - s) / (t2 * t), got.c);
        assert_coefficient(24, (t2 + 2 * c - 2) / (2 * t2 * t2), got.d);
        assert_coefficient(120, (2 * t - 3 * s + t * c) / (2 * t2 * t2 * t), got.e);
    }
}

/* Near zero the first three terms of each series are the value. */
static void test_series_begin_at_their_limits(void) {
    const double lengths[] = {0, 1e-12, 1e-6, 1e-4, 1e-3};
    for (int i = 0; i < 5; i++) {
        const long double x = (long double)lengths[i] * (long double)lengths[i];
        plr_so3_series got;
        plr_so3_series_at(&got, (plr_real)x);
        assert_coefficient(1, 1 - x / 6 + x * x / 120, got.a);
        assert_coefficient(2, 1.0L / 2 - x / 24 + x * x / 720, got.b);
        assert_coefficient(6, 1.0L / 6 - x / 120 + x * x / 5040, got.c);
        assert_coefficient(24, 1.0L / 24 - x / 720 + x * x / 40320, got.d);
        assert_coefficient(120, 1.0L / 120 - x / 2520 + x * x / 120960, got.e);
    }
}

static void test_exp_agrees_with_the_matrix_exponential(void) {
    rng r = rng_seeded(51);
    for (int run = 0; run < RUNS; run++) {
        const double length = run % 2 == 0 ? pi * run / RUNS : pow(10, -12.0 * run / RUNS);
        double twin[3], expected[9], got[9];
        plr_real theta[3], R[9];
        random_theta(&r, length, twin, theta);
        exponential(expected, twin);
        plr_so3_exp(R, theta);
        to_doubles(got, R, 9);
        char message[40];
        snprintf(message, sizeof message, "|theta| = %g", length);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(8 * eps, 0, largest_difference(expected, got, 9),
                                          message);
    }
}

static void test_exp_of_zero_is_exactly_identity(void) {
    const plr_real zero[3] = {0, 0, 0};
    plr_real R[9], I[9];
    plr_so3_exp(R, zero);
    plr_mat3_identity(I);
    for (int i = 0; i < 9; i++)
        TEST_ASSERT_TRUE(R[i] == I[i]);
}

static void test_exp_of_minus_theta_is_the_transpose(void) {
    rng r = rng_seeded(52);
    for (int run = 0; run < RUNS; run++) {
        double twin[3];
        plr_real theta[3], minus[3], R[9], S[9], Rt[9];
        random_theta(&r, pi * run / RUNS, twin, theta);
        for (int i = 0; i < 3; i++)
            minus[i] = -theta[i];
        plr_so3_exp(R, theta);
        plr_so3_exp(S, minus);
        plr_mat3_transpose(Rt, R);
        double a[9], b[9];
        to_doubles(a, Rt, 9);
        to_doubles(b, S, 9);
        TEST_ASSERT_DOUBLE_WITHIN(2 * eps, 0, largest_difference(a, b, 9));
    }
}

/* max |R^T R - I| in double, so that only R's own error shows. */
static double distance_to_orthonormal(const plr_real R[9]) {
    double most = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double sum = i == j ? -1 : 0;
            for (int k = 0; k < 3; k++)
                sum += (double)R[3 * k + i] * (double)R[3 * k + j];
            most = fmax(most, fabs(sum));
        }
    return most;
}

static void test_orthonormalise_squares_the_error_away(void) {
    rng r = rng_seeded(53);
    const double errors[] = {1e-2, 1e-3, 1e-4, 1e-6};
    for (int run = 0; run < RUNS; run++) {
        const double error = errors[run % 4];
        double twin[9];
        plr_real R[9];
        random_rotation(&r, twin);
        for (int i = 0; i < 9; i++)
            twin[i] += error * rng_uniform(&r, -1, 1);
        to_reals(R, twin, 9);
        plr_so3_orthonormalise(R);
        TEST_ASSERT_LESS_OR_EQUAL_DOUBLE(20 * error * error + 8 * eps, distance_to_orthonormal(R));
    }
}

/* It moves R by no more than R was off: it does not turn it. */
static void test_orthonormalise_leaves_a_rotation_alone(void) {
    rng r = rng_seeded(54);
    for (int run = 0; run < RUNS; run++) {
        double twin[9], after[9];
        plr_real R[9];
        random_rotation(&r, twin);
        round_to_real(twin, 9);
        to_reals(R, twin, 9);
        plr_so3_orthonormalise(R);
        to_doubles(after, R, 9);
        TEST_ASSERT_DOUBLE_WITHIN(4 * eps, 0, largest_difference(twin, after, 9));
    }
}

/* The same in small numbers: (I + E) of a turn comes out as good a rotation, and what a small turn is
 * off by is squared away at its own size. */
static void test_orthonormalise_of_a_small_turn_is_the_same(void) {
    rng r = rng_seeded(55);
    for (int run = 0; run < RUNS; run++) {
        const double length = run % 2 == 0 ? pi * run / RUNS : pow(10, -9.0 * run / RUNS);
        double twin[3], before[9], after[9];
        plr_real theta[3], E[9], R[9];
        random_theta(&r, length, twin, theta);
        plr_so3_expm1(E, theta);
        to_doubles(before, E, 9);
        plr_so3_orthonormalise_small(E);
        to_doubles(after, E, 9);
        TEST_ASSERT_DOUBLE_WITHIN(8 * eps * fmin(1, length), 0,
                                  largest_difference(before, after, 9));

        for (int i = 0; i < 9; i++)
            E[i] = (plr_real)(before[i] + 1e-3 * length * rng_uniform(&r, -1, 1));
        plr_so3_orthonormalise_small(E);
        for (int i = 0; i < 9; i++)
            R[i] = E[i] + (i % 4 == 0 ? PLR_R(1) : PLR_R(0));
        TEST_ASSERT_LESS_OR_EQUAL_DOUBLE(20e-6 * length * length + 8 * eps,
                                         distance_to_orthonormal(R));
    }
}

static void test_a_million_steps_stay_a_rotation(void) {
    plr_real R[9], step[9], product[9];
    const plr_real theta[3] = {PLR_R(0.01), PLR_R(-0.02), PLR_R(0.005)};
    plr_mat3_identity(R);
    plr_so3_exp(step, theta);
    for (int k = 0; k < 1000000; k++) {
        plr_mat3_mul(product, R, step);
        memcpy(R, product, sizeof R);
        plr_so3_orthonormalise(R);
    }
    TEST_ASSERT_LESS_OR_EQUAL_DOUBLE(8 * eps, distance_to_orthonormal(R));
}

/* Back to the vector, up to 3 rad: there 1 + cos t has lost two digits. */
static void test_the_logarithm_undoes_the_exponential(void) {
    rng r = rng_seeded(29);
    for (int i = 0; i < RUNS; i++) {
        double twin[3];
        plr_real theta[3], R[9], back[3];
        random_theta(&r, 3.0 * i / RUNS, twin, theta);
        plr_so3_exp(R, theta);
        plr_so3_log(back, R);
        for (int k = 0; k < 3; k++)
            TEST_ASSERT_DOUBLE_WITHIN(200 * eps, twin[k], (double)back[k]);
    }
}
