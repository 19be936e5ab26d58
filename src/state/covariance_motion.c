// SPDX-License-Identifier: MIT
/* The covariance in a motion of the body, and the motion's noise, which is kept beside it. */
#include "state/covariance.h"

#include "math/dense.h"
#include "math/small.h"
#include "state/blocks.h"
#include "state/elements.h"
#include "state/pose.h"

enum { POSE_ROW = 0 }; /* the pose comes first in every layout */

/* row[0..5] <- row[0..5] A^T, with At = A^T. */
static inline void turn_pose_columns(plr_real *row, const plr_real At[PLR_POSE_SQUARE]) {
    plr_real turned[PLR_POSE_DIM] = {0};
    plr_gemm_nn(1, PLR_POSE_DIM, PLR_POSE_DIM, row, PLR_POSE_DIM, At, PLR_POSE_DIM, turned,
                PLR_POSE_DIM);
    memcpy(row, turned, sizeof turned);
}

static void transpose6(plr_real At[PLR_POSE_SQUARE], const plr_real A[PLR_POSE_SQUARE]) {
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        for (unsigned j = 0; j < PLR_POSE_DIM; j++)
            At[PLR_POSE_DIM * i + j] = A[PLR_POSE_DIM * j + i];
}

/* X <- F X G^T, 3x3, in three rows of P. */
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

/* X <- F X, 3xn, in three rows of P. */
static inline void turn_rows(unsigned n, const plr_real *restrict F, plr_real *restrict r0,
                             plr_real *restrict r1, plr_real *restrict r2) {
    for (unsigned j = 0; j < n; j++) {
        const plr_real x[3] = {r0[j], r1[j], r2[j]};
        r0[j] = plr_dot3(F, x);
        r1[j] = plr_dot3(F + 3, x);
        r2[j] = plr_dot3(F + 6, x);
    }
}

/* The three rows of one landmark: its F from the left, the factor of each column from the right. */
static void transport_landmark(plr_filter *f, unsigned slot, const plr_real At[PLR_POSE_SQUARE],
                               const plr_real *F) {
    const unsigned s = plr_covariance_row(f, slot), first = plr_core_dim(f);
    plr_real *r0 = f->P + plr_packed_row(s);
    plr_real *r1 = f->P + plr_packed_row(s + 1);
    plr_real *r2 = f->P + plr_packed_row(s + 2);
    const plr_real *own = F + 9 * slot;

    turn_rows(first, own, r0, r1, r2);
    turn_pose_columns(r0, At);
    turn_pose_columns(r1, At);
    turn_pose_columns(r2, At);
    for (unsigned j = first; j < s; j += 3, F += 9)
        transport_block(own, F, r0 + j, r1 + j, r2 + j);

    plr_real D[9], FD[9], FDFt[9];
    plr_get_block(f, s, 3, s, 3, D);
    plr_mat3_mul(FD, own, D);
    plr_mat3_mul_nt(FDFt, FD, own);
    plr_set_block(f, s, 3, s, 3, FDFt);
}

void plr_covariance_transport(plr_filter *f, const plr_real A[PLR_POSE_SQUARE], const plr_real *F) {
    plr_real P_xi[PLR_POSE_SQUARE], turned[PLR_POSE_SQUARE], At[PLR_POSE_SQUARE];
    plr_covariance_get(f, PLR_BLOCK_POSE, PLR_BLOCK_POSE, P_xi);
    plr_sandwich6(turned, A, P_xi);
    plr_set_block(f, POSE_ROW, PLR_POSE_DIM, POSE_ROW, PLR_POSE_DIM, turned);
    transpose6(At, A);
    for (unsigned i = PLR_POSE_DIM; i < plr_core_dim(f); i++)
        turn_pose_columns(f->P + plr_packed_row(i), At);
    for (unsigned slot = 0; slot < f->count; slot++)
        transport_landmark(f, slot, At, F);
}

void plr_covariance_motion_share(const plr_filter *f, unsigned row, unsigned rows,
                                 const plr_real K[PLR_POSE_SQUARE], plr_real *V) {
    const unsigned bias = plr_row_of(f, PLR_BLOCK_BIAS);
    memset(V, 0, PLR_POSE_DIM * rows * sizeof *V);
    if (!plr_has_block(f, PLR_BLOCK_BIAS))
        return;
    for (unsigned i = row; i < row + rows; i++) {
        plr_real before[PLR_POSE_DIM];
        const plr_real *P_ib = f->P + plr_packed_row(i) + bias;
        if (i < bias + PLR_BIAS_DIM) { /* a part of it is above the diagonal */
            plr_get_block(f, i, 1, bias, PLR_POSE_DIM, before);
            P_ib = before;
        }
        plr_gemm_nt(1, PLR_POSE_DIM, PLR_POSE_DIM, P_ib, PLR_POSE_DIM, K, PLR_POSE_DIM,
                    V + PLR_POSE_DIM * (i - row), PLR_POSE_DIM);
    }
}

