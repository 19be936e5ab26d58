// SPDX-License-Identifier: MIT
/* Dense kernels against OpenBLAS and LAPACKE, over all small sizes and odd strides. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "math/dense.h"
#include "math/packed.h"
#include "math/small.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/random.h"

enum { MOST = 9, STRIDE = 13, BIGGEST = 40, WIDEST = 50 };

static const double eps = REAL_EPSILON;

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

/* A random positive definite matrix, packed, and its double twin. The margin behind it, which the
 * kernel may read, is NaN. */
static void random_packed(rng *r, unsigned n, plr_real *packed, double *twin) {
    const size_t size = plr_upper_row(n, n);
    random_spd(r, n, 0.5, twin);
    pack_upper(packed, twin, n);
    unpack_upper(twin, packed, n);
    for (size_t i = 0; i < PLR_KERNEL_MARGIN; i++)
        packed[size + i] = (plr_real)NAN;
}

static void test_cholesky_agrees_with_lapack(void) {
    static double a[BIGGEST * BIGGEST], result[BIGGEST * BIGGEST];
    plr_real packed[BIGGEST * (BIGGEST + 1) / 2 + PLR_KERNEL_MARGIN];
    rng r = rng_seeded(23);
    for (unsigned n = 1; n <= BIGGEST; n++) {
        random_packed(&r, n, packed, a);
        TEST_ASSERT_TRUE(plr_cholesky_upper(n, packed));
        TEST_ASSERT_TRUE(oracle_cholesky(n, a));
        unpack_upper(result, packed, n);
        for (unsigned i = 0; i < n; i++)
            TEST_ASSERT_DOUBLE_WITHIN(
                40 * n * eps, 0,
                largest_difference(a + (size_t)i * n, result + (size_t)i * n, i + 1));
    }
}

/* The factor element by element, each accumulator from its own element with k ascending. */
static void plain_cholesky(unsigned n, plr_real *S) {
    for (unsigned i = 0; i < n; i++) {
        plr_real *row = S + plr_upper_row(n, i) - i;
        plr_real inverse = 0;
        for (unsigned j = i; j < n; j++) {
            plr_real x = row[j];
            for (unsigned k = 0; k < i; k++) {
                const plr_real *above = S + plr_upper_row(n, k) - k;
                x = PLR_FMA(-above[i], above[j], x);
            }
            if (j == i)
                inverse = PLR_R(1) / PLR_SQRT(x);
            row[j] = x * inverse;
        }
    }
}

