// SPDX-License-Identifier: MIT
/*
 * The innermost loops of an update. A tile of the result, PLR_TILE_ROWS x PLR_TILE_COLUMNS, stays
 * in the processor's registers while the rows of the two factors are read one after another.
 * Inlined where it is used. plr_tile_add and plr_tile_accumulate, plr_tile_less and plr_tile_reduce
 * differ only in what the compiler may assume about overlap. Where u w is subtracted, the sign
 * stands at w: gcc then makes one fused instruction of it, and would otherwise negate u by itself
 * before it fills a vector with it.
 */
#ifndef PLR_MATH_TILE_H
#define PLR_MATH_TILE_H

#include <stddef.h>

#include "pelorus/assertions.h"
#include "pelorus/config.h"

enum { PLR_TILE_ROWS = 4 };

/* A row of a tile. */
typedef plr_real plr_tile_row[PLR_TILE_COLUMNS];

#include PLR_ROW_FILE

/* to[c] = u w[c] */
static inline void plr_tile_scale(plr_real *restrict to, plr_real u, const plr_real *restrict w) {
    for (int c = 0; c < PLR_TILE_COLUMNS; c++)
        to[c] = u * w[c];
}

/* The current row of U and of W, and the number of elements to the next one. In a packed upper
 * triangle that number decreases by one from row to row: shrink is 1; otherwise 0. */
typedef struct plr_tile_factors {
    const plr_real *U, *W;
    size_t to_next_U, to_next_W;
    size_t shrink;
} plr_tile_factors;

static inline void plr_tile_next(plr_tile_factors *at) {
    at->U += at->to_next_U;
    at->W += at->to_next_W;
    at->to_next_U -= at->shrink;
}

/* row[r][c] -= sum_k U(k, r) W(k, c), k = 0 .. depth-1, depth >= 2. The rows move on to the next
 * tile. They are read by the first step and written by the last: copies would take time. */
static inline void plr_tile_subtract(unsigned depth, plr_tile_factors at,
                                     plr_real *row[PLR_TILE_ROWS]);

#include PLR_TILE_FILE

#endif
