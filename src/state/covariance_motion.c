// SPDX-License-Identifier: MIT
/* The covariance in a motion of the body, and the motion's noise, which is kept beside it. */
#include "state/covariance.h"

#include "math/blocks3.h"
#include "math/dense.h"
#include "math/small.h"
#include "pelorus/assertions.h"
#include "state/blocks.h"
#include "state/calibration.h"
#include "state/elements.h"
#include "state/pose.h"
#include "state/sensitivity.h"

enum {
    POSE_ROW = 0, /* the pose comes first in every layout */
    WIDE_REGISTERS = PLR_TILE_COLUMNS > 6
};

/* out_r = X_r B, r = 0 .. 2: three rows X_r of m numbers, B m x 6; out_r may be X_r. Every block of
 * the state has three or six rows. Inlined: the sums stay in registers. */
static inline void three_rows_by_six(unsigned m, const plr_real *const X[PLR_ROWS],
                                     const plr_real *B, plr_real *const out[PLR_ROWS]) {
    plr_real sum0[PLR_POSE_DIM] = {0}, sum1[PLR_POSE_DIM] = {0}, sum2[PLR_POSE_DIM] = {0};
    for (unsigned l = 0; l < m; l++, B += PLR_POSE_DIM)
        for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
            sum0[k] = PLR_FMA(X[0][l], B[k], sum0[k]);
            sum1[k] = PLR_FMA(X[1][l], B[k], sum1[k]);
            sum2[k] = PLR_FMA(X[2][l], B[k], sum2[k]);
        }
    memcpy(out[0], sum0, sizeof sum0);
    memcpy(out[1], sum1, sizeof sum1);
    memcpy(out[2], sum2, sizeof sum2);
}

/* The pose's columns of three rows of P, from row i on: X <- X A^T, with At = A^T. */
static void turn_pose_columns(plr_belief *belief, unsigned i, const plr_real At[PLR_POSE_SQUARE]) {
    PLR_ASSERT(i >= PLR_POSE_DIM && i + PLR_ROWS <= plr_covariance_dim(belief));
    plr_real *const row[PLR_ROWS] = {belief->P + plr_packed_row(i),
                                     belief->P + plr_packed_row(i + 1),
                                     belief->P + plr_packed_row(i + 2)};
    const plr_real *const X[PLR_ROWS] = {row[0], row[1], row[2]};
    three_rows_by_six(PLR_POSE_DIM, X, At, row);
}

static void transpose6(plr_real At[PLR_POSE_SQUARE], const plr_real A[PLR_POSE_SQUARE]) {
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        for (unsigned j = 0; j < PLR_POSE_DIM; j++)
            At[PLR_POSE_DIM * i + j] = A[PLR_POSE_DIM * j + i];
}

/* X <- F X, 3xn, in three rows of P. F is copied, or it would be loaded for each column. */
static inline void turn_rows(unsigned n, const plr_real *restrict F, plr_real *restrict r0,
                             plr_real *restrict r1, plr_real *restrict r2) {
    const plr_real g[9] = {F[0], F[1], F[2], F[3], F[4], F[5], F[6], F[7], F[8]};
    for (unsigned j = 0; j < n; j++) {
        const plr_real x[3] = {r0[j], r1[j], r2[j]};
        r0[j] = plr_dot3(g, x);
        r1[j] = plr_dot3(g + 3, x);
        r2[j] = plr_dot3(g + 6, x);
    }
}

/* The factors of a transport, by slot. Gt and Y are for wide registers alone (math/blocks3.h). */
typedef struct plr_landmark_factors {
    const plr_real *F;
    plr_real *Gt, *Y;
} plr_landmark_factors;

/* The three rows of one landmark: its F from the left, the factor of each column from the right. */
static void transport_landmark(plr_belief *belief, unsigned slot,
                               const plr_real At[PLR_POSE_SQUARE], const plr_landmark_factors *by) {
    const unsigned s = plr_covariance_row(belief, slot), first = plr_core_dim(belief);
    plr_real *r0 = belief->P + plr_packed_row(s);
    plr_real *r1 = belief->P + plr_packed_row(s + 1);
    plr_real *r2 = belief->P + plr_packed_row(s + 2);
    plr_real *const others[PLR_ROWS] = {r0 + first, r1 + first, r2 + first};
    const plr_real *own = by->F + 9 * slot;

    plr_real D[9], FD[9], FDFt[9];
    plr_get_block(belief, s, 3, s, 3, D);
    turn_rows(first, own, r0, r1, r2);
    turn_pose_columns(belief, s, At);
    if (WIDE_REGISTERS)
        plr_blocks3_transport_wide(slot, own, by->Gt, by->Y, others);
    else
        plr_blocks3_transport(slot, own, by->F, others);
    plr_mat3_mul(FD, own, D);
    plr_mat3_mul_nt(FDFt, FD, own);
    plr_set_block(belief, s, 3, s, 3, FDFt);
}

