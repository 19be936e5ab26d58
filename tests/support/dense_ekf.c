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
        e->T_WB[5 * i] = 1;
    const double sigma[3] = {config->mode == PLR_MODE_MAPPING ? 0 : config->start_sigma,
                             config->bias_velocity_sigma_mps, config->bias_gyro_sigma_radps};
    const unsigned n = dense_dim(e);
    for (unsigned i = 0; i < n; i++) {
        const double s = sigma[i < DENSE_BIAS ? 0 : i < DENSE_BIAS + 3 ? 1 : 2];
        e->P[i * n + i] = s * s;
    }
}

void dense_set_pose(dense_ekf *e, const plr_pose *T_WB, const double P_xi[36]) {
    const unsigned n = dense_dim(e);
    double P_b[36] = {0};
    for (unsigned i = 0; e->config.bias && i < 6; i++)
        memcpy(P_b + 6 * i, e->P + (DENSE_BIAS + i) * n + DENSE_BIAS, 6 * sizeof *P_b);
    e->count = 0;
    memset(e->P, 0, sizeof e->P);
    dense_put(e->P, dense_dim(e), 0, 0, 6, 6, P_xi);
    if (e->config.bias)
        dense_put(e->P, dense_dim(e), DENSE_BIAS, DENSE_BIAS, 6, 6, P_b);
    dense_motion(e->T_WB, T_WB);
}

/* The landmarks of `body` under a motion D of the body, and their blocks of F. K[i] is then how
 * landmark i takes a twist of the body. */
static void move_points(dense_ekf *e, const double D[16], double *F, double *K) {
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
        move_points(e, D, F, K);
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
