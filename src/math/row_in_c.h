// SPDX-License-Identifier: MIT
/* The rows of tile.h, which includes this file, for all but WebAssembly's relaxed SIMD. */
#ifndef PLR_MATH_ROW_IN_C_H
#define PLR_MATH_ROW_IN_C_H

/* to[c] = u w[c] + from[c] */
static inline void plr_tile_add(plr_real *restrict to, plr_real u, const plr_real *restrict w,
                                const plr_real *restrict from) {
    for (int c = 0; c < PLR_TILE_COLUMNS; c++)
        to[c] = PLR_FMA(u, w[c], from[c]);
}

/* to[c] += u w[c] */
static inline void plr_tile_accumulate(plr_real *restrict to, plr_real u,
                                       const plr_real *restrict w) {
    for (int c = 0; c < PLR_TILE_COLUMNS; c++)
        to[c] = PLR_FMA(u, w[c], to[c]);
}

/* to[c] = from[c] - u w[c] */
static inline void plr_tile_less(plr_real *restrict to, plr_real u, const plr_real *restrict w,
                                 const plr_real *restrict from) {
    for (int c = 0; c < PLR_TILE_COLUMNS; c++)
        to[c] = PLR_FMA(u, -w[c], from[c]);
}

/* to[c] -= u w[c] */
static inline void plr_tile_reduce(plr_real *restrict to, plr_real u, const plr_real *restrict w) {
    for (int c = 0; c < PLR_TILE_COLUMNS; c++)
        to[c] = PLR_FMA(u, -w[c], to[c]);
}

#endif