void plr_covariance_open_noise(plr_filter *f, const plr_applied_motion *motion) {
    const unsigned n = plr_covariance_dim(f), ld = plr_covariance_ld(f);
    plr_noise *noise = &f->work.noise;
    memset(noise->Lambda, 0, sizeof noise->Lambda);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        noise->Lambda[plr_upper_row(PLR_POSE_DIM, k)] = 1;
        noise->eta[k] = -motion->z[k];
        noise->z[k] = motion->z[k];
    }
    noise->open = 1;
    if (!plr_has_block(f, PLR_BLOCK_BIAS))
        return;
    plr_real *Vt = f->work.Vt;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        memset(Vt + k * ld + n, 0, (ld - n) * sizeof *Vt);
    for (unsigned i = 0; i < n; i++) {
        plr_real v[PLR_POSE_DIM];
        plr_covariance_motion_share(f, i, 1, motion->K, v);
        for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
            Vt[k * ld + i] = v[k];
            noise->Wt[k * ld + i] += v[k];
            f->work.dx[i] = PLR_FMA(v[k], motion->z[k], f->work.dx[i]);
        }
    }
    plr_packed_subtract(n, PLR_POSE_DIM, Vt, Vt, ld, f->P);
}

void plr_covariance_close_noise(plr_filter *f, plr_real nu[PLR_POSE_DIM]) {
    const unsigned n = plr_covariance_dim(f), ld = plr_covariance_ld(f);
    plr_noise *noise = &f->work.noise;
    if (!noise->open)
        return;
    noise->open = 0;
    if (!plr_cholesky_upper(PLR_POSE_DIM, noise->Lambda)) {
        plr_filter_diverge(f);
        return;
    }
    plr_real *Xt = noise->Wt, *minus = f->work.Vt;
    plr_solve_upper_transposed(PLR_POSE_DIM, ld, noise->Lambda, Xt, ld);
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, noise->Lambda, noise->eta, 1);
    plr_combine_rows(n, PLR_POSE_DIM, noise->eta, Xt, ld, f->work.dx);
    for (unsigned i = 0; i < PLR_POSE_DIM * ld; i++)
        minus[i] = -Xt[i];
    plr_packed_subtract(n, PLR_POSE_DIM, minus, Xt, ld, f->P);
    for (unsigned i = plr_core_dim(f); i < n;
         i++) { /* makes up for the rounding of this addition */
        plr_real added = 0;
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            added = PLR_FMA(Xt[k * ld + i], Xt[k * ld + i], added);
        f->P[plr_packed_row(i) + i] += PLR_R(8) * PLR_EPSILON * added;
    }
    if (nu) {
        plr_solve_upper(PLR_POSE_DIM, noise->Lambda, noise->eta);
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            nu[k] = noise->z[k] + noise->eta[k];
    }
}

void plr_covariance_predict_pose(plr_filter *f, const plr_real A[PLR_POSE_SQUARE],
                                 const plr_real B[PLR_POSE_SQUARE],
                                 const plr_real M[PLR_POSE_SQUARE]) {
    const unsigned n = plr_covariance_dim(f), bias = plr_row_of(f, PLR_BLOCK_BIAS);
    const bool biased = plr_has_block(f, PLR_BLOCK_BIAS);
    plr_real P_xi[PLR_POSE_SQUARE], turned[PLR_POSE_SQUARE];
    plr_covariance_get(f, PLR_BLOCK_POSE, PLR_BLOCK_POSE, P_xi);
    plr_sandwich6(turned, A, P_xi);
    if (biased) {
        plr_real P_xib[PLR_POSE_SQUARE], AP[PLR_POSE_SQUARE], cross[PLR_POSE_SQUARE];
        plr_covariance_get(f, PLR_BLOCK_POSE, PLR_BLOCK_BIAS, P_xib);
        plr_mat6_mul(AP, A, P_xib);
        plr_mat6_mul_nt(cross, AP, B);
        for (unsigned i = 0; i < PLR_POSE_DIM; i++)
            for (unsigned j = 0; j < PLR_POSE_DIM; j++)
                turned[PLR_POSE_DIM * i + j] +=
                    cross[PLR_POSE_DIM * i + j] + cross[PLR_POSE_DIM * j + i];
    }
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        turned[i] += M[i];
    plr_set_block(f, POSE_ROW, PLR_POSE_DIM, POSE_ROW, PLR_POSE_DIM, turned);

    /* the other rows begin with their pose columns, and the bias columns follow */
    plr_real At[PLR_POSE_SQUARE];
    transpose6(At, A);
    for (unsigned i = PLR_POSE_DIM; i < n; i++) {
        plr_real *row = f->P + plr_packed_row(i);
        plr_real P_ib[PLR_POSE_DIM] = {0};
        if (biased)
            plr_get_block(f, i, 1, bias, PLR_POSE_DIM, P_ib);
        turn_pose_columns(row, At);
        if (biased)
            plr_gemm_nt(1, PLR_POSE_DIM, PLR_POSE_DIM, P_ib, PLR_POSE_DIM, B, PLR_POSE_DIM, row,
                        PLR_POSE_DIM);
    }
}
