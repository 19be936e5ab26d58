// SPDX-License-Identifier: MIT
#include "support/dense_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "support/oracle.h"
#include "support/rigid.h"

bool dense_is_body(const dense_ekf *e) {
    return e->config.model == PLR_MODEL_BODY;
}

double *dense_zeros(unsigned n, unsigned m) {
    double *A = calloc((size_t)n * m + 1, sizeof *A);
    if (!A)
        abort();
    return A;
}

double *dense_identity(unsigned n) {
    double *I = dense_zeros(n, n);
    for (unsigned i = 0; i < n; i++)
        I[i * n + i] = 1;
    return I;
}

void dense_put(double *A, unsigned ld, unsigned row, unsigned column, unsigned rows,
               unsigned columns, const double *B) {
    for (unsigned i = 0; i < rows; i++)
        for (unsigned j = 0; j < columns; j++)
            A[(row + i) * ld + column + j] = B[i * columns + j];
}

void dense_sandwich(dense_ekf *e, const double *F) {
    const unsigned n = dense_dim(e);
    double *S = dense_zeros(n, n);
    oracle_sandwich(n, n, F, e->P, S);
    memcpy(e->P, S, (size_t)n * n * sizeof *S);
    free(S);
}

void dense_apply(double y[3], const double M[16], const double x[3]) {
    double sum[3];
    for (int i = 0; i < 3; i++)
        sum[i] = M[4 * i] * x[0] + M[4 * i + 1] * x[1] + M[4 * i + 2] * x[2] + M[4 * i + 3];
    memcpy(y, sum, sizeof sum);
}

void dense_rotation(double R[9], const double M[16]) {
    for (int i = 0; i < 3; i++)
        memcpy(R + 3 * i, M + 4 * i, 3 * sizeof *R);
}

void dense_rotation_back(double Rt[9], const double M[16]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            Rt[3 * i + j] = M[4 * j + i];
}

void dense_motion(double M[16], const plr_pose *pose) {
    memset(M, 0, 16 * sizeof *M);
    for (int i = 0; i < 3; i++) {
        memcpy(M + 4 * i, pose->R + 3 * i, 3 * sizeof *M);
        M[4 * i + 3] = pose->p[i];
    }
    M[15] = 1;
}

static void skew(double S[9], const double x[3]) {
    const double entries[9] = {0, -x[2], x[1], x[2], 0, -x[0], -x[1], x[0], 0};
    memcpy(S, entries, sizeof entries);
}

void dense_adjoint(double Ad[36], const double M[16]) {
    const double p[3] = {M[3], M[7], M[11]};
    double R[9], S[9], SR[9];
    dense_rotation(R, M);
    skew(S, p);
    square_multiply(3, S, R, SR);
    memset(Ad, 0, 36 * sizeof *Ad);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            Ad[6 * i + j] = Ad[6 * (i + 3) + j + 3] = R[3 * i + j];
            Ad[6 * i + j + 3] = SR[3 * i + j];
        }
}

/* B = [-I | [x]x] */
static void point_by_twist(double B[18], const double x[3]) {
    double S[9];
    skew(S, x);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            B[6 * i + j] = i == j ? -1 : 0;
            B[6 * i + 3 + j] = S[3 * i + j];
        }
}

void dense_camera_by_pose(const dense_ekf *e, const double q[3], double K[18]) {
    double B[18];
    point_by_twist(B, q);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 6, 1, B, e->Ad_CB, 0, K);
}

void dense_world_by_pose(const dense_ekf *e, const double s[3], double J[18]) {
    double B[18], R[9], T_WB[16];
    point_by_twist(B, s);
    dense_reference(e, T_WB);
    dense_rotation(R, T_WB);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 3, -1, R, B, 0, J);
}

void dense_camera_to_world(const dense_ekf *e, double R_WC[9]) {
    double R_WB[9], R_BC[9], T_WB[16];
    dense_reference(e, T_WB);
    dense_rotation(R_WB, T_WB);
    dense_rotation_back(R_BC, e->T_CB);
    square_multiply(3, R_WB, R_BC, R_WC);
}

void dense_project(const plr_calibration *c, const double q[3], double z[3], double Dz[9]) {
    const double x = q[0], y = q[1], depth = q[2], behind = x - c->baseline_m;
    z[0] = c->fx_px * x / depth + c->cx_px;
    z[1] = c->fx_px * behind / depth + c->cx_px;
    z[2] = c->fy_px * y / depth + c->cy_px;
    const double D[9] = {c->fx_px / depth,
                         0,
                         -c->fx_px * x / (depth * depth),
                         c->fx_px / depth,
                         0,
                         -c->fx_px * behind / (depth * depth),
                         0,
                         c->fy_px / depth,
                         -c->fy_px * y / (depth * depth)};
    memcpy(Dz, D, sizeof D);
}