/* The pose's own covariance, and its columns in the rows before `end`. */
static void turn_pose(plr_belief *belief, unsigned end, const plr_real A[PLR_POSE_SQUARE],
                      plr_real At[PLR_POSE_SQUARE]) {
    plr_real P_xi[PLR_POSE_SQUARE], turned[PLR_POSE_SQUARE];
    plr_covariance_get(belief, PLR_BLOCK_POSE, PLR_BLOCK_POSE, P_xi);
    plr_sandwich6(turned, A, P_xi);
    plr_set_block(belief, POSE_ROW, PLR_POSE_DIM, POSE_ROW, PLR_POSE_DIM, turned);
    transpose6(At, A);
    for (unsigned i = PLR_POSE_DIM; i < end; i += PLR_ROWS)
        turn_pose_columns(belief, i, At);
    plr_sensitivity_turn_pose(belief, A);
}

void plr_covariance_turn_pose(plr_belief *belief, const plr_real A[PLR_POSE_SQUARE]) {
    plr_real At[PLR_POSE_SQUARE];
    turn_pose(belief, plr_covariance_dim(belief), A, At);
}

void plr_covariance_transport(plr_belief *belief, plr_real *Vt, const plr_real A[PLR_POSE_SQUARE],
                              const plr_real *F) {
    plr_real At[PLR_POSE_SQUARE];
    turn_pose(belief, plr_core_dim(belief), A, At);
    const plr_landmark_factors by = {F, Vt + 9 * belief->count,
                                     Vt + (9 + PLR_WIDE_FACTOR) * belief->count};
    if (WIDE_REGISTERS)
        plr_blocks3_widen(belief->count, F, by.Gt);
    for (unsigned slot = 0; slot < belief->count; slot++)
        transport_landmark(belief, slot, At, &by);
}

void plr_covariance_motion_share(const plr_belief *belief, unsigned row,
                                 const plr_real Kt[PLR_MOTION_BY],
                                 plr_real V[PLR_ROWS * PLR_POSE_DIM]) {
    PLR_ASSERT(row + PLR_ROWS <= plr_covariance_dim(belief));
    const unsigned first = belief->layout.driver, drivers = belief->layout.drivers;
    plr_real before[PLR_ROWS * PLR_DRIVERS];
    const plr_real *X[PLR_ROWS];
    plr_real *const out[PLR_ROWS] = {V, V + PLR_POSE_DIM, V + 2 * PLR_POSE_DIM};
    for (unsigned r = 0; r < PLR_ROWS; r++)
        X[r] = belief->P + plr_packed_row(row + r) + first;
    if (row < first + drivers) { /* a part of it is above the diagonal */
        plr_covariance_with_drivers(belief, row, PLR_ROWS, before);
        for (unsigned r = 0; r < PLR_ROWS; r++)
            X[r] = before + drivers * r;
    }
    three_rows_by_six(drivers, X, Kt, out);
}

/* After the motion: v <- V x_d + noise, b <- b + noise. */
static void carry_core_covariance(plr_belief *belief, const plr_motion *motion) {
    PLR_ASSERT(plr_has_block(belief, PLR_BLOCK_VELOCITY) && plr_has_block(belief, PLR_BLOCK_BIAS));
    enum { D = PLR_DRIVERS, C = PLR_VELOCITY_DIM };
    const plr_core_motion *m = &motion->core;
    const plr_real *V = m->V;
    const unsigned n = plr_covariance_dim(belief), first = belief->layout.driver;
    const unsigned velocity = plr_row_of(belief, PLR_BLOCK_VELOCITY);
    plr_real P_xd[PLR_CORE_DIM * D], VP[C * PLR_CORE_DIM] = {0}, P_vv[C * C] = {0};
    plr_covariance_with_drivers(belief, 0, PLR_CORE_DIM, P_xd);
    plr_gemm_nt(C, PLR_CORE_DIM, D, V, D, P_xd, D, VP, PLR_CORE_DIM);
    plr_gemm_nt(C, C, D, VP + first, PLR_CORE_DIM, V, D, P_vv, C);
    for (unsigned i = plr_core_dim(belief); i < n; i++) { /* the rows of landmarks */
        plr_real *P_id = belief->P + plr_packed_row(i) + first, v[C] = {0};
        plr_gemm_nn(C, 1, D, V, D, P_id, 1, v, 1);
        memcpy(P_id + (velocity - first), v, sizeof v);
    }
    for (unsigned r = 0; r < C; r++) {
        for (unsigned i = 0; i < PLR_CORE_DIM; i++)
            belief->P[plr_packed_at(velocity + r, i)] = VP[r * PLR_CORE_DIM + i];
        for (unsigned c = 0; c <= r; c++)
            belief->P[plr_packed_at(velocity + r, velocity + c)] = P_vv[C * r + c];
    }
    PLR_ASSERT(plr_row_of(belief, PLR_BLOCK_BIAS) == velocity + C);
    for (unsigned r = 0; r < PLR_REST_DIM; r++)
        for (unsigned c = 0; c <= r; c++)
            belief->P[plr_packed_at(velocity + r, velocity + c)] += m->Q_cc[PLR_REST_DIM * r + c];
}

