// SPDX-License-Identifier: MIT
/* Dense kernels against OpenBLAS and LAPACKE, over all small sizes and odd strides. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "linalg/dense.h"
#include "linalg/packed.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/random.h"

enum { MOST = 9, STRIDE = 13, BIGGEST = 40 };

static const double eps = REAL_EPSILON;

void setUp(void) {
}

void tearDown(void) {
}

/* A rows x columns matrix with leading dimension ld, its gaps filled with 1e30, and its gapless
 * double twin. */
static void random_strided(rng *r, unsigned rows, unsigned columns, size_t ld, plr_real *A,
                           double *twin) {
    for (size_t i = 0; i < rows * ld; i++)
        A[i] = PLR_R(1e30);
    for (unsigned i = 0; i < rows; i++)
        for (unsigned j = 0; j < columns; j++) {
            A[i * ld + j] = (plr_real)rng_normal(r);
            twin[i * columns + j] = (double)A[i * ld + j];
        }
}

/* Asserts that C, with gaps, is `twin` within a tolerance, and that the gaps are untouched. */
static void assert_strided(double tolerance, const double *twin, const plr_real *C, unsigned rows,
                           unsigned columns, size_t ld, const char *message) {
    for (unsigned i = 0; i < rows; i++) {
        for (unsigned j = 0; j < columns; j++)
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(tolerance, twin[i * columns + j],
                                              (double)C[i * ld + j], message);
        for (size_t j = columns; j < ld; j++)
            TEST_ASSERT_TRUE_MESSAGE(C[i * ld + j] == PLR_R(1e30), message);
    }
}

static void gemm_against_oracle(rng *r, unsigned m, unsigned n, unsigned k) {
    plr_real A[MOST * STRIDE], B[MOST * STRIDE], Bt[MOST * STRIDE], C[MOST * STRIDE];
    plr_real also_C[MOST * STRIDE];
    double a[MOST * MOST], b[MOST * MOST], c[MOST * MOST];
    const size_t lda = k + rng_below(r, 4), ldb = n + rng_below(r, 4), ldc = n + rng_below(r, 4);
    const size_t ldbt = k + rng_below(r, 4);
    random_strided(r, m, k, lda, A, a);
    random_strided(r, k, n, ldb, B, b);
    random_strided(r, m, n, ldc, C, c);
    memcpy(also_C, C, sizeof C);
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < k; j++)
            Bt[i * ldbt + j] = B[j * ldb + i];

    char message[64];
    snprintf(message, sizeof message, "m %u, n %u, k %u", m, n, k);
    plr_gemm_nn(m, n, k, A, lda, B, ldb, C, ldc);
    plr_gemm_nt(m, n, k, A, lda, Bt, ldbt, also_C, ldc);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, m, n, k, 1, a, b, 1, c);
    assert_strided(50 * eps, c, C, m, n, ldc, message);
    for (unsigned i = 0; i < m; i++)
        TEST_ASSERT_TRUE_MESSAGE(same_bits(C + i * ldc, also_C + i * ldc, n), message);
}

static void test_gemm_agrees_with_openblas_and_both_forms_bit_for_bit(void) {
    rng r = rng_seeded(21);
    for (unsigned m = 1; m <= MOST; m++)
        for (unsigned n = 1; n <= MOST; n++)
            for (unsigned k = 0; k <= MOST; k++)
                gemm_against_oracle(&r, m, n, k);
}

static void test_sandwich_agrees_with_openblas_and_is_symmetric_to_the_bit(void) {
    rng r = rng_seeded(22);
    for (int run = 0; run < 200; run++) {
        double a[36], p[36], s[36], result[36];
        plr_real A[36], P[36], S[36];
        rng_normals(&r, 1, a, 36);
        random_spd(&r, 6, 1e-3, p);
        round_to_real(a, 36);
        round_to_real(p, 36);
        to_reals(A, a, 36);
        to_reals(P, p, 36);
        plr_sandwich6(S, A, P);
        oracle_sandwich(6, 6, a, p, s);
        to_doubles(result, S, 36);
        TEST_ASSERT_DOUBLE_WITHIN(300 * eps, 0, largest_difference(s, result, 36));
        TEST_ASSERT_TRUE(is_symmetric(S, 6));
    }
}

