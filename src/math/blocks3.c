// SPDX-License-Identifier: MIT
#include "math/blocks3.h"

static inline void transport_block(const plr_real *restrict F, const plr_real *restrict G,
                                   plr_real *restrict r0, plr_real *restrict r1,
                                   plr_real *restrict r2) {
    const plr_real X[9] = {r0[0], r0[1], r0[2], r1[0], r1[1], r1[2], r2[0], r2[1], r2[2]};
    const plr_real g[9] = {G[0], G[1], G[2], G[3], G[4], G[5], G[6], G[7], G[8]};
    plr_real FX[3]; /* a row at a time: X, G and this fit into the registers of a small FPU */
    plr_mat3_tvec(FX, X, F);
    plr_mat3_vec(r0, g, FX);
    plr_mat3_tvec(FX, X, F + 3);
    plr_mat3_vec(r1, g, FX);
    plr_mat3_tvec(FX, X, F + 6);
    plr_mat3_vec(r2, g, FX);
}

void plr_blocks3_transport(unsigned n, const plr_real F[9], const plr_real *G,
                           plr_real *const row[3]) {
    plr_real *r0 = row[0], *r1 = row[1], *r2 = row[2];
    for (unsigned j = 0; j < n; j++, G += 9, r0 += 3, r1 += 3, r2 += 3)
        transport_block(F, G, r0, r1, r2);
}

/* x <- G y. The fourth element is of no use: four numbers are calculated as fast as one. */
static inline void wide_row(plr_real *restrict x, const plr_real *restrict Gt,
                            const plr_real *restrict y) {
    for (int c = 0; c < PLR_WIDE_ROW; c++)
        x[c] = PLR_FMA(Gt[2 * PLR_WIDE_ROW + c], y[2],
                       PLR_FMA(Gt[PLR_WIDE_ROW + c], y[1], Gt[c] * y[0]));
}

void plr_blocks3_transport_wide(unsigned n, const plr_real F[9], const plr_real *Gt, plr_real *Y,
                                plr_real *const row[3]) {
    plr_real *r0 = row[0], *r1 = row[1], *r2 = row[2];
    const plr_real *y0 = Y, *y1 = Y + 3 * n, *y2 = Y + 6 * n;
    plr_rows3_from_left(3 * n, F, r0, r1, r2, Y, Y + 3 * n, Y + 6 * n);
    for (unsigned j = 0; j < n; j++, Gt += PLR_WIDE_FACTOR) {
        wide_row(r0 + 3 * j, Gt, y0 + 3 * j);
        wide_row(r1 + 3 * j, Gt, y1 + 3 * j);
        wide_row(r2 + 3 * j, Gt, y2 + 3 * j);
    }
}

void plr_blocks3_widen(unsigned n, const plr_real *G, plr_real *Gt) {
    for (unsigned j = 0; j < n; j++, G += 9, Gt += PLR_WIDE_FACTOR)
        for (int r = 0; r < 3; r++) {
            for (int c = 0; c < 3; c++)
                Gt[PLR_WIDE_ROW * r + c] = G[3 * c + r];
            Gt[PLR_WIDE_ROW * r + 3] = 0;
        }
}
