// SPDX-License-Identifier: MIT
#include "math/packed.h"

#include <string.h>

#include "math/dense.h"
#include "math/tile.h"
#include "pelorus/assertions.h"

/* With wide registers six rows make a tile: twelve sums hide how long each takes, and a row of W is read less
 * often. */
enum {
    COLUMNS = PLR_TILE_COLUMNS,
    IS_WIDE = COLUMNS == 16 && PLR_REAL == 32,
    ROWS = IS_WIDE ? 6 : PLR_TILE_ROWS,
    CORNER = PLR_TILE_ROWS
};

/* Tiles of six rows: X_r -= sum_k A(k, r) V_k, V depth x n, A depth x 6, as plr_subtract_four_rows. */
static void subtract_six_rows(unsigned n, unsigned depth, const plr_real *A, const plr_real *V,
                              size_t ld, plr_real *const X[6]) {
    for (unsigned j = 0; j < n; j += COLUMNS) {
        const plr_real *u = A, *w = V + j;
        plr_tile_row a0, a1, a2, a3, a4, a5;
        plr_tile_less(a0, u[0], w, X[0] + j);
        plr_tile_less(a1, u[1], w, X[1] + j);
        plr_tile_less(a2, u[2], w, X[2] + j);
        plr_tile_less(a3, u[3], w, X[3] + j);
        plr_tile_less(a4, u[4], w, X[4] + j);
        plr_tile_less(a5, u[5], w, X[5] + j);
        for (unsigned steps = depth - 2; steps > 0; steps--) {
            u += ld;
            w += ld;
            plr_tile_reduce(a0, u[0], w);
            plr_tile_reduce(a1, u[1], w);
            plr_tile_reduce(a2, u[2], w);
            plr_tile_reduce(a3, u[3], w);
            plr_tile_reduce(a4, u[4], w);
            plr_tile_reduce(a5, u[5], w);
        }
        u += ld;
        w += ld;
        plr_tile_less(X[0] + j, u[0], w, a0);
        plr_tile_less(X[1] + j, u[1], w, a1);
        plr_tile_less(X[2] + j, u[2], w, a2);
        plr_tile_less(X[3] + j, u[3], w, a3);
        plr_tile_less(X[4] + j, u[4], w, a4);
        plr_tile_less(X[5] + j, u[5], w, a5);
    }
}

static inline void subtract_rows(unsigned n, unsigned depth, const plr_real *A, const plr_real *V,
                                 size_t ld, plr_real *const X[ROWS]) {
    if (IS_WIDE)
        subtract_six_rows(n, depth, A, V, ld, X);
    else
        plr_subtract_four_rows(n, depth, A, ld, V, ld, X);
}

/* A tile that the diagonal cuts, from column j on: only what lies inside changes. Wide registers write back
 * what stood in the rest: to choose is faster than to branch. */
static void subtract_cut_tile(unsigned i, unsigned j, unsigned depth, const plr_real *Ut,
                              const plr_real *Wt, size_t ld, plr_real *P) {
    plr_tile_row tile[ROWS];
    plr_real *at[ROWS];
    for (unsigned r = 0; r < ROWS; r++) {
        at[r] = tile[r];
        memcpy(tile[r], P + plr_packed_row(i + r) + j, sizeof tile[r]);
    }
    subtract_rows(COLUMNS, depth, Ut + i, Wt + j, ld, at);
    for (unsigned r = 0; r < ROWS; r++) {
        plr_real *row = P + plr_packed_row(i + r) + j;
        const int inside = (int)(i + r + 1) - (int)j;
        for (int c = 0; IS_WIDE && c < COLUMNS; c++)
            row[c] = c < inside ? tile[r][c] : row[c];
        for (int c = 0; !IS_WIDE && c < COLUMNS && c < inside; c++)
            row[c] = tile[r][c];
    }
}

