// SPDX-License-Identifier: MIT
/* Rows of 3x3 blocks: both ways of multiplying them from both sides, and the formula in double. */
#include <unity.h>

#include "math/blocks3.h"
#include "support/matrices.h"
#include "support/random.h"

enum { MOST = 40, WIDTH = 3 * MOST + 2 };

typedef struct operands {
    plr_real F[9], G[9 * MOST], X[3][WIDTH];
} operands;

static operands random_case(rng *r) {
    operands c;
    for (unsigned i = 0; i < 9; i++)
        c.F[i] = (plr_real)rng_normal(r);
    for (unsigned i = 0; i < 9 * MOST; i++)
        c.G[i] = (plr_real)rng_normal(r);
    for (unsigned row = 0; row < 3; row++)
        for (unsigned k = 0; k < WIDTH; k++)
            c.X[row][k] = (plr_real)rng_normal(r);
    return c;
}

static void test_blocks_are_multiplied_from_both_sides(void) {
    rng r = rng_seeded(3);
    const operands before = random_case(&r);
    operands after = before;
    plr_real *const rows[3] = {after.X[0], after.X[1], after.X[2]};
    plr_blocks3_transport(MOST, after.F, after.G, rows);
    for (unsigned j = 0; j < MOST; j++)
        for (unsigned row = 0; row < 3; row++)
            for (unsigned column = 0; column < 3; column++) {
                double expected = 0;
                for (unsigned k = 0; k < 3; k++)
                    for (unsigned l = 0; l < 3; l++)
                        expected += (double)before.F[3 * row + k] * (double)before.X[k][3 * j + l] *
                                    (double)before.G[9 * j + 3 * column + l];
                TEST_ASSERT_DOUBLE_WITHIN(1e-4, expected, (double)after.X[row][3 * j + column]);
            }
}

static void transport_both_ways(rng *r, unsigned n) {
    const operands before = random_case(r);
    operands plain = before, wide = before;
    plr_real Gt[PLR_WIDE_FACTOR * MOST + 1], Y[9 * MOST + 1];
    plr_real *const plain_rows[3] = {plain.X[0], plain.X[1], plain.X[2]};
    plr_real *const wide_rows[3] = {wide.X[0], wide.X[1], wide.X[2]};
    Gt[PLR_WIDE_FACTOR * n] = Y[9 * n] = PLR_R(7);
    plr_blocks3_transport(n, plain.F, plain.G, plain_rows);
    plr_blocks3_widen(n, wide.G, Gt);
    plr_blocks3_transport_wide(n, wide.F, Gt, Y, wide_rows);
    for (unsigned row = 0; row < 3; row++) {
        TEST_ASSERT_TRUE(same_bits(plain.X[row], wide.X[row], 3 * n));
        /* one element behind may be anything, the next one is somebody else's */
        TEST_ASSERT_TRUE(
            same_bits(before.X[row] + 3 * n + 1, wide.X[row] + 3 * n + 1, WIDTH - 3 * n - 1));
        TEST_ASSERT_TRUE(same_bits(before.X[row] + 3 * n, plain.X[row] + 3 * n, WIDTH - 3 * n));
    }
    TEST_ASSERT_TRUE(Gt[PLR_WIDE_FACTOR * n] == PLR_R(7));
    TEST_ASSERT_TRUE(Y[9 * n] == PLR_R(7));
}

static void test_the_wide_way_has_the_bits_of_its_plain_twin(void) {
    rng r = rng_seeded(11);
    for (unsigned n = 0; n <= MOST; n++)
        transport_both_ways(&r, n);
}
