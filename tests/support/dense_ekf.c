// SPDX-License-Identifier: MIT
#include "support/dense_ekf.h"

#include <stdlib.h>
#include <string.h>

#include "support/dense_parts.h"
#include "support/oracle.h"
#include "support/rigid.h"

unsigned dense_row(const dense_ekf *e, unsigned landmark) {
    return (e->config.bias ? 12U : 6U) + 3 * landmark;
}

unsigned dense_dim(const dense_ekf *e) {
    return dense_row(e, e->count);
}

void dense_init(dense_ekf *e, const plr_calibration *calibration, const plr_config *config) {
    memset(e, 0, sizeof *e);
    e->config = *config;
    e->camera = *calibration;
    dense_motion(e->T_CB, &calibration->T_CB);
    dense_adjoint(e->Ad_CB, e->T_CB);
    for (int i = 0; i < 4; i++)
        e->T_WB[5 * i] = e->D[5 * i] = 1;
    const double sigma[3] = {config->mode == PLR_MODE_MAPPING ? 0 : config->start_sigma,
                             config->bias_velocity_sigma_mps, config->bias_gyro_sigma_radps};
    const unsigned n = dense_dim(e);
    for (unsigned i = 0; i < n; i++) {
        const double s = sigma[i < DENSE_BIAS ? 0 : i < DENSE_BIAS + 3 ? 1 : 2];
        e->P[i * n + i] = s * s;
    }
}

void dense_forget_motion(dense_ekf *e) {
    memset(e->D, 0, sizeof e->D);
    memset(e->M, 0, sizeof e->M);
    memset(e->C, 0, sizeof e->C);
    for (int i = 0; i < 4; i++)
        e->D[5 * i] = 1;
    e->pending = false;
}

void dense_reference(const dense_ekf *e, double T_WB[16]) {
    double inverse[16];
    rigid_inverse(inverse, e->D);
    square_multiply(4, e->T_WB, inverse, T_WB);
}

void dense_set_pose(dense_ekf *e, const plr_pose *T_WB, const double P_xi[36]) {
    const unsigned n = dense_dim(e);
    double P_b[36] = {0};
    for (unsigned i = 0; e->config.bias && i < 6; i++)
        memcpy(P_b + 6 * i, e->P + (DENSE_BIAS + i) * n + DENSE_BIAS, 6 * sizeof *P_b);
    e->count = 0;
    dense_forget_motion(e);
    memset(e->P, 0, sizeof e->P);
    dense_put(e->P, dense_dim(e), 0, 0, 6, 6, P_xi);
    if (e->config.bias)
        dense_put(e->P, dense_dim(e), DENSE_BIAS, DENSE_BIAS, 6, 6, P_b);
    dense_motion(e->T_WB, T_WB);
}

void dense_move_points(dense_ekf *e, const double D[16], double *F, double *K) {
    const unsigned n = dense_dim(e);
    double T_BC[16], CD[16], D_C[16], back[16], R_back[9];
    rigid_inverse(T_BC, e->T_CB);
    square_multiply(4, e->T_CB, D, CD);
    square_multiply(4, CD, T_BC, D_C);
    rigid_inverse(back, D_C);
    dense_rotation(R_back, back);
    for (unsigned i = 0; i < e->count; i++) {
        dense_apply(e->x[i], back, e->x[i]);
        dense_put(F, n, dense_row(e, i), dense_row(e, i), 3, 3, R_back);
        dense_camera_by_pose(e, e->x[i], K + 18 * i);
    }
}

/* T <- T D and x <- F x + G (N b-error + noise): N 6x6 and `variance` of (rho, theta). */
static void move(dense_ekf *e, const double D[16], const double *N, const double variance[6]) {
    const unsigned n = dense_dim(e);
    double *F = dense_identity(n), *G = dense_zeros(n, 6), *K = dense_zeros(e->count, 18);
    double T[16], D_inverse[16], A[36], I6[36] = {0}, Q[36] = {0};
    square_multiply(4, e->T_WB, D, T);
    memcpy(e->T_WB, T, sizeof T);
    rigid_inverse(D_inverse, D);
    dense_adjoint(A, D_inverse);
    dense_put(F, n, 0, 0, 6, 6, A);
    for (int i = 0; i < 6; i++) {
        I6[7 * i] = 1;
        Q[7 * i] = variance[i];
    }
    dense_put(G, 6, 0, 0, 6, 6, I6);
    if (dense_is_body(e)) {
        dense_move_points(e, D, F, K);
        for (unsigned i = 0; i < e->count; i++)
            dense_put(G, 6, dense_row(e, i), 0, 3, 6, K + 18 * i);
    }
    if (N) {
        double *GN = dense_zeros(n, 6);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, n, 6, 6, 1, G, N, 0, GN);
        for (unsigned i = 0; i < n; i++)
            for (unsigned j = 0; j < 6; j++)
                F[i * n + DENSE_BIAS + j] += GN[6 * i + j];
        free(GN);
    }
    dense_sandwich(e, F);
    double *GQG = dense_zeros(n, n);
    oracle_sandwich(n, 6, G, Q, GQG);
    for (unsigned i = 0; i < n * n; i++)
        e->P[i] += GQG[i];
    free(GQG);
    free(K);
    free(G);
    free(F);
}

