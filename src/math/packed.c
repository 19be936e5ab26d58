// SPDX-License-Identifier: MIT
#include "math/packed.h"

#include <string.h>

#include "math/tile.h"
#include "pelorus/assertions.h"

enum { ROWS = PLR_TILE_ROWS, COLUMNS = PLR_TILE_COLUMNS };

/* Where the tile's rows begin, at column j of P; those after the last one are `beyond`. */
static void find_rows(unsigned n, unsigned i, unsigned j, plr_real *P, plr_real *beyond,
                      plr_real *row[ROWS]) {
    for (unsigned r = 0; r < ROWS; r++)
        row[r] = i + r < n ? P + plr_packed_row(i + r) + j : beyond;
}

/* A tile that the diagonal or the last row cuts: only what lies inside is written; what is read
 * outside does not matter. */
static void subtract_cut_tile(unsigned n, unsigned i, unsigned j, unsigned depth,
                              plr_tile_factors factors, plr_real *P) {
    plr_tile_row beyond = {0}, result[ROWS];
    plr_real *const to[ROWS] = {result[0], result[1], result[2], result[3]};
    plr_real *row[ROWS];
    find_rows(n, i, j, P, beyond, row);
    plr_tile_subtract(depth, factors, row, to);
    for (unsigned r = 0; r < ROWS && i + r < n; r++)
        for (unsigned c = 0; c < COLUMNS && j + c <= i + r; c++)
            row[r][c] = result[r][c];
}

void plr_packed_subtract(unsigned n, unsigned depth, const plr_real *Ut, const plr_real *Wt,
                         size_t ld, plr_real *P) {
    PLR_ASSERT(ld >= n);
    if (depth < 2) {
        plr_packed_subtract_plain(n, depth, Ut, Wt, ld, P);
        return;
    }
    for (unsigned i = 0; i < n; i += ROWS) {
        plr_tile_factors factors = {.U = Ut + i, .W = Wt, .to_next_U = ld, .to_next_W = ld};
        const unsigned whole = i + ROWS <= n ? (i + 1) / COLUMNS * COLUMNS : 0;
        plr_real *row[ROWS];
        find_rows(n, i, 0, P, NULL, row);
        unsigned j = 0;
        for (; j < whole; j += COLUMNS) {
            plr_real *const at[ROWS] = {row[0] + j, row[1] + j, row[2] + j, row[3] + j};
            plr_tile_subtract(depth, factors, at, at);
            factors.W += COLUMNS;
        }
        for (; j < n && j < i + ROWS; j += COLUMNS) {
            subtract_cut_tile(n, i, j, depth, factors, P);
            factors.W += COLUMNS;
        }
    }
}

void plr_packed_subtracted_diagonal(unsigned n, unsigned depth, const plr_real *restrict Ut,
                                    size_t ld, const plr_real *restrict P, plr_real *restrict d) {
    PLR_ASSERT(ld >= n);
    for (unsigned j = 0; j < n; j += COLUMNS) {
        const unsigned width = n - j < COLUMNS ? n - j : COLUMNS;
        plr_real sum[COLUMNS] = {0};
        for (unsigned c = 0; c < width; c++)
            sum[c] = P[plr_packed_row(j + c) + j + c];
        const plr_real *restrict row = Ut + j;
        for (unsigned k = 0; k < depth; k++) {
            for (int c = 0; c < COLUMNS; c++)
                sum[c] = PLR_FMA(-row[c], row[c], sum[c]);
            row += ld;
        }
        memcpy(d + j, sum, width * sizeof *d);
    }
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
