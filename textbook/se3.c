// SPDX-License-Identifier: MIT
#include "textbook/se3.h"

#include <string.h>

enum { TERMS = 40 }; /* pi^40 / 40! is below 1e-27 */

/* C = A B, n x n. */
static void multiply(unsigned n, const double *A, const double *B, double *C) {
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < n; j++) {
            double sum = 0;
            for (unsigned k = 0; k < n; k++)
                sum += A[i * n + k] * B[k * n + j];
            C[i * n + j] = sum;
        }
}

/* sum <- I + A / first + A^2 / (first (first + 1)) + ..., n x n. */
static void series(unsigned n, const double *A, unsigned first, double *sum) {
    double term[36], next[36];
    memset(term, 0, sizeof term);
    for (unsigned i = 0; i < n; i++)
        term[i * (n + 1)] = 1;
    memcpy(sum, term, n * n * sizeof *sum);
    for (unsigned k = 0; k < TERMS; k++) {
        multiply(n, term, A, next);
        for (unsigned i = 0; i < n * n; i++) {
            term[i] = next[i] / (first + k);
            sum[i] += term[i];
        }
    }
}

static void hat(const double a[3], double *A, unsigned ld) {
    A[1] = -a[2];
    A[2] = a[1];
    A[ld] = a[2];
    A[ld + 2] = -a[0];
    A[2 * ld] = -a[1];
    A[2 * ld + 1] = a[0];
}

void se3_multiply(const double A[16], const double B[16], double C[16]) {
    multiply(4, A, B, C);
}

void se3_inverse(const double M[16], double inverse[16]) {
    memset(inverse, 0, 16 * sizeof *inverse);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            inverse[4 * i + j] = M[4 * j + i];
            inverse[4 * i + 3] -= M[4 * j + i] * M[4 * j + 3];
        }
    inverse[15] = 1;
}

void se3_apply(const double M[16], const double x[3], double y[3]) {
    const double from[3] = {x[0], x[1], x[2]};
    for (int i = 0; i < 3; i++)
        y[i] = M[4 * i] * from[0] + M[4 * i + 1] * from[1] + M[4 * i + 2] * from[2] + M[4 * i + 3];
}

void se3_exp(const double xi[6], double M[16]) {
    double A[16] = {0};
    hat(xi + 3, A, 4);
    for (int i = 0; i < 3; i++)
        A[4 * i + 3] = xi[i];
    series(4, A, 1, M);
}

void se3_adjoint(const double M[16], double Ad[36]) {
    double R[9], P[9] = {0}, PR[9];
    const double p[3] = {M[3], M[7], M[11]};
    for (int i = 0; i < 9; i++)
        R[i] = M[4 * (i / 3) + i % 3];
    hat(p, P, 3);
    multiply(3, P, R, PR);
    memset(Ad, 0, 36 * sizeof *Ad);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            Ad[6 * i + j] = Ad[6 * (3 + i) + 3 + j] = R[3 * i + j];
            Ad[6 * i + 3 + j] = PR[3 * i + j];
        }
}

void se3_right_jacobian(const double xi[6], double J[36]) {
    double A[36] = {0};
    const double rho[3] = {-xi[0], -xi[1], -xi[2]}, theta[3] = {-xi[3], -xi[4], -xi[5]};
    hat(theta, A, 6);
    hat(theta, A + 21, 6);
    hat(rho, A + 3, 6);
    series(6, A, 2, J);
}

/* R <- R (3 I - R^T R) / 2: Newton's step, which squares what is wrong. */
void se3_clean(double M[16]) {
    double R[9], Rt[9], RtR[9], cleaned[9];
    for (int i = 0; i < 9; i++) {
        R[i] = M[4 * (i / 3) + i % 3];
        Rt[i] = M[4 * (i % 3) + i / 3];
    }
    multiply(3, Rt, R, RtR);
    for (int i = 0; i < 9; i++)
        RtR[i] = (i % 4 == 0 ? 1.5 : 0) - 0.5 * RtR[i];
    multiply(3, R, RtR, cleaned);
    for (int i = 0; i < 9; i++)
        M[4 * (i / 3) + i % 3] = cleaned[i];
}

void se3_from_pose(const plr_pose *pose, double M[16]) {
    memset(M, 0, 16 * sizeof *M);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            M[4 * i + j] = pose->R[3 * i + j];
        M[4 * i + 3] = pose->p[i];
    }
    M[15] = 1;
}

void se3_to_pose(const double M[16], plr_pose *pose) {
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            pose->R[3 * i + j] = M[4 * i + j];
        pose->p[i] = M[4 * i + 3];
    }
}
