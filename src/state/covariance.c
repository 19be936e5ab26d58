// SPDX-License-Identifier: MIT
#include "state/covariance.h"

#include "math/dense.h"
#include "math/packed.h"
#include "math/small.h"
#include "state/motion.h"
#include "state/pose.h"

enum { POSE = 0, BIAS = PLR_POSE_DIM };

static unsigned first_landmark_row(const plr_filter *f) {
    return f->config.bias ? BIAS + PLR_BIAS_DIM : BIAS;
}

unsigned plr_covariance_row(const plr_filter *f, unsigned slot) {
    return first_landmark_row(f) + PLR_LANDMARK_DIM * slot;
}

unsigned plr_covariance_dim(const plr_filter *f) {
    return plr_covariance_row(f, f->count);
}

unsigned plr_covariance_ld(const plr_filter *f) {
    return (plr_covariance_dim(f) + PLR_TILE_COLUMNS - 1) / PLR_TILE_COLUMNS * PLR_TILE_COLUMNS;
}

/* B (rows x columns) = P[row.., column..], dense, whichever side of the diagonal. */
static void get_block(const plr_filter *f, unsigned row, unsigned rows, unsigned column,
                      unsigned columns, plr_real *B) {
    for (unsigned i = 0; i < rows; i++)
        for (unsigned j = 0; j < columns; j++)
            B[i * columns + j] = f->P[plr_packed_at(row + i, column + j)];
}

/* The reverse. Of a block on the diagonal the lower triangle is taken. */
static void set_block(plr_filter *f, unsigned row, unsigned rows, unsigned column, unsigned columns,
                      const plr_real *B) {
    for (unsigned i = 0; i < rows; i++)
        for (unsigned j = 0; j < columns; j++)
            if (row + i >= column + j)
                f->P[plr_packed_row(row + i) + column + j] = B[i * columns + j];
}

/* ---------------------------------------------------------------- blocks */

void plr_covariance_set_pose(plr_filter *f, const double P_xi[36]) {
    for (unsigned i = 0; i < 6; i++)
        for (unsigned j = 0; j <= i; j++)
            f->P[plr_packed_at(POSE + i, POSE + j)] = (plr_real)P_xi[6 * i + j];
    if (f->config.bias) {
        static const plr_real zero[36] = {0};
        set_block(f, BIAS, 6, POSE, 6, zero);
    }
}

void plr_covariance_widen_pose(plr_filter *f, const plr_real C[36]) {
    for (unsigned i = 0; i < 6; i++)
        for (unsigned j = 0; j <= i; j++)
            f->P[plr_packed_at(POSE + i, POSE + j)] += C[6 * i + j];
}

void plr_covariance_set_bias(plr_filter *f, const double variance[6]) {
    for (unsigned i = 0; i < 6; i++) {
        plr_real *row = f->P + plr_packed_row(BIAS + i);
        memset(row, 0, (BIAS + i) * sizeof *row);
        row[BIAS + i] = (plr_real)variance[i];
    }
}

void plr_covariance_pose(const plr_filter *f, plr_real P_xi[36]) {
    get_block(f, POSE, 6, POSE, 6, P_xi);
}

void plr_covariance_bias(const plr_filter *f, plr_real P_b[36]) {
    get_block(f, BIAS, 6, BIAS, 6, P_b);
}

void plr_covariance_pose_bias(const plr_filter *f, plr_real P_xib[36]) {
    get_block(f, POSE, 6, BIAS, 6, P_xib);
}

void plr_covariance_joint(const plr_filter *f, unsigned slot, const plr_real J_pose[18],
                          const plr_real J_landmark[9], plr_real P_out[9]) {
    const unsigned s = plr_covariance_row(f, slot);
    plr_real P_xx[36], P_lx[18], P_ll[9];
    get_block(f, POSE, 6, POSE, 6, P_xx);
    get_block(f, s, 3, POSE, 6, P_lx);
    get_block(f, s, 3, s, 3, P_ll);

    /* Jx P_xx + Jl P_lx and Jx P_xl + Jl P_ll, then times [Jx Jl]^T */
    plr_real left[18] = {0}, right[9] = {0};
    plr_gemm_nn(3, 6, 6, J_pose, 6, P_xx, 6, left, 6);
    plr_gemm_nn(3, 6, 3, J_landmark, 3, P_lx, 6, left, 6);
    plr_gemm_nt(3, 3, 6, J_pose, 6, P_lx, 6, right, 3);
    plr_gemm_nn(3, 3, 3, J_landmark, 3, P_ll, 3, right, 3);
    memset(P_out, 0, 9 * sizeof *P_out);
    plr_gemm_nt(3, 3, 6, left, 6, J_pose, 6, P_out, 3);
    plr_gemm_nt(3, 3, 3, right, 3, J_landmark, 3, P_out, 3);
}

