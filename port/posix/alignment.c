// SPDX-License-Identifier: MIT
#include "posix/alignment.h"

#include <math.h>
#include <string.h>

#include "posix/pose_math.h"

static void mean3(double mean[3], const double *points, size_t n) {
    mean[0] = mean[1] = mean[2] = 0;
    for (size_t k = 0; k < n; k++)
        for (int i = 0; i < 3; i++)
            mean[i] += points[3 * k + (size_t)i] / (double)n;
}

/* One Jacobi rotation: makes N(p, q) zero, and turns the eigenvectors in the columns of E. */
static void rotate(double N[4][4], double E[4][4], int p, int q) {
    if (N[p][q] == 0)
        return;
    const double half = (N[q][q] - N[p][p]) / (2 * N[p][q]);
    const double t = (half < 0 ? -1 : 1) / (fabs(half) + sqrt(half * half + 1));
    const double c = 1 / sqrt(t * t + 1), s = t * c;
    for (int k = 0; k < 4; k++) {
        const double kp = N[k][p], kq = N[k][q];
        N[k][p] = c * kp - s * kq;
        N[k][q] = s * kp + c * kq;
    }
    for (int k = 0; k < 4; k++) {
        const double pk = N[p][k], qk = N[q][k];
        const double ep = E[k][p], eq = E[k][q];
        N[p][k] = c * pk - s * qk;
        N[q][k] = s * pk + c * qk;
        E[k][p] = c * ep - s * eq;
        E[k][q] = s * ep + c * eq;
    }
}

/* Eigenvector of the largest eigenvalue of a symmetric matrix; N is destroyed. A 4x4 needs six or
 * seven sweeps. */
static void largest_eigenvector(double v[4], double N[4][4]) {
    double E[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    for (int sweep = 0; sweep < 30; sweep++)
        for (int p = 0; p < 3; p++)
            for (int q = p + 1; q < 4; q++)
                rotate(N, E, p, q);
    int best = 0;
    for (int i = 1; i < 4; i++)
        if (N[i][i] > N[best][best])
            best = i;
    for (int i = 0; i < 4; i++)
        v[i] = E[i][best];
}

/* Horn's matrix for the quaternion (x, y, z, w), from S = sum b a^T of the centred points. */
static void horn(double N[4][4], double S[3][3]) {
    const double rows[4][4] = {
        {S[0][0] - S[1][1] - S[2][2], S[0][1] + S[1][0], S[2][0] + S[0][2], S[1][2] - S[2][1]},
        {S[0][1] + S[1][0], S[1][1] - S[0][0] - S[2][2], S[1][2] + S[2][1], S[2][0] - S[0][2]},
        {S[2][0] + S[0][2], S[1][2] + S[2][1], S[2][2] - S[0][0] - S[1][1], S[0][1] - S[1][0]},
        {S[1][2] - S[2][1], S[2][0] - S[0][2], S[0][1] - S[1][0], S[0][0] + S[1][1] + S[2][2]},
    };
    memcpy(N, rows, sizeof rows);
}

void alignment_fit(plr_pose *A, const double *a, const double *b, size_t n) {
    double mean_a[3], mean_b[3], S[3][3] = {{0}}, N[4][4], q[4];
    mean3(mean_a, a, n);
    mean3(mean_b, b, n);
    for (size_t k = 0; k < n; k++)
        for (size_t i = 0; i < 3; i++)
            for (size_t j = 0; j < 3; j++)
                S[i][j] += (b[3 * k + i] - mean_b[i]) * (a[3 * k + j] - mean_a[j]);
    horn(N, S);
    largest_eigenvector(q, N);
    rotation_from_quaternion(A->R, q);
    for (int i = 0; i < 3; i++) {
        A->p[i] = mean_a[i];
        for (int j = 0; j < 3; j++)
            A->p[i] -= A->R[3 * i + j] * mean_b[j];
    }
}