void plr_covariance_carry_core(plr_belief *belief, const plr_motion *motion) {
    if (!plr_has_block(belief, PLR_BLOCK_VELOCITY))
        return;
    carry_core_covariance(belief, motion);
    plr_sensitivity_carry_velocity(belief, motion->core.V);
}

/* The same but for S; and in Vt of velocity and biases, whose noise goes with the motion's. */
static void carry_core(plr_belief *belief, const plr_motion *motion,
                       const plr_applied_motion *applied, plr_real *Vt, size_t ld) {
    const unsigned first = belief->layout.driver, velocity = plr_row_of(belief, PLR_BLOCK_VELOCITY);
    plr_real X[PLR_POSE_DIM * PLR_REST_DIM];
    carry_core_covariance(belief, motion);
    memcpy(X, motion->core.Q_nc, sizeof X);
    plr_motion_solve(applied->L, PLR_REST_DIM, X, PLR_REST_DIM);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        plr_real *row = Vt + k * ld, v[PLR_VELOCITY_DIM] = {0};
        plr_gemm_nn(PLR_VELOCITY_DIM, 1, PLR_DRIVERS, motion->core.V, PLR_DRIVERS, row + first, 1,
                    v, 1);
        memcpy(row + velocity, v, sizeof v);
        for (unsigned c = 0; c < PLR_REST_DIM; c++)
            row[velocity + c] += X[PLR_REST_DIM * k + c];
    }
}

/* Of the rows from `first` to end - 1: makes up for the rounding where V V^T was added to P or subtracted. */
static void make_up_for_rounding(plr_belief *belief, unsigned first, unsigned end,
                                 const plr_real *Vt, unsigned ld) {
    for (unsigned i = first; i < end; i++) {
        plr_real moved = 0;
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            moved = PLR_FMA(Vt[k * ld + i], Vt[k * ld + i], moved);
        belief->P[plr_packed_row(i) + i] += PLR_R(8) * PLR_EPSILON * moved;
    }
}

void plr_covariance_open_noise(plr_belief *belief, const plr_motion *motion, plr_workspace *work,
                               const plr_applied_motion *applied) {
    const unsigned n = plr_covariance_dim(belief), ld = plr_covariance_ld(belief);
    plr_noise *noise = &work->noise;
    memset(noise->Lambda, 0, sizeof noise->Lambda);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        noise->Lambda[plr_upper_row(PLR_POSE_DIM, k)] = 1;
        noise->eta[k] = -applied->z[k];
        noise->z[k] = applied->z[k];
    }
    memset(noise->eta_of_S, 0, sizeof noise->eta_of_S);
    noise->open = 1;
    if (belief->layout.drivers == 0)
        return;
    const bool carries = plr_has_block(belief, PLR_BLOCK_VELOCITY);
    plr_real *Vt = work->Vt, K[PLR_MOTION_BY], Kt[PLR_MOTION_BY];
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        memset(Vt + k * ld + n, 0, (ld - n) * sizeof *Vt);
    plr_motion_by_drivers(belief, motion, applied->L, K);
    plr_motion_transpose(K, Kt);
    plr_sensitivity_move(belief, K, carries ? motion->core.V : NULL, noise->Wt, ld);
    for (unsigned i = 0; i < n; i += PLR_ROWS) {
        plr_real v[PLR_ROWS * PLR_POSE_DIM];
        plr_covariance_motion_share(belief, i, Kt, v);
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            for (unsigned r = 0; r < PLR_ROWS; r++)
                Vt[k * ld + i + r] = v[PLR_POSE_DIM * r + k];
    }
    if (carries)
        carry_core(belief, motion, applied, Vt, ld);
    for (unsigned i = 0; i < n; i++)
        for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
            const plr_real v = Vt[k * ld + i];
            noise->Wt[k * ld + i] += v;
            work->dx[i] = PLR_FMA(v, applied->z[k], work->dx[i]);
        }
    plr_packed_subtract(n, PLR_POSE_DIM, Vt, Vt, ld, belief->P);
    if (carries)
        make_up_for_rounding(belief, plr_row_of(belief, PLR_BLOCK_VELOCITY), plr_core_dim(belief),
                             Vt, ld);
}