void plr_covariance_landmark(const plr_filter *f, unsigned slot, plr_real P_ll[9]) {
    const unsigned s = plr_covariance_row(f, slot);
    get_block(f, s, 3, s, 3, P_ll);
}

plr_real plr_covariance_of_range(const plr_filter *f, unsigned slot) {
    const unsigned row = plr_covariance_row(f, slot) + 2;
    return f->P[plr_packed_at(row, row)];
}

double plr_covariance_trace(const plr_filter *f) {
    const unsigned n = plr_covariance_dim(f);
    double trace = 0;
    for (unsigned i = 0; i < n; i++)
        trace += (double)f->P[plr_packed_row(i) + i];
    return trace;
}

bool plr_covariance_is_positive(const plr_filter *f) {
    const unsigned n = plr_covariance_dim(f);
    for (unsigned i = 0; i < n; i++) {
        const plr_real variance = f->P[plr_packed_row(i) + i];
        if (!(variance >= 0) || !plr_is_finite(variance))
            return false;
    }
    return true;
}

/* ---------------------------------------------------------------- motion */

/* row[0..5] <- row[0..5] A^T; At is A^T, so that the columns advance together. */
static inline void turn_pose_columns(plr_real *row, const plr_real At[36]) {
    plr_real turned[6] = {0};
    plr_gemm_nn(1, 6, 6, row, 6, At, 6, turned, 6);
    memcpy(row, turned, sizeof turned);
}

