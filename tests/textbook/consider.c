// SPDX-License-Identifier: MIT
#include "textbook/consider.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "support/oracle.h"

enum { POSE = 6, BIAS = 6 };

void consider_row(const textbook *t, const double *by_pose, const double *by_landmark,
                  unsigned landmark, double *row) {
    if (!textbook_is_body(t))
        memcpy(row, by_pose, POSE * sizeof *row);
    memcpy(row + textbook_row(t, landmark), by_landmark, 3 * sizeof *row);
}

/* K^T = S^-1 H P, m x n, with the columns of the biases zero. */
static void gain(unsigned n, unsigned m, const double *H, const double *P, double variance,
                 double *Kt) {
    double *S = calloc((size_t)m * m, sizeof *S), *HP = Kt;
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, m, n, n, 1, H, P, 0, HP);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, m, m, n, 1, HP, H, 0, S);
    for (unsigned i = 0; i < m; i++)
        S[(size_t)i * (m + 1)] += variance;
    (void)oracle_solve_spd(m, n, S, Kt);
    for (unsigned i = 0; i < m; i++)
        memset(Kt + (size_t)i * n + POSE, 0, BIAS * sizeof *Kt);
    free(S);
}

void consider_biases(textbook *t, unsigned n, unsigned m, const double *H) {
    const double sigma = t->config.pixel_sigma_px;
    double *P = calloc((size_t)n * n, sizeof *P), *A = calloc((size_t)n * n, sizeof *A);
    double *after = calloc((size_t)n * n, sizeof *after), *Kt = calloc((size_t)m * n, sizeof *Kt);
    for (unsigned i = 0; i < n; i++) {
        A[(size_t)i * (n + 1)] = 1;
        for (unsigned j = 0; j < n; j++)
            P[(size_t)i * n + j] = textbook_covariance(t, i, j);
    }
    gain(n, m, H, P, sigma * sigma, Kt);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, n, n, m, -1, Kt, H, 1, A);
    oracle_sandwich(n, n, A, P, after);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, n, n, m, sigma * sigma, Kt, Kt, 1, after);
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++)
            t->P[i * t->ld + j] = after[(size_t)i * n + j];
    memset(t->correction + POSE, 0, BIAS * sizeof *t->correction);
    free(P);
    free(A);
    free(after);
    free(Kt);
}