plr_status plr_covariance_close_noise(plr_belief *belief, const plr_camera_model *camera,
                                      plr_workspace *work, plr_real nu[PLR_POSE_DIM]) {
    const unsigned n = plr_covariance_dim(belief), ld = plr_covariance_ld(belief);
    plr_noise *noise = &work->noise;
    if (!noise->open)
        return PLR_OK;
    noise->open = 0;
    if (!plr_cholesky_upper(PLR_POSE_DIM, noise->Lambda))
        return PLR_E_DIVERGED;
    plr_real *Xt = noise->Wt, *minus = work->Vt;
    plr_solve_upper_transposed(PLR_POSE_DIM, ld, noise->Lambda, Xt, ld);
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, noise->Lambda, noise->eta, 1);
    plr_combine_rows(n, PLR_POSE_DIM, noise->eta, 1, Xt, ld, work->dx);
    plr_sensitivity_close_noise(belief, &work->noise, Xt, ld);
    plr_calibration_marginalise(camera, work);
    for (unsigned i = 0; i < PLR_POSE_DIM * ld; i++)
        minus[i] = -Xt[i];
    plr_packed_subtract(n, PLR_POSE_DIM, minus, Xt, ld, belief->P);
    make_up_for_rounding(belief, plr_core_dim(belief), n, Xt, ld);
    if (nu) {
        plr_solve_upper(PLR_POSE_DIM, noise->Lambda, noise->eta);
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            nu[k] = noise->z[k] + noise->eta[k];
    }
    return PLR_OK;
}

PLR_SELDOM void plr_covariance_predict_pose(plr_belief *belief, const plr_real A[PLR_POSE_SQUARE],
                                            const plr_real B[PLR_MOTION_BY],
                                            const plr_real M[PLR_POSE_SQUARE]) {
    const unsigned n = plr_covariance_dim(belief), drivers = belief->layout.drivers;
    PLR_ASSERT(drivers == 0 || belief->layout.driver >= PLR_POSE_DIM);
    plr_real P_xi[PLR_POSE_SQUARE], turned[PLR_POSE_SQUARE];
    plr_covariance_get(belief, PLR_BLOCK_POSE, PLR_BLOCK_POSE, P_xi);
    plr_sandwich6(turned, A, P_xi);
    if (drivers > 0) {
        plr_real P_xd[PLR_MOTION_BY], AP[PLR_MOTION_BY] = {0}, cross[PLR_POSE_SQUARE] = {0};
        plr_covariance_with_drivers(belief, POSE_ROW, PLR_POSE_DIM, P_xd);
        plr_gemm_nn(PLR_POSE_DIM, drivers, PLR_POSE_DIM, A, PLR_POSE_DIM, P_xd, drivers, AP,
                    drivers);
        plr_gemm_nt(PLR_POSE_DIM, PLR_POSE_DIM, drivers, AP, drivers, B, PLR_DRIVERS, cross,
                    PLR_POSE_DIM);
        for (unsigned i = 0; i < PLR_POSE_DIM; i++)
            for (unsigned j = 0; j < PLR_POSE_DIM; j++)
                turned[PLR_POSE_DIM * i + j] +=
                    cross[PLR_POSE_DIM * i + j] + cross[PLR_POSE_DIM * j + i];
    }
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        turned[i] += M[i];
    plr_set_block(belief, POSE_ROW, PLR_POSE_DIM, POSE_ROW, PLR_POSE_DIM, turned);
    plr_sensitivity_turn_pose(belief, A);
    plr_sensitivity_move_pose(belief, B);

    /* the other rows begin with their pose columns, and the bias columns follow */
    plr_real At[PLR_POSE_SQUARE];
    transpose6(At, A);
    for (unsigned i = PLR_POSE_DIM; i < n; i += PLR_ROWS) {
        plr_real P_id[PLR_ROWS * PLR_DRIVERS] = {0};
        plr_covariance_with_drivers(belief, i, PLR_ROWS, P_id);
        turn_pose_columns(belief, i, At);
        for (unsigned r = 0; r < PLR_ROWS; r++)
            plr_gemm_nt(1, PLR_POSE_DIM, drivers, P_id + drivers * r, PLR_DRIVERS, B, PLR_DRIVERS,
                        belief->P + plr_packed_row(i + r), PLR_POSE_DIM);
    }
}