static void transpose6(plr_real At[36], const plr_real A[36]) {
    for (unsigned i = 0; i < 6; i++)
        for (unsigned j = 0; j < 6; j++)
            At[6 * i + j] = A[6 * j + i];
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

/* The three rows of one landmark: left by its F, right by what stands at each column. */
static void transport_landmark(plr_filter *f, unsigned slot, const plr_real At[36],
                               const plr_real *F) {
    const unsigned s = plr_covariance_row(f, slot), first = first_landmark_row(f);
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
    get_block(f, s, 3, s, 3, D);
    plr_mat3_mul(FD, own, D);
    plr_mat3_mul_nt(FDFt, FD, own);
    set_block(f, s, 3, s, 3, FDFt);
}

void plr_covariance_transport(plr_filter *f, const plr_real A[36], const plr_real *F) {
    plr_real P_xi[36], turned[36], At[36];
    get_block(f, POSE, 6, POSE, 6, P_xi);
    plr_sandwich6(turned, A, P_xi);
    set_block(f, POSE, 6, POSE, 6, turned);
    transpose6(At, A);
    for (unsigned i = BIAS; i < first_landmark_row(f); i++)
        turn_pose_columns(f->P + plr_packed_row(i), At);
    for (unsigned slot = 0; slot < f->count; slot++)
        transport_landmark(f, slot, At, F);
}

void plr_covariance_motion_share(const plr_filter *f, unsigned row, unsigned rows,
                                 const plr_real K[36], plr_real *V) {
    memset(V, 0, 6 * rows * sizeof *V);
    if (!f->config.bias)
        return;
    for (unsigned i = row; i < row + rows; i++) {
        plr_real before[6];
        const plr_real *P_ib = f->P + plr_packed_row(i) + BIAS;
        if (i < BIAS + PLR_BIAS_DIM) { /* a part of it stands above the diagonal */
            get_block(f, i, 1, BIAS, 6, before);
            P_ib = before;
        }
        plr_gemm_nt(1, 6, 6, P_ib, 6, K, 6, V + 6 * (i - row), 6);
    }
}

void plr_covariance_open_noise(plr_filter *f, const plr_applied_motion *motion) {
    const unsigned n = plr_covariance_dim(f), ld = plr_covariance_ld(f);
    plr_noise *noise = &f->work.noise;
    memset(noise->Lambda, 0, sizeof noise->Lambda);
    for (unsigned k = 0; k < 6; k++) {
        noise->Lambda[plr_upper_row(6, k)] = 1;
        noise->eta[k] = -motion->z[k];
        noise->z[k] = motion->z[k];
    }
    noise->open = 1;
    if (!f->config.bias)
        return;
    plr_real *Vt = f->work.Vt;
    for (unsigned k = 0; k < 6; k++)
        memset(Vt + k * ld + n, 0, (ld - n) * sizeof *Vt);
    for (unsigned i = 0; i < n; i++) {
        plr_real v[6];
        plr_covariance_motion_share(f, i, 1, motion->K, v);
        for (unsigned k = 0; k < 6; k++) {
            Vt[k * ld + i] = v[k];
            noise->Wt[k * ld + i] += v[k];
            f->work.dx[i] = PLR_FMA(v[k], motion->z[k], f->work.dx[i]);
        }
    }
    plr_packed_subtract(n, 6, Vt, Vt, ld, f->P);
}

void plr_covariance_close_noise(plr_filter *f, plr_real nu[6]) {
    const unsigned n = plr_covariance_dim(f), ld = plr_covariance_ld(f);
    plr_noise *noise = &f->work.noise;
    if (!noise->open)
        return;
    noise->open = 0;
    if (!plr_cholesky_upper(6, noise->Lambda)) {
        plr_filter_diverge(f);
        return;
    }
    plr_real *Xt = noise->Wt, *minus = f->work.Vt;
    plr_solve_upper_transposed(6, ld, noise->Lambda, Xt, ld);
    plr_solve_upper_transposed(6, 1, noise->Lambda, noise->eta, 1);
    plr_combine_rows(n, 6, noise->eta, Xt, ld, f->work.dx);
    for (unsigned i = 0; i < 6 * ld; i++)
        minus[i] = -Xt[i];
    plr_packed_subtract(n, 6, minus, Xt, ld, f->P);
    for (unsigned i = first_landmark_row(f); i < n;
         i++) { /* what it rounds away of what was there */
        plr_real added = 0;
        for (unsigned k = 0; k < 6; k++)
            added = PLR_FMA(Xt[k * ld + i], Xt[k * ld + i], added);
        f->P[plr_packed_row(i) + i] += PLR_R(8) * PLR_EPSILON * added;
    }
    if (nu) {
        plr_solve_upper(6, noise->Lambda, noise->eta);
        for (unsigned k = 0; k < 6; k++)
            nu[k] = noise->z[k] + noise->eta[k];
    }
}

/* B P_bb B^T + Q, 6x6 */
static void motion_covariance(const plr_filter *f, const plr_motion *motion, plr_real M[36]) {
    memset(M, 0, 36 * sizeof *M);
    if (f->config.bias) {
        plr_real P_b[36];
        plr_covariance_bias(f, P_b);
        plr_sandwich6(M, motion->B, P_b);
    }
    for (unsigned i = 0; i < 36; i++)
        M[i] += motion->Q[i];
}

void plr_covariance_predict_pose(plr_filter *f, const plr_real A[36], const plr_motion *motion) {
    const unsigned n = plr_covariance_dim(f);
    plr_real P_xi[36], turned[36];
    get_block(f, POSE, 6, POSE, 6, P_xi);
    plr_sandwich6(turned, A, P_xi);
    if (f->config.bias) {
        plr_real P_xib[36], AP[36] = {0}, cross[36] = {0};
        get_block(f, POSE, 6, BIAS, 6, P_xib);
        plr_gemm_nn(6, 6, 6, A, 6, P_xib, 6, AP, 6);
        plr_gemm_nt(6, 6, 6, AP, 6, motion->B, 6, cross, 6);
        for (unsigned i = 0; i < 6; i++)
            for (unsigned j = 0; j < 6; j++)
                turned[6 * i + j] += cross[6 * i + j] + cross[6 * j + i];
    }
    plr_real M[36];
    motion_covariance(f, motion, M);
    for (unsigned i = 0; i < 36; i++)
        turned[i] += M[i];
    set_block(f, POSE, 6, POSE, 6, turned);

    /* the other rows begin with their pose columns, and the bias columns follow */
    plr_real At[36];
    transpose6(At, A);
    for (unsigned i = PLR_POSE_DIM; i < n; i++) {
        plr_real *row = f->P + plr_packed_row(i);
        plr_real P_ib[6] = {0};
        if (f->config.bias)
            get_block(f, i, 1, BIAS, 6, P_ib);
        turn_pose_columns(row, At);
        if (f->config.bias)
            plr_gemm_nt(1, 6, 6, P_ib, 6, motion->B, 6, row, 6);
    }
}

void plr_covariance_add_bias_walk(plr_filter *f, plr_real velocity, plr_real gyro) {
    for (unsigned i = 0; i < PLR_BIAS_DIM; i++)
        f->P[plr_packed_at(BIAS + i, BIAS + i)] += i < 3 ? velocity : gyro;
}

/* ---------------------------------------------------------------- update */

void plr_covariance_innovation(const plr_filter *f, unsigned slot, const plr_linearisation *lin,
                               plr_real S[6]) {
    const unsigned s = plr_covariance_row(f, slot);
    plr_real full[9];
    if (lin->uses_pose) {
        plr_covariance_joint(f, slot, lin->H_pose, lin->H_landmark, full);
    } else {
        plr_real P_ll[9], HP[9];
        get_block(f, s, 3, s, 3, P_ll);
        plr_mat3_mul(HP, lin->H_landmark, P_ll);
        plr_mat3_mul_nt(full, HP, lin->H_landmark);
    }
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = i; j < 3; j++)
            *S++ = full[3 * j + i];
}

