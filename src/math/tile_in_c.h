// SPDX-License-Identifier: MIT
/* plr_tile_subtract of tile.h, which includes this file, for all but a Cortex-M. */
#ifndef PLR_MATH_TILE_IN_C_H
#define PLR_MATH_TILE_IN_C_H

static inline void plr_tile_subtract(unsigned depth, plr_tile_factors at,
                                     plr_real *row[PLR_TILE_ROWS]) {
    PLR_ASSERT(depth >= 2);
    plr_tile_row a0, a1, a2, a3;
    plr_tile_less(a0, at.U[0], at.W, row[0]);
    plr_tile_less(a1, at.U[1], at.W, row[1]);
    plr_tile_less(a2, at.U[2], at.W, row[2]);
    plr_tile_less(a3, at.U[3], at.W, row[3]);
    for (unsigned steps = depth - 2; steps > 0; steps--) {
        plr_tile_next(&at);
        plr_tile_reduce(a0, at.U[0], at.W);
        plr_tile_reduce(a1, at.U[1], at.W);
        plr_tile_reduce(a2, at.U[2], at.W);
        plr_tile_reduce(a3, at.U[3], at.W);
    }
    plr_tile_next(&at);
    plr_tile_less(row[0], at.U[0], at.W, a0);
    plr_tile_less(row[1], at.U[1], at.W, a1);
    plr_tile_less(row[2], at.U[2], at.W, a2);
    plr_tile_less(row[3], at.U[3], at.W, a3);
    for (int r = 0; r < PLR_TILE_ROWS; r++)
        row[r] += PLR_TILE_COLUMNS;
}

#endif