/* P -= U W^T in the triangle of `size` rows from number i on. Inlined for each size. */
static inline void subtract_triangle(unsigned size, unsigned i, unsigned depth,
                                     const plr_real *restrict Ut, const plr_real *restrict Wt,
                                     size_t ld, plr_real *restrict P) {
    plr_real sum[CORNER][CORNER];
    for (unsigned c = 0; c < size; c++)
        for (unsigned r = c; r < size; r++)
            sum[r][c] = P[plr_packed_row(i + r) + i + c];
    Ut += i;
    Wt += i;
    for (unsigned k = 0; k < depth; k++) {
        for (unsigned r = 0; r < size; r++)
            for (unsigned c = 0; c <= r; c++)
                sum[r][c] = PLR_FMA(-Ut[r], Wt[c], sum[r][c]);
        Ut += ld;
        Wt += ld;
    }
    for (unsigned c = 0; c < size; c++)
        for (unsigned r = c; r < size; r++)
            P[plr_packed_row(i + r) + i + c] = sum[r][c];
}

/* The same for a size from 0 to CORNER. */
static void subtract_corner(unsigned size, unsigned i, unsigned depth, const plr_real *Ut,
                            const plr_real *Wt, size_t ld, plr_real *P) {
    if (size == 1)
        subtract_triangle(1, i, depth, Ut, Wt, ld, P);
    else if (size == 2)
        subtract_triangle(2, i, depth, Ut, Wt, ld, P);
    else if (size == 3)
        subtract_triangle(3, i, depth, Ut, Wt, ld, P);
    else if (size == 4)
        subtract_triangle(4, i, depth, Ut, Wt, ld, P);
}

/* The rows beyond a multiple of ROWS are the first, which are shortest. Of the others come first the
 * whole tiles, then cut ones where there is more than a triangle beside them. */
void plr_packed_subtract(unsigned n, unsigned depth, const plr_real *Ut, const plr_real *Wt,
                         size_t ld, plr_real *P) {
    PLR_ASSERT(ld >= n);
    if (depth < 2 || n < COLUMNS) {
        plr_packed_subtract_plain(n, depth, Ut, Wt, ld, P);
        return;
    }
    const unsigned alone = n % ROWS;
    if (alone <= CORNER)
        subtract_corner(alone, 0, depth, Ut, Wt, ld, P);
    else
        plr_packed_subtract_plain(alone, depth, Ut, Wt, ld, P);
    for (unsigned i = alone; i < n; i += ROWS) {
        plr_real *row[ROWS];
        for (unsigned r = 0; r < ROWS; r++)
            row[r] = P + plr_packed_row(i + r);
        unsigned j = (i + 1) / COLUMNS * COLUMNS;
        subtract_rows(j, depth, Ut + i, Wt, ld, row);
        for (; i + ROWS > j + CORNER; j += COLUMNS)
            subtract_cut_tile(i, j, depth, Ut, Wt, ld, P);
        if (j < i + ROWS)
            subtract_corner(i + ROWS - j, j, depth, Ut, Wt, ld, P);
    }
}

unsigned plr_packed_subtracted_diagonal(unsigned first, unsigned n, unsigned depth,
                                        const plr_real *restrict Ut, size_t ld,
                                        const plr_real *restrict P, plr_real d[PLR_TILE_COLUMNS]) {
    PLR_ASSERT(ld >= n && first % COLUMNS == 0);
    const unsigned width = n - first < COLUMNS ? n - first : COLUMNS;
    plr_real sum[COLUMNS] = {0};
    for (unsigned c = 0; c < width; c++)
        sum[c] = P[plr_packed_row(first + c) + first + c];
    const plr_real *restrict row = Ut + first;
    for (unsigned k = 0; k < depth; k++) {
        for (int c = 0; c < COLUMNS; c++)
            sum[c] = PLR_FMA(-row[c], row[c], sum[c]);
        row += ld;
    }
    memcpy(d, sum, sizeof sum);
    return width;
}

void plr_packed_subtract_plain(unsigned n, unsigned depth, const plr_real *Ut, const plr_real *Wt,
                               size_t ld, plr_real *P) {
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++) {
            plr_real sum = P[plr_packed_row(i) + j];
            for (unsigned k = 0; k < depth; k++)
                sum = PLR_FMA(-Ut[k * ld + i], Wt[k * ld + j], sum);
            P[plr_packed_row(i) + j] = sum;
        }
}
