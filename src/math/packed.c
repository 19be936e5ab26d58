// SPDX-License-Identifier: MIT
#include "math/packed.h"

#include <string.h>

#include "math/tile.h"
#include "pelorus/assertions.h"

enum { ROWS = PLR_TILE_ROWS, COLUMNS = PLR_TILE_COLUMNS };

/* A tile that the diagonal cuts: only what lies inside is written; what is read outside does not
 * matter. */
static void subtract_cut_tile(unsigned i, unsigned j, unsigned depth, plr_tile_factors factors,
                              plr_real *row[ROWS]) {
    plr_tile_row tile[ROWS];
    plr_real *at[ROWS] = {tile[0], tile[1], tile[2], tile[3]};
    for (unsigned r = 0; r < ROWS; r++)
        memcpy(tile[r], row[r], sizeof tile[r]);
    plr_tile_subtract(depth, factors, at);
    for (unsigned r = 0; r < ROWS; r++) {
        for (unsigned c = 0; c < COLUMNS && j + c <= i + r; c++)
            row[r][c] = tile[r][c];
        row[r] += COLUMNS;
    }
}

/* The rows that are beyond a multiple of ROWS are the first ones: they are the shortest. */
void plr_packed_subtract(unsigned n, unsigned depth, const plr_real *Ut, const plr_real *Wt,
                         size_t ld, plr_real *P) {
    PLR_ASSERT(ld >= n);
    if (depth < 2) {
        plr_packed_subtract_plain(n, depth, Ut, Wt, ld, P);
        return;
    }
    plr_packed_subtract_plain(n % ROWS, depth, Ut, Wt, ld, P);
    for (unsigned i = n % ROWS; i < n; i += ROWS) {
        plr_real *row[ROWS];
        for (unsigned r = 0; r < ROWS; r++)
            row[r] = P + plr_packed_row(i + r);
        unsigned j = 0;
        for (; j + COLUMNS <= i + 1; j += COLUMNS) {
            const plr_tile_factors factors = {Ut + i, Wt + j, ld, ld, 0};
            plr_tile_subtract(depth, factors, row);
        }
        for (; j < i + ROWS; j += COLUMNS) {
            const plr_tile_factors factors = {Ut + i, Wt + j, ld, ld, 0};
            subtract_cut_tile(i, j, depth, factors, row);
        }
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
