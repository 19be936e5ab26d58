// SPDX-License-Identifier: MIT
/* The rows of tile.h, which includes this file, by vectors of four of WebAssembly's relaxed SIMD. */
#ifndef PLR_MATH_ROW_WASM_H
#define PLR_MATH_ROW_WASM_H

/* Four elements of a row, which stand anywhere. */
typedef float plr_four_at __attribute__((vector_size(16), aligned(4), may_alias));

static inline plr_four plr_four_get(const float *at) {
    return *(const plr_four_at *)at;
}

/* to[c] = u w[c] + from[c] */
static inline void plr_tile_add(float *to, float u, const float *w, const float *from) {
    const plr_four four_u = {u, u, u, u};
    for (int c = 0; c < PLR_TILE_COLUMNS; c += 4)
        *(plr_four_at *)(to + c) =
            __builtin_wasm_relaxed_madd_f32x4(four_u, plr_four_get(w + c), plr_four_get(from + c));
}

/* to[c] += u w[c] */
static inline void plr_tile_accumulate(float *to, float u, const float *w) {
    plr_tile_add(to, u, w, to);
}

/* to[c] = from[c] - u w[c] */
static inline void plr_tile_less(float *to, float u, const float *w, const float *from) {
    plr_tile_add(to, -u, w, from);
}

/* to[c] -= u w[c] */
static inline void plr_tile_reduce(float *to, float u, const float *w) {
    plr_tile_add(to, -u, w, to);
}

#endif
