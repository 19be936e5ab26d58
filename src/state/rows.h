// SPDX-License-Identifier: MIT
/* Three rows of numbers that depend linearly on the state's error x: y = H_0 x_0 + H_1 x_1, where
 * x_0 and x_1 are blocks of x. This is all that a measurement knows of the state. */
#ifndef PLR_STATE_ROWS_H
#define PLR_STATE_ROWS_H

#include "math/small.h"
#include "pelorus/config.h"

/* H x of one block of the state. */
typedef struct plr_term {
    unsigned row;                            /* the block's first row in the state */
    unsigned columns;                        /* its size, 1 to PLR_WIDEST_BLOCK */
    plr_real H[PLR_ROWS * PLR_WIDEST_BLOCK]; /* PLR_ROWS x columns */
} plr_term;

typedef struct plr_rows {
    unsigned terms; /* 1 or 2 */
    plr_term term[2];
} plr_rows;

/* Three rows over the body's twist u = (v, w), z = M u + N(0, R); the process knows how u depends
 * on the state. A row that is not measured has M = 0, z = 0 and R = 1. */
typedef struct plr_twist_rows {
    plr_real z[PLR_ROWS];
    plr_real M[PLR_ROWS * PLR_POSE_DIM];
    plr_real R[PLR_ROWS]; /* variances */
} plr_twist_rows;

/* The derivative of three rows by the errors of the wheels: scale, track. */
typedef struct plr_by_wheel {
    plr_real error[2][PLR_ROWS];
} plr_by_wheel;

/* Adds a block: sets where it is, and returns its H, which the caller fills. */
static inline plr_real *plr_rows_add(plr_rows *rows, unsigned row, unsigned columns) {
    plr_term *term = &rows->term[rows->terms++];
    term->row = row;
    term->columns = columns;
    return term->H;
}

/* True if the first block has three columns, as a landmark's: there are special kernels. */
static inline bool plr_rows_begin_with_three(const plr_rows *rows) {
    return rows->term[0].columns == PLR_LANDMARK_DIM;
}

/* out = H x, three rows: x is a vector over the state. */
static inline void plr_rows_apply(const plr_rows *rows, const plr_real *x, plr_real out[3]) {
    unsigned t = 0;
    if (plr_rows_begin_with_three(rows)) {
        plr_mat3_vec(out, rows->term[0].H, x + rows->term[0].row);
        t = 1;
    } else {
        out[0] = out[1] = out[2] = 0;
    }
    for (; t < rows->terms; t++) {
        const plr_term *term = &rows->term[t];
        for (unsigned r = 0; r < PLR_ROWS; r++)
            for (unsigned c = 0; c < term->columns; c++)
                out[r] = PLR_FMA(term->H[r * term->columns + c], x[term->row + c], out[r]);
    }
}

#endif