/* The upper triangle of a symmetric matrix, or of the transpose of a lower one, row by row. */
static void pack_upper(plr_real *packed, const double *a, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = i; j < n; j++)
            *packed++ = (plr_real)a[j * n + i];
}

static void unpack_upper(double *a, const plr_real *packed, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = i; j < n; j++)
            a[i * n + j] = a[j * n + i] = (double)*packed++;
}

static void test_cholesky_agrees_with_lapack(void) {
    static double a[BIGGEST * BIGGEST], result[BIGGEST * BIGGEST];
    plr_real packed[BIGGEST * (BIGGEST + 1) / 2 + PLR_KERNEL_MARGIN];
    rng r = rng_seeded(23);
    for (unsigned n = 1; n <= BIGGEST; n++) {
        random_spd(&r, n, 0.5, a);
        pack_upper(packed, a, n);
        unpack_upper(a, packed, n);
        TEST_ASSERT_TRUE(plr_cholesky_upper(n, packed));
        TEST_ASSERT_TRUE(oracle_cholesky(n, a));
        unpack_upper(result, packed, n);
        for (unsigned i = 0; i < n; i++)
            TEST_ASSERT_DOUBLE_WITHIN(
                40 * n * eps, 0,
                largest_difference(a + (size_t)i * n, result + (size_t)i * n, i + 1));
    }
}

static void test_cholesky_refuses_what_is_not_positive_definite(void) {
    double a[64];
    plr_real packed[36 + PLR_KERNEL_MARGIN];
    rng r = rng_seeded(24);
    for (unsigned pivot = 0; pivot < 8; pivot++) {
        const double bad[] = {0, -1, (double)NAN, (double)INFINITY};
        for (unsigned kind = 0; kind < 4; kind++) {
            random_spd(&r, 8, 1, a);
            pack_upper(packed, a, 8);
            packed[plr_upper_row(8, pivot)] = (plr_real)bad[kind];
            TEST_ASSERT_FALSE(plr_cholesky_upper(8, packed));
        }
    }
}

static void test_cholesky_refuses_a_nan_off_the_diagonal(void) {
    plr_real packed[6 + PLR_KERNEL_MARGIN] = {4, (plr_real)NAN, 0, 4, 0, 4};
    TEST_ASSERT_FALSE(plr_cholesky_upper(3, packed));
}

static void test_cholesky_refuses_a_singular_matrix(void) {
    plr_real packed[3 + PLR_KERNEL_MARGIN] = {1, 2, 4};
    TEST_ASSERT_FALSE(plr_cholesky_upper(2, packed));
}

static void test_solve_upper_transposed_agrees_with_openblas(void) {
    static double a[BIGGEST * BIGGEST], x[BIGGEST * MOST];
    static plr_real X[BIGGEST * STRIDE];
    plr_real packed[BIGGEST * (BIGGEST + 1) / 2 + PLR_KERNEL_MARGIN];
    rng r = rng_seeded(25);
    for (unsigned k = 1; k <= BIGGEST; k++) {
        const unsigned n = 1 + rng_below(&r, MOST);
        const size_t ld = n + rng_below(&r, 4);
        char message[64];
        snprintf(message, sizeof message, "k %u, n %u, ld %u", k, n, (unsigned)ld);
        random_spd(&r, k, 0.5, a);
        TEST_ASSERT_TRUE(oracle_cholesky(k, a));
        round_to_real(a, (size_t)k * k);
        pack_upper(packed, a, k);
        random_strided(&r, k, n, ld, X, x);
        plr_solve_upper_transposed(k, n, packed, X, ld);
        oracle_solve_lower(k, n, a, x);
        const double size = largest(x, (size_t)k * n);
        assert_strided(20 * k * eps * (1 + size), x, X, k, n, ld, message);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_gemm_agrees_with_openblas_and_both_forms_bit_for_bit);
    RUN_TEST(test_sandwich_agrees_with_openblas_and_is_symmetric_to_the_bit);
    RUN_TEST(test_cholesky_agrees_with_lapack);
    RUN_TEST(test_cholesky_refuses_what_is_not_positive_definite);
    RUN_TEST(test_cholesky_refuses_a_nan_off_the_diagonal);
    RUN_TEST(test_cholesky_refuses_a_singular_matrix);
    RUN_TEST(test_solve_upper_transposed_agrees_with_openblas);
    return UNITY_END();
}