/* A^-1 by cofactors. */
static void invert3(double inverse[9], const double A[9]) {
    double cofactor[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            cofactor[3 * i + j] = A[3 * i1 + j1] * A[3 * i2 + j2] - A[3 * i1 + j2] * A[3 * i2 + j1];
        }
    const double determinant = A[0] * cofactor[0] + A[1] * cofactor[1] + A[2] * cofactor[2];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            inverse[3 * i + j] = cofactor[3 * j + i] / determinant;
}

void dense_back_project(const plr_calibration *c, const double z[3], double pixel_variance,
                        double q[3], double P_q[9]) {
    q[2] = c->fx_px * c->baseline_m / (z[0] - z[1]);
    q[0] = (z[0] - c->cx_px) * q[2] / c->fx_px;
    q[1] = (z[2] - c->cy_px) * q[2] / c->fy_px;
    double again[3], Dz[9], Dq[9];
    const double R[9] = {pixel_variance, 0, 0, 0, pixel_variance, 0, 0, 0, pixel_variance / 2};
    dense_project(c, q, again, Dz);
    invert3(Dq, Dz);
    oracle_sandwich(3, 3, Dq, R, P_q);
}

void dense_in_camera(const dense_ekf *e, unsigned landmark, double q[3]) {
    if (dense_is_body(e)) {
        memcpy(q, e->x[landmark], 3 * sizeof *q);
        return;
    }
    double T_BW[16], s[3];
    rigid_inverse(T_BW, e->T_WB);
    dense_apply(s, T_BW, e->x[landmark]);
    dense_apply(q, e->T_CB, s);
}

void dense_common_motion(const dense_ekf *e, unsigned count, double (*q)[3],
                         double (*correction)[3], const double xi[6], double eta[6]) {
    const double baseline = e->camera.baseline_m;
    double A[36] = {0}, b[6] = {0};
    for (unsigned i = 0; i < count; i++) {
        const double r2 = q[i][0] * q[i][0] + q[i][1] * q[i][1] + q[i][2] * q[i][2];
        double K[18], W[9], WK[18];
        for (unsigned k = 0; k < 9; k++) {
            const double along = q[i][k / 3] * q[i][k % 3] / r2; /* mu mu^T */
            W[k] = ((k % 4 == 0) - along) / r2 + baseline * baseline * along / (r2 * r2);
        }
        dense_camera_by_pose(e, q[i], K);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 3, 1, W, K, 0, WK);
        oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, 6, 6, 3, 1, K, WK, 1, A);
        oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, 6, 1, 3, 1, WK, correction[i], 1, b);
    }
    for (unsigned k = 0; k < 6; k++) {
        const double weight = 0.1 * A[7 * k] + 1e-12;
        eta[k] = b[k] + weight * xi[k];
        A[7 * k] += weight;
    }
    if (!oracle_solve_spd(6, 1, A, eta))
        memcpy(eta, xi, 6 * sizeof *eta);
}

void dense_polar_step(const double q[3], const double e[3], double moved[3], double J[9]) {
    const double r = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
    const double mu[3] = {q[0] / r, q[1] / r, q[2] / r};
    const double along = mu[0] * e[0] + mu[1] * e[1] + mu[2] * e[2];
    const double turn[6] = {0,
                            0,
                            0, /* mu x e / r: the part of e along mu falls out */
                            (mu[1] * e[2] - mu[2] * e[1]) / r,
                            (mu[2] * e[0] - mu[0] * e[2]) / r,
                            (mu[0] * e[1] - mu[1] * e[0]) / r};
    const double r_moved = 1 / (1 / r - along / (r * r));
    const double ratio = r_moved / r;
    double E[16], R[9], stretch[9];
    rigid_exp(E, turn);
    dense_rotation(R, E);
    for (int i = 0; i < 3; i++)
        moved[i] = r_moved * (R[3 * i] * mu[0] + R[3 * i + 1] * mu[1] + R[3 * i + 2] * mu[2]);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            stretch[3 * i + j] = (i == j ? ratio : 0) + (ratio * ratio - ratio) * mu[i] * mu[j];
    square_multiply(3, R, stretch, J);
}
