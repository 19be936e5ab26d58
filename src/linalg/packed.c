// SPDX-License-Identifier: MIT
#include "linalg/packed.h"

#include <string.h>

enum { ROWS = 4, COLUMNS = PLR_TILE_COLUMNS };

/* U^T for ROWS rows of the product, negated and packed: negated[k][r] = -Ut[k][r]. */
typedef plr_real panel[PLR_WORK_ROWS][ROWS];

static void pack_negated(panel negated, unsigned depth, const plr_real *Ut, size_t ld) {
    for (unsigned k = 0; k < depth; k++)
        for (unsigned r = 0; r < ROWS; r++)
            negated[k][r] = -Ut[k * ld + r];
}

/* to[c] = u Wt[c] + from[c] for a row of the tile. */
static inline void add_row(plr_real *restrict to, plr_real u, const plr_real *restrict Wt,
                           const plr_real *restrict from) {
    for (int c = 0; c < COLUMNS; c++)
        to[c] = PLR_FMA(u, Wt[c], from[c]);
}

/* to[c] += u Wt[c] */
static inline void accumulate_row(plr_real *restrict to, plr_real u, const plr_real *restrict Wt) {
    for (int c = 0; c < COLUMNS; c++)
        to[c] = PLR_FMA(u, Wt[c], to[c]);
}

/* row[r][c] += sum_k negated[k][r] Wt[k][c], for a tile of ROWS x COLUMNS that stays in registers:
 * the first step reads P, the last one writes it, for a copy in and out would cost as much as a few
 * steps. depth >= 2. */
static inline void add_tile(unsigned depth, panel negated, const plr_real *restrict Wt, size_t ld,
                            plr_real *row[ROWS]) {
    plr_real a0[COLUMNS], a1[COLUMNS], a2[COLUMNS], a3[COLUMNS];
    add_row(a0, negated[0][0], Wt, row[0]);
    add_row(a1, negated[0][1], Wt, row[1]);
    add_row(a2, negated[0][2], Wt, row[2]);
    add_row(a3, negated[0][3], Wt, row[3]);
    for (unsigned k = 1; k + 1 < depth; k++) {
        Wt += ld;
        const plr_real u0 = negated[k][0], u1 = negated[k][1];
        const plr_real u2 = negated[k][2], u3 = negated[k][3];
        accumulate_row(a0, u0, Wt);
        accumulate_row(a1, u1, Wt);
        accumulate_row(a2, u2, Wt);
        accumulate_row(a3, u3, Wt);
    }
    Wt += ld;
    add_row(row[0], negated[depth - 1][0], Wt, a0);
    add_row(row[1], negated[depth - 1][1], Wt, a1);
    add_row(row[2], negated[depth - 1][2], Wt, a2);
    add_row(row[3], negated[depth - 1][3], Wt, a3);
}

/* Elements of row i that lie in the tile's columns from j on, inside the lower triangle. */
static unsigned inside(unsigned n, unsigned i, unsigned j) {
    if (i >= n || i < j)
        return 0;
    const unsigned count = i + 1 - j;
    return count < COLUMNS ? count : COLUMNS;
}

/* A tile that the diagonal or the last row cuts: on a copy, of which only the inside goes back. */
static void add_cut_tile(unsigned n, unsigned i, unsigned j, unsigned depth, panel negated,
                         const plr_real *Wt, size_t ld, plr_real *P) {
    plr_real copy[ROWS][COLUMNS] = {{0}};
    plr_real *row[ROWS];
    for (unsigned r = 0; r < ROWS; r++) {
        row[r] = copy[r];
        memcpy(copy[r], P + plr_packed_row(i + r) + j, inside(n, i + r, j) * sizeof(plr_real));
    }
    add_tile(depth, negated, Wt + j, ld, row);
    for (unsigned r = 0; r < ROWS; r++)
        memcpy(P + plr_packed_row(i + r) + j, copy[r], inside(n, i + r, j) * sizeof(plr_real));
}

void plr_packed_subtract(unsigned n, unsigned depth, const plr_real *Ut, const plr_real *Wt,
                         size_t ld, plr_real *P) {
    if (depth < 2) {
        plr_packed_subtract_plain(n, depth, Ut, Wt, ld, P);
        return;
    }
    panel negated;
    for (unsigned i = 0; i < n; i += ROWS) {
        pack_negated(negated, depth, Ut + i, ld);
        const unsigned last = i + ROWS <= n ? i + ROWS - 1 : n - 1;
        for (unsigned j = 0; j <= last; j += COLUMNS) {
            if (i + ROWS <= n && j + COLUMNS <= i + 1) {
                plr_real *row[ROWS];
                for (unsigned r = 0; r < ROWS; r++)
                    row[r] = P + plr_packed_row(i + r) + j;
                add_tile(depth, negated, Wt + j, ld, row);
            } else {
                add_cut_tile(n, i, j, depth, negated, Wt, ld, P);
            }
        }
    }
}

void plr_packed_subtracted_diagonal(unsigned n, unsigned depth, const plr_real *restrict Ut,
                                    size_t ld, const plr_real *restrict P, plr_real *restrict d) {
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