/* n <- A n + N b-error + noise, jointly with the state x before the motion:
 *   Cov(x, n) <- Cov(x, n) A^T + P_(:,b) N^T,
 *   Cov(n)    <- A Cov(n) A^T + N Cov(b, n) A^T + (...)^T + N P_bb N^T + Q. */
static void accumulate(dense_ekf *e, const double step[16], const double *N,
                       const double variance[6]) {
    const unsigned n = dense_dim(e);
    double D[16], T[16], inverse[16], A[36], M[36], AC[36] = {0}, joint[36] = {0}, P_b[36];
    double *C = dense_zeros(n, 6);
    square_multiply(4, e->D, step, D);
    memcpy(e->D, D, sizeof D);
    square_multiply(4, e->T_WB, step, T);
    memcpy(e->T_WB, T, sizeof T);
    rigid_inverse(inverse, step);
    dense_adjoint(A, inverse);
    oracle_sandwich(6, 6, A, e->M, M);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, n, 6, 6, 1, e->C, A, 0, C);
    if (N) {
        double *P_xb = dense_zeros(n, 6);
        for (unsigned i = 0; i < n; i++)
            memcpy(P_xb + 6 * i, e->P + i * n + DENSE_BIAS, 6 * sizeof *P_xb);
        memcpy(P_b, P_xb + 6 * DENSE_BIAS, sizeof P_b);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, 6, 6, 1, N, C + 6 * DENSE_BIAS, 0, AC);
        oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, n, 6, 6, 1, P_xb, N, 1, C);
        oracle_sandwich(6, 6, N, P_b, joint);
        free(P_xb);
    }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            e->M[6 * i + j] = M[6 * i + j] + AC[6 * i + j] + AC[6 * j + i] + joint[6 * i + j] +
                              (i == j ? variance[i] : 0);
    memcpy(e->C, C, (size_t)n * 6 * sizeof *C);
    e->pending = true;
    free(C);
}

void dense_pose_covariance(const dense_ekf *e, double P_xi[36]) {
    const unsigned n = dense_dim(e);
    double inverse[16], A[36], P[36], AC[36];
    for (unsigned i = 0; i < 36; i++)
        P[i] = e->P[i / 6 * n + i % 6];
    rigid_inverse(inverse, e->D);
    dense_adjoint(A, inverse);
    oracle_sandwich(6, 6, A, P, P_xi);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, 6, 6, 1, A, e->C, 0, AC);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            P_xi[6 * i + j] += AC[6 * i + j] + AC[6 * j + i] + e->M[6 * i + j];
}

void dense_hold(dense_ekf *e, const plr_twist *twist, double seconds, double interval) {
    const bool step = e->config.noise == PLR_NOISE_STEP;
    const double share = step ? seconds / interval : seconds * interval;
    const double *const way = e->config.velocity_sigma, *const turn = e->config.gyro_sigma;
    double xi[6], D[16], N[36], variance[6];
    for (int i = 0; i < 3; i++) {
        variance[i] = way[i] * way[i] * share;
        variance[3 + i] = turn[i] * turn[i] * share;
        xi[i] = seconds * (twist->v_B_mps[i] - e->bias[i]);
        xi[3 + i] = seconds * (twist->w_B_radps[i] - e->bias[3 + i]);
    }
    rigid_exp(D, xi);
    rigid_right_jacobian(N, xi);
    for (int i = 0; i < 36; i++)
        N[i] *= -seconds;
    if (dense_is_body(e))
        accumulate(e, D, e->config.bias ? N : NULL, variance);
    else
        move(e, D, e->config.bias ? N : NULL, variance);
    e->walked_s += seconds;
}

void dense_move_to(dense_ekf *e, const plr_pose *T_WB) {
    static const double exact[6] = {0};
    double inverse[16], there[16], D[16];
    rigid_inverse(inverse, e->T_WB);
    dense_motion(there, T_WB);
    square_multiply(4, inverse, there, D);
    move(e, D, NULL, exact);
    memcpy(e->T_WB, there, sizeof there); /* T D is there, but for rounding that would grow */
}
