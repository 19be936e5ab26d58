// SPDX-License-Identifier: MIT
/* The packed triangle and the kernel in which an update spends its time. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "math/packed.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/random.h"

enum { MOST = 70, DEEPEST = PLR_BLOCK_ROWS, FRAME = PLR_KERNEL_MARGIN };

/* Normal numbers, depth x n with leading dimension ld, and behind them as many NaN as the kernel may
 * read. Gaps between rows are NaN too. */
static plr_real *operand(rng *r, unsigned depth, unsigned n, size_t ld) {
    const size_t size = (depth > 0 ? depth - 1 : 0) * ld + n + PLR_KERNEL_MARGIN;
    plr_real *x = malloc(size * sizeof *x);
    TEST_ASSERT_NOT_NULL(x);
    for (size_t i = 0; i < size; i++)
        x[i] = (plr_real)NAN;
    for (unsigned k = 0; k < depth; k++)
        for (unsigned j = 0; j < n; j++)
            x[k * ld + j] = (plr_real)rng_normal(r);
    return x;
}

static void test_rows_follow_one_another_without_gaps(void) {
    size_t next = 0;
    for (size_t i = 0; i < 50; i++)
        for (size_t j = 0; j <= i; j++, next++) {
            TEST_ASSERT_EQUAL_size_t(next, plr_packed_row(i) + j);
            TEST_ASSERT_EQUAL_size_t(next, plr_packed_at(i, j));
            TEST_ASSERT_EQUAL_size_t(next, plr_packed_at(j, i));
        }
}

static void subtract_both_ways(rng *r, unsigned n, unsigned depth, size_t ld) {
    plr_real *Ut = operand(r, depth, n, ld), *Wt = operand(r, depth, n, ld);
    plr_real fast[MOST * (MOST + 1) / 2 + FRAME], plain[MOST * (MOST + 1) / 2 + FRAME];
    const size_t size = plr_packed_row(n) + FRAME;
    for (size_t i = 0; i < size; i++)
        fast[i] = plain[i] = (plr_real)rng_normal(r);
    plr_packed_subtract(n, depth, Ut, Wt, ld, fast);
    plr_packed_subtract_plain(n, depth, Ut, Wt, ld, plain);
    char message[64];
    snprintf(message, sizeof message, "n %u, depth %u, ld %u", n, depth, (unsigned)ld);
    TEST_ASSERT_TRUE_MESSAGE(same_bits(fast, plain, size), message);
    free(Ut);
    free(Wt);
}

static void test_tiled_subtract_has_the_bits_of_its_plain_twin(void) {
    rng r = rng_seeded(11);
    for (unsigned n = 1; n <= MOST; n++)
        for (unsigned depth = 0; depth <= DEEPEST; depth += 1 + n / 8)
            subtract_both_ways(&r, n, depth, n + rng_below(&r, 6));
}

static void test_tiled_subtract_writes_nothing_behind_the_triangle(void) {
    rng r = rng_seeded(12);
    for (unsigned n = 1; n <= MOST; n++) {
        plr_real *Ut = operand(&r, 3, n, n);
        plr_real P[MOST * (MOST + 1) / 2 + FRAME];
        memset(P, 0x5A, sizeof P);
        plr_real untouched[FRAME];
        memset(untouched, 0x5A, sizeof untouched);
        plr_packed_subtract(n, 3, Ut, Ut, n, P);
        TEST_ASSERT_TRUE(same_bits(untouched, P + plr_packed_row(n), FRAME));
        free(Ut);
    }
}

/* |fl(P - U W^T) - (P - U W^T)| <= depth eps (|P| + |U| |W|^T): 100 covers it for normal numbers. */
static void test_subtract_agrees_with_openblas(void) {
    static double U[MOST * DEEPEST], W[MOST * DEEPEST], P[MOST * MOST], result[MOST * MOST];
    rng r = rng_seeded(13);
    for (unsigned n = 1; n <= MOST; n += 1 + n / 5) {
        const unsigned depth = DEEPEST;
        plr_real *Ut = operand(&r, depth, n, n), *Wt = operand(&r, depth, n, n);
        plr_real packed[MOST * (MOST + 1) / 2 + FRAME];
        random_spd(&r, n, 1, P);
        pack_lower(packed, P, n);
        unpack_symmetric(P, packed, n);
        to_doubles(U, Ut, (size_t)depth * n);
        to_doubles(W, Wt, (size_t)depth * n);
        plr_packed_subtract(n, depth, Ut, Wt, n, packed);
        oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, n, n, depth, -1, U, W, 1, P);
        unpack_symmetric(result, packed, n);
        for (unsigned i = 0; i < n; i++)
            TEST_ASSERT_DOUBLE_WITHIN(
                100 * REAL_EPSILON, 0,
                largest_difference(P + (size_t)i * n, result + (size_t)i * n, i + 1));
        free(Ut);
        free(Wt);
    }
}

static void test_foretold_diagonal_has_the_bits_of_the_subtraction(void) {
    rng r = rng_seeded(15);
    for (unsigned n = 1; n <= MOST; n++) {
        const unsigned depth = 1 + n % DEEPEST;
        const size_t ld = n + rng_below(&r, 6);
        plr_real *Ut = operand(&r, depth, n, ld);
        plr_real P[MOST * (MOST + 1) / 2 + FRAME], foretold[MOST + PLR_TILE_COLUMNS],
            diagonal[MOST];
        for (size_t i = 0; i < plr_packed_row(n); i++)
            P[i] = (plr_real)rng_normal(&r);
        for (unsigned i = 0; i < n;)
            i += plr_packed_subtracted_diagonal(i, n, depth, Ut, ld, P, foretold + i);
        plr_packed_subtract(n, depth, Ut, Ut, ld, P);
        for (unsigned i = 0; i < n; i++)
            diagonal[i] = P[plr_packed_at(i, i)];
        TEST_ASSERT_TRUE(same_bits(diagonal, foretold, n));
        free(Ut);
    }
}

static void test_subtracting_nothing_changes_nothing(void) {
    rng r = rng_seeded(14);
    plr_real *Ut = operand(&r, 0, 9, 9);
    plr_real before[45 + FRAME], after[45 + FRAME];
    for (int i = 0; i < 45 + FRAME; i++)
        before[i] = after[i] = (plr_real)rng_normal(&r);
    plr_packed_subtract(9, 0, Ut, Ut, 9, after);
    TEST_ASSERT_TRUE(same_bits(before, after, 45 + FRAME));
    free(Ut);
}
