// SPDX-License-Identifier: MIT
/* Vectors of 3 and matrices of 3x3. */
#include <math.h>
#include <unity.h>

#include "math/small.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/random.h"

enum { RUNS = 300 };

static const double eps = REAL_EPSILON;

/* n normal numbers in the filter's precision, and the same in double. */
static void random_pair(rng *r, plr_real *x, double *twin, size_t n) {
    rng_normals(r, 1, twin, n);
    round_to_real(twin, n);
    to_reals(x, twin, n);
}

static void assert_close(double tolerance, const double *expected, const plr_real *got, size_t n) {
    double twin[9];
    to_doubles(twin, got, n);
    TEST_ASSERT_DOUBLE_WITHIN(tolerance, 0, largest_difference(expected, twin, n));
}

static void test_products_agree_with_openblas(void) {
    rng r = rng_seeded(41);
    for (int run = 0; run < RUNS; run++) {
        plr_real A[9], B[9], C[9];
        double a[9], b[9], c[9];
        random_pair(&r, A, a, 9);
        random_pair(&r, B, b, 9);
        plr_mat3_mul(C, A, B);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 3, 3, 1, a, b, 0, c);
        assert_close(30 * eps, c, C, 9);
        plr_mat3_mul_nt(C, A, B);
        oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, 3, 3, 3, 1, a, b, 0, c);
        assert_close(30 * eps, c, C, 9);
        plr_mat3_mul_tn(C, A, B);
        oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, 3, 3, 3, 1, a, b, 0, c);
        assert_close(30 * eps, c, C, 9);
    }
}

static void test_products_with_a_vector_agree_with_openblas(void) {
    rng r = rng_seeded(42);
    for (int run = 0; run < RUNS; run++) {
        plr_real A[9], x[3], y[3];
        double a[9], x_twin[3], y_twin[3];
        random_pair(&r, A, a, 9);
        random_pair(&r, x, x_twin, 3);
        plr_mat3_vec(y, A, x);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 3, 1, a, x_twin, 0, y_twin);
        assert_close(30 * eps, y_twin, y, 3);
        plr_mat3_tvec(y, A, x);
        oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, 3, 1, 3, 1, a, x_twin, 0, y_twin);
        assert_close(30 * eps, y_twin, y, 3);
    }
}

static void test_cross_is_skew_times_vector_and_orthogonal_to_both(void) {
    rng r = rng_seeded(43);
    for (int run = 0; run < RUNS; run++) {
        plr_real a[3], b[3], c[3], S[9], Sb[3];
        double twin[3];
        random_pair(&r, a, twin, 3);
        random_pair(&r, b, twin, 3);
        plr_cross3(c, a, b);
        plr_skew(S, a);
        plr_mat3_vec(Sb, S, b);
        to_doubles(twin, Sb, 3);
        assert_close(30 * eps, twin, c, 3);
        TEST_ASSERT_DOUBLE_WITHIN(60 * eps, 0, (double)plr_dot3(a, c));
        TEST_ASSERT_DOUBLE_WITHIN(60 * eps, 0, (double)plr_dot3(b, c));
    }
}

static void test_cross_follows_the_right_hand(void) {
    const plr_real x[3] = {1, 0, 0}, y[3] = {0, 1, 0};
    plr_real z[3];
    plr_cross3(z, x, y);
    const double up[3] = {0, 0, 1};
    assert_close(0, up, z, 3);
}

static void test_skew_is_antisymmetric_to_the_bit(void) {
    const plr_real x[3] = {PLR_R(0.1), PLR_R(-2.3), PLR_R(1e-20)};
    plr_real S[9];
    plr_skew(S, x);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            TEST_ASSERT_TRUE(S[3 * i + j] == -S[3 * j + i]);
}

static void test_transpose_and_identity(void) {
    rng r = rng_seeded(44);
    plr_real A[9], At[9], I[9], AI[9];
    double twin[9];
    random_pair(&r, A, twin, 9);
    plr_mat3_transpose(At, A);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            TEST_ASSERT_TRUE(At[3 * i + j] == A[3 * j + i]);
    plr_mat3_identity(I);
    plr_mat3_mul(AI, A, I);
    assert_close(0, twin, AI, 9);
}

static void test_abs_and_finite(void) {
    TEST_ASSERT_TRUE(plr_abs(PLR_R(-2.5)) == PLR_R(2.5));
    TEST_ASSERT_TRUE(plr_abs(PLR_R(2.5)) == PLR_R(2.5));
    TEST_ASSERT_TRUE(plr_is_finite(0) && plr_is_finite(PLR_R(-1e30)));
    TEST_ASSERT_FALSE(plr_is_finite((plr_real)NAN));
    TEST_ASSERT_FALSE(plr_is_finite((plr_real)INFINITY));
    TEST_ASSERT_FALSE(plr_is_finite(-(plr_real)INFINITY));
}
