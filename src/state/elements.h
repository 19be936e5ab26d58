// SPDX-License-Identifier: MIT
/* Access to blocks of P, for covariance.c, covariance_motion.c and covariance_update.c alone. */
#ifndef PLR_STATE_ELEMENTS_H
#define PLR_STATE_ELEMENTS_H

#include "math/packed.h"
#include "pelorus/assertions.h"
#include "pelorus/belief.h"

/* B (rows x columns) = P[row.., column..], dense, on either side of the diagonal. */
static inline void plr_get_block(const plr_belief *belief, unsigned row, unsigned rows,
                                 unsigned column, unsigned columns, plr_real *B) {
    PLR_ASSERT(row + rows <= PLR_MAX_LD && column + columns <= PLR_MAX_LD);
    for (unsigned i = 0; i < rows; i++) {
        const unsigned r = row + i;
        const plr_real *at = belief->P + plr_packed_at(r, column);
        for (unsigned c = column; c < column + columns; c++) {
            *B++ = *at;
            at += c < r ? 1 : c + 1; /* along row r, then down column r */
        }
    }
}

/* The reverse. Of a block on the diagonal only the lower triangle is used. */
static inline void plr_set_block(plr_belief *belief, unsigned row, unsigned rows, unsigned column,
                                 unsigned columns, const plr_real *B) {
    PLR_ASSERT(row + rows <= PLR_MAX_LD && column + columns <= PLR_MAX_LD);
    for (unsigned i = 0; i < rows; i++)
        for (unsigned j = 0; j < columns; j++)
            if (row + i >= column + j)
                belief->P[plr_packed_row(row + i) + column + j] = B[i * columns + j];
}

/* out[i] += a P(i, column) for all rows i, on either side of the diagonal. */
static inline void plr_add_column(const plr_belief *belief, unsigned n, unsigned column, plr_real a,
                                  plr_real *restrict out) {
    PLR_ASSERT(column < n && n <= PLR_MAX_LD);
    const plr_real *restrict row = belief->P + plr_packed_row(column);
    for (unsigned i = 0; i < column; i++)
        out[i] = PLR_FMA(a, row[i], out[i]);
    const plr_real *x = row + column;
    for (unsigned i = column; i < n; i++) {
        out[i] = PLR_FMA(a, *x, out[i]);
        x += i + 1;
    }
}

#endif
