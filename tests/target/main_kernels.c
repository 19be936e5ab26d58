// SPDX-License-Identifier: MIT
/*
 * Holds the kernels of an update and the loops over pixels, as they were built for this board, against
 * their plain twins: the same bits for every size and depth. An image of its own, for math/tile_cortex_m.h
 * and vision/kernels_mve.h exist on these processors alone. Writes a line with two numbers, and stops.
 */
#include <string.h>

#include "board.h"
#include "math/dense.h"
#include "math/packed.h"
#include "serial.h"
#include "text.h"
#include "vision/kernels.h"

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

/* --- pixels --- */

enum { PICTURE = 131 * 560, ROUNDS = 1200, WIDEST = 150 };

static uint8_t picture[PICTURE];

static unsigned below(unsigned n) {
    return (unsigned)((next_number() + 1) * PLR_R(8388607)) % n;
}

static void compare_bytes(tally *t, const void *a, const void *b, size_t n) {
    t->compared++;
    t->different += memcmp(a, b, n) != 0;
}

/* As large as the memory lets it be. */
static plr_image next_image(void) {
    plr_image image = {picture, 64 + below(497), 0, 0};
    image.width = (uint16_t)(image.stride - below(8));
    image.height = (uint16_t)(PICTURE / image.stride < 400 ? PICTURE / image.stride : 400);
    return image;
}

/* Patches that are turned, stretched and mirrored, by up to eight times; of those that are the highest, offsets in a
 * wide picture have more than 16 bits. */
static void sum_pixels_both_ways(tally *t, const plr_template *template) {
    const bool high = below(8) == 0;
    plr_image image = next_image();
    const plr_real most = below(2) ? PLR_R(1.5) : PLR_R(8);
    plr_patch_sums by_kernel, by_twin;
    plr_grid g;
    plr_real at[2], A[4];
    at[0] = (next_number() + 1) / 2 * (plr_real)image.width;
    at[1] = (next_number() + 1) / 2 * (plr_real)image.height;
    for (int i = 0; i < 4; i++) {
        A[i] = most * next_number();
    }
    if (high) {
        image = (plr_image){picture, 560, 560, 131};
        at[0] = 280, at[1] = 65;
        A[2] = PLR_R(7.8) + next_number() / 10, A[3] = -A[2];
    }
    if (plr_grid_place(&g, &image, at, A)) {
        plr_patch_sum(&by_kernel, &image, &g, template);
        plr_patch_sum_plain(&by_twin, &image, &g, template);
        compare_bytes(t, &by_kernel, &by_twin, sizeof by_twin);
    }
}

static void make_templates_both_ways(tally *t, plr_template *template) {
    static plr_template twin;
    const plr_image image = next_image();
    plr_template_sums sums, twin_sums;
    uint8_t patch[PLR_PATCH_BYTES], twin_patch[PLR_PATCH_BYTES];
    const int32_t x = (int32_t)(below(image.width - PLR_PATCH_KEPT - 1U) << 16 | below(65536));
    const int32_t y = (int32_t)(below(image.height - PLR_PATCH_KEPT - 1U) << 16 | below(65536));
    plr_patch_sample(&image, x, y, patch);
    plr_patch_sample_plain(&image, x, y, twin_patch);
    compare_bytes(t, patch, twin_patch, sizeof patch);
    plr_template_fill(template, patch, &sums);
    plr_template_fill_plain(&twin, patch, &twin_sums);
    compare_bytes(t, template->T, twin.T, sizeof twin.T);
    compare_bytes(t, template->Jx, twin.Jx, sizeof twin.Jx);
    compare_bytes(t, template->Jy, twin.Jy, sizeof twin.Jy);
    compare_bytes(t, &sums, &twin_sums, sizeof sums);
}

/* Nothing is written behind the picture. */
static void halve_both_ways(tally *t, unsigned width) {
    static uint8_t small[WIDEST * 8], twin[sizeof small];
    plr_image image = {picture + below(4096), width + below(9), (uint16_t)width, 0};
    image.height = (uint16_t)(2 + below(13));
    memset(small, 0xA5, sizeof small);
    memset(twin, 0xA5, sizeof twin);
    plr_pyramid_halve(&image, small);
    plr_pyramid_halve_plain(&image, twin);
    compare_bytes(t, small, twin, sizeof small);
}

static void see_both_ways(tally *t) {
    static plr_template template;
    for (unsigned i = 0; i < PICTURE; i++) {
        /* black and white too, whose sums are the largest */
        const unsigned grey = below(i / 4096 % 2 ? 256 : 3);
        picture[i] = (uint8_t)(i / 4096 % 2 ? grey : grey * 127 + grey / 2);
    }
    for (unsigned i = 0; i < ROUNDS; i++) {
        make_templates_both_ways(t, &template);
        sum_pixels_both_ways(t, &template);
        halve_both_ways(t, 4 + i % (2 * WIDEST - 4));
        board_watchdog_feed();
    }
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
    see_both_ways(&t);
    put("compared", t.compared, " ");
    put("different", t.different, "\n");
    for (;;) {
        board_watchdog_feed();
    }
}
