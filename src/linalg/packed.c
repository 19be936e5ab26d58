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

/* row[r][c] += sum_k negated[k][r] Wt[k][c], for a tile of ROWS x COLUMNS that stays in registers.
 */
static inline void add_tile(unsigned depth, panel negated, const plr_real *restrict Wt, size_t ld,
                            plr_real *row[ROWS]) {
    plr_real a0[COLUMNS], a1[COLUMNS], a2[COLUMNS], a3[COLUMNS];
    memcpy(a0, row[0], sizeof a0);
    memcpy(a1, row[1], sizeof a1);
    memcpy(a2, row[2], sizeof a2);
    memcpy(a3, row[3], sizeof a3);
    for (unsigned k = 0; k < depth; k++) {
        const plr_real u0 = negated[k][0], u1 = negated[k][1], u2 = negated[k][2],
                       u3 = negated[k][3];
        for (int c = 0; c < COLUMNS; c++)
            a0[c] = PLR_FMA(u0, Wt[c], a0[c]);
        for (int c = 0; c < COLUMNS; c++)
            a1[c] = PLR_FMA(u1, Wt[c], a1[c]);
        for (int c = 0; c < COLUMNS; c++)
            a2[c] = PLR_FMA(u2, Wt[c], a2[c]);
        for (int c = 0; c < COLUMNS; c++)
            a3[c] = PLR_FMA(u3, Wt[c], a3[c]);
        Wt += ld;
    }
    memcpy(row[0], a0, sizeof a0);
    memcpy(row[1], a1, sizeof a1);
    memcpy(row[2], a2, sizeof a2);
    memcpy(row[3], a3, sizeof a3);
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
    for (unsigned i = 0; i < n; i++)
        d[i] = P[plr_packed_row(i) + i];
    for (unsigned k = 0; k < depth; k++)
        for (unsigned i = 0; i < n; i++)
            d[i] = PLR_FMA(-Ut[k * ld + i], Ut[k * ld + i], d[i]);
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