static void test_cholesky_has_the_bits_of_plain_loops_and_stays_inside(void) {
    static double a[BIGGEST * BIGGEST];
    enum { SIZE = BIGGEST * (BIGGEST + 1) / 2 + PLR_KERNEL_MARGIN };
    plr_real packed[SIZE], plain[SIZE];
    rng r = rng_seeded(26);
    for (unsigned n = 1; n <= BIGGEST; n++) {
        random_packed(&r, n, packed, a);
        memcpy(plain, packed, sizeof plain);
        plain_cholesky(n, plain);
        TEST_ASSERT_TRUE(plr_cholesky_upper(n, packed));
        TEST_ASSERT_TRUE(same_bits(plain, packed, plr_upper_row(n, n) + PLR_KERNEL_MARGIN));
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

/* X <- U^-T X column by column, k ascending. */
static void plain_solve(unsigned k, unsigned n, const plr_real *U, plr_real *X, size_t ldx) {
    for (unsigned j = 0; j < n; j++)
        for (unsigned i = 0; i < k; i++) {
            plr_real x = X[i * ldx + j];
            for (unsigned l = 0; l < i; l++)
                x = PLR_FMA(-U[plr_upper_row(k, l) + i - l], X[l * ldx + j], x);
            X[i * ldx + j] = x * (PLR_R(1) / U[plr_upper_row(k, i)]);
        }
}

static void solve_against_oracle(rng *r, unsigned k, unsigned n) {
    static double a[BIGGEST * BIGGEST], x[BIGGEST * WIDEST];
    static plr_real X[BIGGEST * (WIDEST + 4)], plain[BIGGEST * (WIDEST + 4)];
    plr_real packed[BIGGEST * (BIGGEST + 1) / 2 + PLR_KERNEL_MARGIN];
    const size_t ld = n + rng_below(r, 4);
    char message[64];
    snprintf(message, sizeof message, "k %u, n %u, ld %u", k, n, (unsigned)ld);
    random_spd(r, k, 0.5, a);
    TEST_ASSERT_TRUE(oracle_cholesky(k, a));
    round_to_real(a, (size_t)k * k);
    pack_upper(packed, a, k);
    random_strided(r, k, n, ld, X, x);
    memcpy(plain, X, sizeof plain);
    plr_solve_upper_transposed(k, n, packed, X, ld);
    plain_solve(k, n, packed, plain, ld);
    TEST_ASSERT_TRUE_MESSAGE(same_bits(plain, X, k * ld), message);
    oracle_solve_lower(k, n, a, x);
    const double size = largest(x, (size_t)k * n);
    assert_strided(20 * k * eps * (1 + size), x, X, k, n, ld, message);
}

/* Widths below, at and above the strips that the kernel holds in registers. */
static void test_solve_agrees_with_openblas_and_has_the_bits_of_plain_loops(void) {
    rng r = rng_seeded(25);
    for (unsigned k = 1; k <= BIGGEST; k += 1 + k / 8)
        for (unsigned n = 1; n <= WIDEST; n++)
            solve_against_oracle(&r, k, n);
}

/* ---------------------------------------------------------------- three rows, four rows */

/* A random S = A A^T + I / 8, packed upper. */
static void random_positive3(rng *r, plr_real S[6 + PLR_KERNEL_MARGIN]) {
    plr_real A[9];
    memset(S, 0, (6 + PLR_KERNEL_MARGIN) * sizeof *S);
    for (unsigned i = 0; i < 9; i++)
        A[i] = (plr_real)rng_normal(r);
    for (unsigned i = 0, at = 0; i < 3; i++)
        for (unsigned j = i; j < 3; j++, at++) {
            S[at] = PLR_R(0.125) * (i == j ? PLR_R(1) : PLR_R(0));
            for (unsigned k = 0; k < 3; k++)
                S[at] += A[3 * i + k] * A[3 * j + k];
        }
}

static void test_three_rows_without_loops_have_the_bits_of_the_general_kernels(void) {
    rng r = rng_seeded(31);
    for (unsigned run = 0; run < 200; run++) {
        const unsigned n = 1 + rng_below(&r, 7);
        plr_real U[6 + PLR_KERNEL_MARGIN], U3[6], X[21], X3[21];
        random_positive3(&r, U);
        memcpy(U3, U, sizeof U3);
        for (unsigned i = 0; i < 3 * n; i++)
            X[i] = X3[i] = (plr_real)rng_normal(&r);
        TEST_ASSERT_TRUE(plr_cholesky_upper(3, U));
        TEST_ASSERT_TRUE(plr_cholesky3(U3));
        TEST_ASSERT_EQUAL_MEMORY(U, U3, sizeof U3);
        plr_solve_upper_transposed(3, n, U, X, n);
        plr_solve3_transposed(n, U3, X3);
        TEST_ASSERT_EQUAL_MEMORY(X, X3, 3 * n * sizeof *X);
        plr_real x[3] = {X[0], X[n], X[2 * n]}, y[3];
        plr_multiply3_transposed(y, U3, x);
        plr_solve3_transposed(1, U3, y); /* and back */
        for (unsigned i = 0; i < 3; i++)
            TEST_ASSERT_DOUBLE_WITHIN(1e3 * eps * (1 + fabs((double)x[0]) + fabs((double)x[1])),
                                      (double)x[i], (double)y[i]);
    }
}

static void test_three_rows_refuse_what_the_general_kernel_refuses(void) {
    rng r = rng_seeded(32);
    for (unsigned at = 0; at < 6; at++)
        for (unsigned kind = 0; kind < 3; kind++) {
            const plr_real wrong[3] = {PLR_R(-1e3), (plr_real)NAN, (plr_real)INFINITY};
            plr_real U[6 + PLR_KERNEL_MARGIN], U3[6];
            random_positive3(&r, U);
            U[at] = wrong[kind];
            memcpy(U3, U, sizeof U3);
            TEST_ASSERT_FALSE(plr_cholesky_upper(3, U));
            TEST_ASSERT_FALSE(plr_cholesky3(U3));
        }
}

/* Widths beside the strips, and factors that lie apart. */
static void test_combined_rows_have_the_bits_of_plain_loops(void) {
    enum { DEPTH = 7, APART = 3, LD = WIDEST + 1 };
    static plr_real a[DEPTH * APART], X[DEPTH * LD], x[WIDEST], plain[WIDEST];
    rng r = rng_seeded(34);
    for (unsigned i = 0; i < DEPTH * APART; i++)
        a[i] = (plr_real)rng_normal(&r);
    for (unsigned i = 0; i < DEPTH * LD; i++)
        X[i] = (plr_real)rng_normal(&r);
    for (unsigned n = 1; n <= WIDEST; n++)
        for (unsigned depth = 0; depth <= DEPTH; depth++) {
            for (unsigned j = 0; j < WIDEST; j++)
                x[j] = plain[j] = (plr_real)rng_normal(&r);
            for (unsigned j = 0; j < n; j++)
                for (unsigned k = 0; k < depth; k++)
                    plain[j] = PLR_FMA(a[APART * k], X[LD * k + j], plain[j]);
            plr_combine_rows(n, depth, a, APART, X, LD, x);
            TEST_ASSERT_EQUAL_MEMORY(plain, x, sizeof x);
        }
}

static void test_a_product_added_to_a_6x6_has_the_bits_of_plain_loops(void) {
    plr_real S[PLR_POSE_TRIANGLE + 1], plain[PLR_POSE_TRIANGLE + 1], a[6], b[6];
    rng r = rng_seeded(35);
    for (unsigned i = 0; i < PLR_POSE_TRIANGLE + 1; i++)
        S[i] = plain[i] = (plr_real)rng_normal(&r);
    for (unsigned i = 0; i < 6; i++) {
        a[i] = (plr_real)rng_normal(&r);
        b[i] = (plr_real)rng_normal(&r);
    }
    plr_upper6_add(S, a, b);
    for (unsigned i = 0, at = 0; i < 6; i++)
        for (unsigned j = i; j < 6; j++, at++)
            plain[at] = PLR_FMA(a[i], b[j], plain[at]);
    TEST_ASSERT_EQUAL_MEMORY(plain, S, sizeof S);
}

static void test_four_rows_together_have_the_bits_of_one_after_the_other(void) {
    enum { ROWS = 30, TILES = 3, N = TILES * PLR_TILE_COLUMNS };
    static plr_real A[8 * ROWS], V[ROWS * N], X[4][N], expected[4][N];
    rng r = rng_seeded(33);
    for (unsigned depth = 2; depth <= ROWS; depth++) {
        for (unsigned i = 0; i < 8 * ROWS; i++)
            A[i] = (plr_real)rng_normal(&r);
        for (unsigned i = 0; i < ROWS * N; i++)
            V[i] = (plr_real)rng_normal(&r);
        for (unsigned row = 0; row < 4; row++) {
            plr_real minus[ROWS];
            for (unsigned j = 0; j < N; j++)
                X[row][j] = expected[row][j] = (plr_real)rng_normal(&r);
            for (unsigned k = 0; k < depth; k++)
                minus[k] = -A[8 * k + row];
            plr_combine_rows(N, depth, minus, 1, V, N, expected[row]);
        }
        plr_real *const rows[4] = {X[0], X[1], X[2], X[3]};
        plr_subtract_four_rows(N, depth, A, 8, V, N, rows);
        TEST_ASSERT_EQUAL_MEMORY(expected, X, sizeof X);
    }
}
