// SPDX-License-Identifier: MIT
/* Three rows of a matrix, as of a landmark in P: multiplied from the left, and as 3x3 blocks. */
#ifndef PLR_MATH_BLOCKS3_H
#define PLR_MATH_BLOCKS3_H

#include "math/small.h"

enum {
    PLR_WIDE_ROW =
        4, /* a row of a factor of plr_blocks3_transport_wide: 3 elements and one unused */
    PLR_WIDE_FACTOR = 3 * PLR_WIDE_ROW
};

/* Y <- F X, 3 x n, all rows apart. F is copied, or it would be loaded for each column. */
static inline void plr_rows3_from_left(unsigned n, const plr_real F[9], const plr_real *restrict x0,
                                       const plr_real *restrict x1, const plr_real *restrict x2,
                                       plr_real *restrict y0, plr_real *restrict y1,
                                       plr_real *restrict y2) {
    const plr_real f[9] = {F[0], F[1], F[2], F[3], F[4], F[5], F[6], F[7], F[8]};
    for (unsigned c = 0; c < n; c++) {
        const plr_real x[3] = {x0[c], x1[c], x2[c]};
        y0[c] = plr_dot3(f, x);
        y1[c] = plr_dot3(f + 3, x);
        y2[c] = plr_dot3(f + 6, x);
    }
}

/* X_j <- F X_j G_j^T, j = 0 .. n-1: n blocks side by side in three rows of 3n elements. G: 9
 * elements for each j, row by row. For processors that calculate one number at a time. */
void plr_blocks3_transport(unsigned n, const plr_real F[9], const plr_real *G,
                           plr_real *const row[3]);

/* The same bits, three times as fast where registers hold several numbers. Gt: G_j^T, each of
 * PLR_WIDE_FACTOR elements. Writes one element after the end of each row. Y: room for 3 x 3n. */
void plr_blocks3_transport_wide(unsigned n, const plr_real F[9], const plr_real *Gt, plr_real *Y,
                                plr_real *const row[3]);

/* Gt_j <- G_j^T, j = 0 .. n-1, in the layout of plr_blocks3_transport_wide. */
void plr_blocks3_widen(unsigned n, const plr_real *G, plr_real *Gt);

#endif
