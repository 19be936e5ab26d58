// SPDX-License-Identifier: MIT
/* Rows of 3x3 blocks, each multiplied from both sides: a landmark's rows of the covariance when the
 * landmarks are transported. */
#ifndef PLR_MATH_BLOCKS3_H
#define PLR_MATH_BLOCKS3_H

#include "pelorus/config.h"

enum {
    PLR_WIDE_ROW =
        4, /* a row of a factor of plr_blocks3_transport_wide: 3 elements and one unused */
    PLR_WIDE_FACTOR = 3 * PLR_WIDE_ROW
};

/* X_j <- F X_j G_j^T, j = 0 .. n-1: n blocks side by side in three rows of 3n elements. G: 9 elements
 * for each j, row by row. For processors that calculate one number at a time. */
void plr_blocks3_transport(unsigned n, const plr_real F[9], const plr_real *G,
                           plr_real *const row[3]);

/* The same bits, for processors whose registers hold several numbers: three times as fast there.
 * Gt: G_j^T for each j, PLR_WIDE_FACTOR elements. It writes to one element after the end of each
 * row. Y: space for 3 x 3n elements. */
void plr_blocks3_transport_wide(unsigned n, const plr_real F[9], const plr_real *Gt, plr_real *Y,
                                plr_real *const row[3]);

/* Gt_j <- G_j^T, j = 0 .. n-1, in the layout of plr_blocks3_transport_wide. */
void plr_blocks3_widen(unsigned n, const plr_real *G, plr_real *Gt);

#endif