void plr_covariance_add_open_noise(const plr_filter *f, unsigned slot, const plr_linearisation *lin,
                                   plr_real S[6]) {
    const unsigned s = plr_covariance_row(f, slot), ld = plr_covariance_ld(f);
    for (unsigned k = 0; k < 6; k++) {
        const plr_real *w = f->work.noise.Wt + k * ld;
        plr_real a[3];
        plr_mat3_vec(a, lin->H_landmark, w + s);
        for (unsigned i = 0; i < 3; i++)
            for (unsigned j = i; j < 3; j++)
                S[plr_upper_row(3, i) + j - i] =
                    PLR_FMA(a[i], a[j], S[plr_upper_row(3, i) + j - i]);
    }
}

/* out[i] += a P(i, column) for all rows i, whichever side of the diagonal. */
static void add_column(const plr_filter *f, unsigned n, unsigned column, plr_real a,
                       plr_real *restrict out) {
    const plr_real *restrict row = f->P + plr_packed_row(column);
    for (unsigned i = 0; i < column; i++)
        out[i] = PLR_FMA(a, row[i], out[i]);
    const plr_real *x = row + column;
    for (unsigned i = column; i < n; i++) {
        out[i] = PLR_FMA(a, *x, out[i]);
        x += i + 1;
    }
}

/* out_r[i] = H_r x(i), r = 0 .. 2, i = 0 .. n-1: x(i) stands in three rows. H is taken by value, or
 * the compiler would load it for each i. */
static inline void project_rows(unsigned n, const plr_real H[9], const plr_real *restrict x0,
                                const plr_real *restrict x1, const plr_real *restrict x2,
                                plr_real *restrict out0, plr_real *restrict out1,
                                plr_real *restrict out2) {
    const plr_real h[9] = {H[0], H[1], H[2], H[3], H[4], H[5], H[6], H[7], H[8]};
    for (unsigned i = 0; i < n; i++) {
        const plr_real x[3] = {x0[i], x1[i], x2[i]};
        out0[i] = plr_dot3(h, x);
        out1[i] = plr_dot3(h + 3, x);
        out2[i] = plr_dot3(h + 6, x);
    }
}

