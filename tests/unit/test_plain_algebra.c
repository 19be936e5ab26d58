// SPDX-License-Identifier: MIT
/* The plain algebra beside the oracle's, which is another one wherever OpenBLAS is installed; and
 * what must hold of either without the other. */
#include <string.h>
#include <unity.h>

#include "support/matrices.h"
#include "support/oracle.h"
#include "support/plain_algebra.h"

enum { MOST = 12 };

static rng chance;

void setUp(void) {
    chance = rng_seeded(81);
}

static void test_products_are_the_oracles(void) {
    for (int which = 0; which < 4; which++)
        for (unsigned m = 1; m < MOST; m += 3) {
            const unsigned n = MOST - m, k = 1 + (m * 5) % MOST;
            const bool turn_A = which & 1, turn_B = which & 2;
            double A[MOST * MOST], B[MOST * MOST], C[MOST * MOST], D[MOST * MOST];
            rng_normals(&chance, 1, A, m * k);
            rng_normals(&chance, 1, B, k * n);
            rng_normals(&chance, 1, C, m * n);
            memcpy(D, C, sizeof D);
            plain_gemm(turn_A, turn_B, m, n, k, -1.5, A, B, 0.5, C);
            oracle_gemm(turn_A ? ORACLE_TRANSPOSED : ORACLE_PLAIN,
                        turn_B ? ORACLE_TRANSPOSED : ORACLE_PLAIN, m, n, k, -1.5, A, B, 0.5, D);
            TEST_ASSERT_DOUBLE_WITHIN(1e-13, 0, largest_difference(C, D, m * n));
        }
}

/* [1 2; 3 4] [5; 6] = [17; 39], and transposed [23; 34]. */
static void test_a_product_by_hand(void) {
    const double A[4] = {1, 2, 3, 4}, x[2] = {5, 6}, plain[2] = {17, 39}, turned[2] = {23, 34};
    double y[2];
    plain_gemm(false, false, 2, 1, 2, 1, A, x, 0, y);
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(plain, y, 2);
    plain_gemm(true, false, 2, 1, 2, 1, A, x, 0, y);
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(turned, y, 2);
}

static void test_a_cholesky_factor_gives_the_matrix_back(void) {
    for (unsigned n = 1; n <= MOST; n++) {
        double A[MOST * MOST], L[MOST * MOST], back[MOST * MOST], oracles[MOST * MOST];
        random_spd(&chance, n, 0.1, A);
        memcpy(L, A, sizeof L);
        memcpy(oracles, A, sizeof oracles);
        TEST_ASSERT_TRUE(plain_cholesky(n, L));
        plain_gemm(false, true, n, n, n, 1, L, L, 0, back);
        TEST_ASSERT_DOUBLE_WITHIN(1e-13, 0, largest_difference(A, back, n * n));
        TEST_ASSERT_TRUE(oracle_cholesky(n, oracles));
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, largest_difference(L, oracles, n * n));
        A[n * n - 1] = -1;
        TEST_ASSERT_FALSE(plain_cholesky(n, A));
    }
}

static void test_solutions_fulfil_their_equations(void) {
    for (unsigned n = 1; n <= MOST; n++) {
        double A[MOST * MOST], L[MOST * MOST], B[MOST * 2], X[MOST * 2], back[MOST * 2];
        random_spd(&chance, n, 0.1, A);
        rng_normals(&chance, 1, B, 2 * n);
        memcpy(L, A, sizeof L);
        memcpy(X, B, sizeof X);
        TEST_ASSERT_TRUE(oracle_solve_spd(n, 2, L, X));
        plain_gemm(false, false, n, 2, n, 1, A, X, 0, back);
        TEST_ASSERT_DOUBLE_WITHIN(1e-11, 0, largest_difference(B, back, 2 * n));
        memcpy(L, A, sizeof L);
        memcpy(X, B, sizeof X);
        TEST_ASSERT_TRUE(plain_cholesky(n, L));
        plain_solve_lower(n, 2, L, X);
        plain_solve_lower_transposed(n, 2, L, X);
        plain_gemm(false, false, n, 2, n, 1, A, X, 0, back);
        TEST_ASSERT_DOUBLE_WITHIN(1e-11, 0, largest_difference(B, back, 2 * n));
    }
}

static void test_eigenvalues_are_the_oracles_and_add_up_to_the_trace(void) {
    for (unsigned n = 1; n <= MOST; n++) {
        double A[MOST * MOST], copy[MOST * MOST], values[MOST], oracles[MOST], trace = 0, sum = 0;
        random_spd(&chance, n, 0.01, A);
        A[0] -= 0.5; /* not positive: no reason to refuse */
        memcpy(copy, A, sizeof copy);
        plain_eigenvalues(n, copy, values);
        oracle_eigenvalues(n, A, oracles);
        for (unsigned i = 0; i < n; i++) {
            trace += A[i * n + i];
            sum += values[i];
        }
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, trace, sum);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, largest_difference(oracles, values, n));
    }
}

/* The lower triangle alone, with gaps between the rows that stay as they are. */
static void test_a_downdate_is_the_oracles(void) {
    enum { LD = MOST + 2 };
    for (unsigned n = 1; n <= MOST; n++) {
        const unsigned m = 1 + (n * 7) % MOST;
        double V[MOST * MOST], P[MOST * LD], oracles[MOST * LD], before[MOST * LD],
            VtV[MOST * MOST];
        rng_normals(&chance, 1, V, m * n);
        rng_normals(&chance, 1, P, MOST * LD);
        memcpy(before, P, sizeof P);
        memcpy(oracles, P, sizeof P);
        plain_downdate(n, m, V, P, LD);
        oracle_downdate(n, m, V, oracles, LD);
        plain_gemm(true, false, n, n, m, 1, V, V, 0, VtV);
        for (unsigned i = 0; i < MOST; i++)
            for (unsigned j = 0; j < LD; j++) {
                const double due = before[i * LD + j] - (i < n && j <= i ? VtV[i * n + j] : 0);
                TEST_ASSERT_DOUBLE_WITHIN(1e-13, due, P[i * LD + j]);
                TEST_ASSERT_DOUBLE_WITHIN(1e-13, due, oracles[i * LD + j]);
            }
    }
}
