// SPDX-License-Identifier: MIT
#include "math/packed.h"

#include <string.h>

#include "math/dense.h"
#include "math/tile.h"
#include "pelorus/assertions.h"

enum { ROWS = PLR_TILE_ROWS, COLUMNS = PLR_TILE_COLUMNS };

/* A tile that the diagonal cuts, from column j on: only what lies inside is written. */
static void subtract_cut_tile(unsigned i, unsigned j, unsigned depth, const plr_real *Ut,
                              const plr_real *Wt, size_t ld, plr_real *const row[ROWS]) {
    plr_tile_row tile[ROWS];
    plr_real *const at[ROWS] = {tile[0], tile[1], tile[2], tile[3]};
    for (unsigned r = 0; r < ROWS; r++)
        memcpy(tile[r], row[r] + j, sizeof tile[r]);
    plr_subtract_four_rows(COLUMNS, depth, Ut + i, ld, Wt + j, ld, at);
    for (unsigned r = 0; r < ROWS; r++)
        for (unsigned c = 0; c < COLUMNS && j + c <= i + r; c++)
            row[r][j + c] = tile[r][c];
}

/* P -= U W^T in the triangle of `size` rows from number i on. Inlined for each size. */
static inline void subtract_triangle(unsigned size, unsigned i, unsigned depth,
                                     const plr_real *restrict Ut, const plr_real *restrict Wt,
                                     size_t ld, plr_real *restrict P) {
    plr_real sum[ROWS][ROWS];
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

/* The same for a size from 0 to ROWS. */
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

/* The rows beyond a multiple of ROWS are the first, which are shortest. Of four rows come first the
 * whole tiles, then a cut one if there is more than a triangle beside them. */
void plr_packed_subtract(unsigned n, unsigned depth, const plr_real *Ut, const plr_real *Wt,
                         size_t ld, plr_real *P) {
    PLR_ASSERT(ld >= n);
    if (depth < 2 || n < COLUMNS) {
        plr_packed_subtract_plain(n, depth, Ut, Wt, ld, P);
        return;
    }
    subtract_corner(n % ROWS, 0, depth, Ut, Wt, ld, P);
    for (unsigned i = n % ROWS; i < n; i += ROWS) {
        plr_real *const row[ROWS] = {P + plr_packed_row(i), P + plr_packed_row(i + 1),
                                     P + plr_packed_row(i + 2), P + plr_packed_row(i + 3)};
        unsigned j = (i + 1) / COLUMNS * COLUMNS;
        plr_subtract_four_rows(j, depth, Ut + i, ld, Wt, ld, row);
        if (j < i) {
            subtract_cut_tile(i, j, depth, Ut, Wt, ld, row);
            j += COLUMNS;
        }
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