/* The same for i = first .. n-1, where x(i) stands in row i of P, from column s on. */
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
static void project_landmark(const plr_filter *f, unsigned n, unsigned s, const plr_real H[9],
                             plr_real *rows, size_t ld) {
    const plr_real *P = f->P;
    plr_real *out0 = rows, *out1 = rows + ld, *out2 = rows + 2 * ld;
    plr_real own[9];
    project_rows(s, H, P + plr_packed_row(s), P + plr_packed_row(s + 1), P + plr_packed_row(s + 2),
                 out0, out1, out2);
    get_block(f, s, 3, s, 3, own);
    project_rows(3, H, own, own + 3, own + 6, out0 + s, out1 + s, out2 + s);
    project_columns(s + 3, n, H, P, s, out0, out1, out2);
}

void plr_covariance_project(const plr_filter *f, unsigned slot, const plr_linearisation *lin,
                            plr_real *rows, size_t ld) {
    const unsigned n = plr_covariance_dim(f);
    project_landmark(f, n, plr_covariance_row(f, slot), lin->H_landmark, rows, ld);
    for (unsigned r = 0; r < PLR_ROWS; r++)
        memset(rows + r * ld + n, 0, (ld - n) * sizeof *rows);
    if (lin->uses_pose)
        for (unsigned r = 0; r < PLR_ROWS; r++)
            for (unsigned c = 0; c < PLR_POSE_DIM; c++)
                add_column(f, n, POSE + c, lin->H_pose[6 * r + c], rows + r * ld);
}

bool plr_covariance_subtract(plr_filter *f, unsigned depth) {
    const unsigned n = plr_covariance_dim(f), ld = plr_covariance_ld(f);
    plr_real *after = f->work.diagonal;
    plr_packed_subtracted_diagonal(n, depth, f->work.Vt, ld, f->P, after);
    for (unsigned i = 0; i < n; i++) {
        const plr_real before = f->P[plr_packed_row(i) + i];
        const bool stays_zero = before <= 0 && before >= 0 && after[i] <= 0 && after[i] >= 0;
        if (!(after[i] > 0) && !stays_zero)
            return false;
    }
    plr_packed_subtract(n, depth, f->work.Vt, f->work.Vt, ld, f->P);
    return true;
}

void plr_covariance_make_up_for_rounding(plr_filter *f) {
    const plr_real seen = PLR_R(8) * PLR_EPSILON, unseen = PLR_EPSILON;
    for (unsigned slot = 0; slot < f->count; slot++) {
        const unsigned row = plr_covariance_row(f, slot);
        const plr_real share = f->slots[slot].last_frame == f->frame_number ? seen : unseen;
        for (unsigned i = row; i < row + 3; i++) {
            plr_real *variance = &f->P[plr_packed_row(i) + i];
            *variance = PLR_FMA(share, *variance, *variance);
        }
    }
}

/* ---------------------------------------------------------------- slots */

void plr_covariance_append(plr_filter *f, const plr_new_landmark *landmark) {
    const unsigned s = plr_covariance_dim(f);
    for (unsigned i = 0; i < 3; i++)
        memset(f->P + plr_packed_row(s + i), 0, (s + i + 1) * sizeof *f->P);
    plr_real own[9];
    memcpy(own, landmark->P, sizeof own);
    if (landmark->uses_pose) {
        const plr_real *J = landmark->J_pose;
        for (unsigned i = 0; i < 3; i++)
            for (unsigned c = 0; c < PLR_POSE_DIM; c++)
                add_column(f, s, POSE + c, J[6 * i + c], f->P + plr_packed_row(s + i));
        for (unsigned i = 0; i < 3; i++)
            plr_gemm_nt(1, 3, 6, f->P + plr_packed_row(s + i), 6, J, 6, own + 3 * i, 3);
    }
    set_block(f, s, 3, s, 3, own);
}

void plr_covariance_remove(plr_filter *f, unsigned slot) {
    const unsigned to = plr_covariance_row(f, slot);
    const unsigned from = plr_covariance_row(f, f->count - 1);
    if (to == from)
        return;
    plr_real own[9];
    get_block(f, from, 3, from, 3, own);
    for (unsigned i = 0; i < 3; i++)
        memcpy(f->P + plr_packed_row(to + i), f->P + plr_packed_row(from + i), to * sizeof *f->P);
    set_block(f, to, 3, to, 3, own);
    for (unsigned i = to + 3; i < from; i++)
        for (unsigned c = 0; c < 3; c++)
            f->P[plr_packed_row(i) + to + c] = f->P[plr_packed_row(from + c) + i];
}
