// SPDX-License-Identifier: MIT
#include "support/plain_algebra.h"

#include <math.h>
#include <stdlib.h>

void plain_gemm(bool transpose_A, bool transpose_B, unsigned m, unsigned n, unsigned k,
                double alpha, const double *A, const double *B, double beta, double *C) {
    for (unsigned i = 0; i < m; i++) {
        double *row = C + i * n;
        for (unsigned j = 0; j < n; j++)
            row[j] = beta != 0 ? beta * row[j] : 0;
        for (unsigned l = 0; l < k; l++) {
            const double a = alpha * (transpose_A ? A[l * m + i] : A[i * k + l]);
            for (unsigned j = 0; j < n; j++)
                row[j] += a * (transpose_B ? B[j * k + l] : B[l * n + j]);
        }
    }
}

void plain_downdate(unsigned n, unsigned m, const double *V, double *P, size_t ld) {
    for (unsigned k = 0; k < m; k++)
        for (unsigned i = 0; i < n; i++)
            for (unsigned j = 0; j <= i; j++)
                P[i * ld + j] -= V[k * n + i] * V[k * n + j];
}

bool plain_cholesky(unsigned n, double *A) {
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < n; j++) {
            double value = A[i * n + j];
            for (unsigned k = 0; k < j && j <= i; k++)
                value -= A[i * n + k] * A[j * n + k];
            if (i == j && !(value > 0))
                return false;
            A[i * n + j] = j > i ? 0 : j == i ? sqrt(value) : value / A[j * n + j];
        }
    return true;
}

void plain_solve_lower(unsigned n, unsigned columns, const double *L, double *X) {
    for (unsigned c = 0; c < columns; c++)
        for (unsigned i = 0; i < n; i++) {
            for (unsigned k = 0; k < i; k++)
                X[i * columns + c] -= L[i * n + k] * X[k * columns + c];
            X[i * columns + c] /= L[i * n + i];
        }
}

void plain_solve_lower_transposed(unsigned n, unsigned columns, const double *L, double *X) {
    for (unsigned c = 0; c < columns; c++)
        for (unsigned i = n; i-- > 0;) {
            for (unsigned k = i + 1; k < n; k++)
                X[i * columns + c] -= L[k * n + i] * X[k * columns + c];
            X[i * columns + c] /= L[i * n + i];
        }
}

/* Turns A(p, q) to zero by a rotation in the plane of p and q. */
static void rotate(unsigned n, double *A, unsigned p, unsigned q) {
    if (A[p * n + q] == 0)
        return;
    const double half = (A[q * n + q] - A[p * n + p]) / (2 * A[p * n + q]);
    const double t = (half < 0 ? -1 : 1) / (fabs(half) + hypot(half, 1));
    const double c = 1 / hypot(t, 1), s = t * c;
    for (unsigned k = 0; k < n; k++) {
        const double kp = A[k * n + p], kq = A[k * n + q];
        A[k * n + p] = c * kp - s * kq;
        A[k * n + q] = s * kp + c * kq;
    }
    for (unsigned k = 0; k < n; k++) {
        const double pk = A[p * n + k], qk = A[q * n + k];
        A[p * n + k] = c * pk - s * qk;
        A[q * n + k] = s * pk + c * qk;
    }
}

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Each sweep squares what is off the diagonal, once that is small: a dozen leave only rounding. */
void plain_eigenvalues(unsigned n, double *A, double *values) {
    enum { SWEEPS = 16 };
    for (unsigned sweep = 0; sweep < SWEEPS; sweep++)
        for (unsigned p = 0; p + 1 < n; p++)
            for (unsigned q = p + 1; q < n; q++)
                rotate(n, A, p, q);
    for (unsigned i = 0; i < n; i++)
        values[i] = A[i * n + i];
    qsort(values, n, sizeof *values, ascending);
}
