// SPDX-License-Identifier: MIT
/*
 * Holds the kernels of an update, as they were built for this board, against their plain twins: the
 * same bits for every size and depth. An image of its own, for math/tile_cortex_m.h exists on these
 * processors alone. Writes a line with two numbers, and stops.
 */
#include <string.h>

#include "board.h"
#include "math/dense.h"
#include "math/packed.h"
#include "serial.h"
#include "text.h"

enum { MOST = 41, DEEPEST = 26, LD = 48, STRIPS = 2 };

typedef struct tally {
    unsigned compared, different;
} tally;

static plr_real U[DEEPEST * LD + PLR_KERNEL_MARGIN], W[DEEPEST * LD + PLR_KERNEL_MARGIN];
static plr_real fast[MOST * (MOST + 1) / 2 + PLR_KERNEL_MARGIN], plain[sizeof fast / sizeof *fast];
static uint32_t seed = 1;

/* Between -1 and 1; a linear congruential generator. */
static plr_real next_number(void) {
    seed = 1664525U * seed + 1013904223U;
    return (plr_real)((int32_t)seed) / PLR_R(2147483648.0);
}

static void fill(plr_real *x, size_t n) {
    for (size_t i = 0; i < n; i++) {
        x[i] = next_number();
    }
}

static void compare(tally *t, const plr_real *a, const plr_real *b, size_t n) {
    t->compared++;
    t->different += memcmp(a, b, n * sizeof *a) != 0;
}

static void subtract_both_ways(tally *t, unsigned n, unsigned depth) {
    fill(U, sizeof U / sizeof *U);
    fill(W, sizeof W / sizeof *W);
    fill(fast, sizeof fast / sizeof *fast);
    memcpy(plain, fast, sizeof plain);
    plr_packed_subtract(n, depth, U, W, LD, fast);
    plr_packed_subtract_plain(n, depth, U, W, LD, plain);
    compare(t, fast, plain, sizeof fast / sizeof *fast);
}

/* Strips of columns are solved in tiles, a few beside them together, a single column alone. */
static void solve_both_ways(tally *t, unsigned k) {
    enum { COLUMNS = STRIPS * PLR_TILE_COLUMNS + 4 };
    static plr_real factor[DEEPEST * (DEEPEST + 1) / 2 + PLR_KERNEL_MARGIN];
    fill(factor, sizeof factor / sizeof *factor);
    for (unsigned i = 0; i < k; i++) {
        factor[plr_upper_row(k, i)] += PLR_R(2); /* far from a division by zero */
    }
    fill(U, sizeof U / sizeof *U);
    memcpy(W, U, sizeof W);
    plr_solve_upper_transposed(k, COLUMNS, factor, U, LD);
    for (unsigned c = 0; c < COLUMNS; c++) {
        plr_solve_upper_transposed(k, 1, factor, W + c, LD);
    }
    compare(t, U, W, sizeof U / sizeof *U);
}

static void put(const char *name, uint64_t number, const char *end) {
    static text line;
    text_clear(&line);
    text_add(&line, name);
    text_add(&line, " ");
    text_add_number(&line, number);
    text_add(&line, end);
    serial_panic((const uint8_t *)line.characters, line.length);
}

int main(void) {
    tally t = {0};
    board_init();
    for (unsigned depth = 1; depth <= DEEPEST; depth++) {
        for (unsigned n = 1; n <= MOST; n++) {
            subtract_both_ways(&t, n, depth);
            board_watchdog_feed();
        }
        solve_both_ways(&t, depth);
    }
    put("compared", t.compared, " ");
    put("different", t.different, "\n");
    for (;;) {
        board_watchdog_feed();
    }
}
