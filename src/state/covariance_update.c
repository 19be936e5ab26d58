// SPDX-License-Identifier: MIT
/* The covariance in a correction. Most of the filter's time is spent here. */
#include "state/covariance.h"

#include "math/blocks3.h"
#include "math/dense.h"
#include "math/small.h"
#include "pelorus/assertions.h"
#include "state/elements.h"

PLR_SELDOM void plr_covariance_of_rows(const plr_belief *belief, const plr_rows *H, plr_real S[9]) {
    if (H->terms == 1 && plr_rows_begin_with_three(H)) {
        plr_real P[9], HP[9];
        plr_get_block(belief, H->term[0].row, 3, H->term[0].row, 3, P);
        plr_mat3_mul(HP, H->term[0].H, P);
        plr_mat3_mul_nt(S, HP, H->term[0].H);
        return;
    }
    memset(S, 0, 9 * sizeof *S);
    for (unsigned b = H->terms; b-- > 0;) {
        const plr_term *right = &H->term[b];
        plr_real HP[PLR_ROWS * PLR_WIDEST_BLOCK] = {0};
        for (unsigned a = H->terms; a-- > 0;) {
            const plr_term *left = &H->term[a];
            plr_real P[PLR_WIDEST_BLOCK * PLR_WIDEST_BLOCK];
            plr_get_block(belief, left->row, left->columns, right->row, right->columns, P);
            plr_gemm_nn(PLR_ROWS, right->columns, left->columns, left->H, left->columns, P,
                        right->columns, HP, right->columns);
        }
        plr_gemm_nt(PLR_ROWS, PLR_ROWS, right->columns, HP, right->columns, right->H,
                    right->columns, S, PLR_ROWS);
    }
}

PLR_SELDOM void plr_covariance_add_open_noise(const plr_belief *belief, const plr_noise *noise,
                                              const plr_rows *H, plr_real S[9]) {
    PLR_ASSERT(noise->open);
    const unsigned ld = plr_covariance_ld(belief);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        plr_real a[3];
        plr_rows_apply(H, noise->Wt + k * ld, a);
        for (unsigned i = 0; i < 3; i++)
            for (unsigned j = 0; j < 3; j++)
                S[3 * i + j] = PLR_FMA(a[i], a[j], S[3 * i + j]);
    }
}

/* out_r[i] = H_r x(i), i = first .. n-1: x(i) in row i of P, from column s on. H is copied. */
static inline void project_columns(unsigned first, unsigned n, const plr_real H[9],
                                   const plr_real *restrict P, unsigned s, plr_real *restrict out0,
                                   plr_real *restrict out1, plr_real *restrict out2) {
    const plr_real h[9] = {H[0], H[1], H[2], H[3], H[4], H[5], H[6], H[7], H[8]};
    const plr_real *at = P + plr_packed_row(first) + s;
    for (unsigned i = first; i < n; i++) {
        const plr_real x[3] = {at[0], at[1], at[2]};
        out0[i] = plr_dot3(h, x);
        out1[i] = plr_dot3(h + 3, x);
        out2[i] = plr_dot3(h + 6, x);
        at += i + 1;
    }
}

/* rows[r][i] = sum_c H[r][c] P(i, s + c): one pass over P, three columns at a time. */
static void project_landmark(const plr_belief *belief, unsigned n, unsigned s, const plr_real H[9],
                             plr_real *rows, size_t ld) {
    const plr_real *P = belief->P;
    plr_real *out0 = rows, *out1 = rows + ld, *out2 = rows + 2 * ld;
    plr_real own[9];
    plr_rows3_from_left(s, H, P + plr_packed_row(s), P + plr_packed_row(s + 1),
                        P + plr_packed_row(s + 2), out0, out1, out2);
    plr_get_block(belief, s, 3, s, 3, own);
    plr_rows3_from_left(3, H, own, own + 3, own + 6, out0 + s, out1 + s, out2 + s);
    project_columns(s + 3, n, H, P, s, out0, out1, out2);
}

void plr_covariance_project(const plr_belief *belief, const plr_rows *H, plr_real *rows,
                            size_t ld) {
    const unsigned n = plr_covariance_dim(belief);
    unsigned t = 0, filled = 0;
    if (plr_rows_begin_with_three(H)) {
        project_landmark(belief, n, H->term[0].row, H->term[0].H, rows, ld);
        filled = n;
        t = 1;
    }
    for (unsigned r = 0; r < PLR_ROWS; r++)
        memset(rows + r * ld + filled, 0, (ld - filled) * sizeof *rows);
    for (; t < H->terms; t++) {
        const plr_term *term = &H->term[t];
        for (unsigned r = 0; r < PLR_ROWS; r++)
            for (unsigned c = 0; c < term->columns; c++)
                plr_add_column(belief, n, term->row + c, term->H[r * term->columns + c],
                               rows + r * ld);
    }
}

bool plr_covariance_subtract(plr_belief *belief, const plr_real *Vt, unsigned depth) {
    const unsigned n = plr_covariance_dim(belief), ld = plr_covariance_ld(belief);
    plr_real after[PLR_TILE_COLUMNS];
    for (unsigned i = 0; i < n;) {
        const unsigned end =
            i + plr_packed_subtracted_diagonal(i, n, depth, Vt, ld, belief->P, after);
        for (const plr_real *variance = after; i < end; i++, variance++) {
            const plr_real before = belief->P[plr_packed_row(i) + i];
            const bool stays_zero = before <= 0 && before >= 0 && *variance <= 0 && *variance >= 0;
            if (!(*variance > 0) && !stays_zero)
                return false;
        }
    }
    plr_packed_subtract(n, depth, Vt, Vt, ld, belief->P);
    return true;
}

void plr_covariance_make_up_for_rounding(plr_belief *belief) {
    const plr_real seen = PLR_R(8) * PLR_EPSILON, unseen = PLR_EPSILON;
    for (unsigned slot = 0; slot < belief->count; slot++) {
        const unsigned row = plr_covariance_row(belief, slot);
        const plr_real share =
            belief->slots[slot].last_frame == belief->frame_number ? seen : unseen;
        for (unsigned i = row; i < row + 3; i++) {
            plr_real *variance = &belief->P[plr_packed_row(i) + i];
            *variance = PLR_FMA(share, *variance, *variance);
        }
    }
}
