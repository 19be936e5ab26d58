// SPDX-License-Identifier: MIT
#include "support/rigid.h"

#include <string.h>

void square_multiply(unsigned n, const double *A, const double *B, double *C) {
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < n; j++) {
            double sum = 0;
            for (unsigned k = 0; k < n; k++)
                sum += A[i * n + k] * B[k * n + j];
            C[i * n + j] = sum;
        }
}

/* S = [x]x as the 3x3 block at (row, column) of a matrix with leading dimension ld. */
static void put_skew(double *S, unsigned ld, unsigned row, unsigned column, const double x[3]) {
    double *block = S + row * ld + column;
    block[1] = -x[2];
    block[2] = x[1];
    block[ld] = x[2];
    block[ld + 2] = -x[0];
    block[2 * ld] = -x[1];
    block[2 * ld + 1] = x[0];
}

/* sum = sum_k A^k shift! / (k + shift)! for n x n, in long double: beyond a double's rounding while
 * |A| < 5 or so. */
static void power_series(unsigned n, unsigned shift, const double *A, double *sum) {
    enum { TERMS = 40, LARGEST = 36 };
    long double term[LARGEST] = {0}, next[LARGEST], total[LARGEST];
    for (unsigned i = 0; i < n; i++)
        term[i * n + i] = 1;
    memcpy(total, term, sizeof total);
    for (unsigned k = 1; k <= TERMS; k++) {
        memset(next, 0, sizeof next);
        for (unsigned i = 0; i < n * n; i++)
            for (unsigned l = 0; l < n; l++)
                next[i] += term[i / n * n + l] * (long double)A[l * n + i % n] / (k + shift);
        memcpy(term, next, sizeof term);
        for (unsigned i = 0; i < n * n; i++)
            total[i] += term[i];
    }
    for (unsigned i = 0; i < n * n; i++)
        sum[i] = (double)total[i];
}

void rigid_exp(double M[16], const double xi[6]) {
    double A[16] = {0};
    put_skew(A, 4, 0, 0, xi + 3);
    for (int i = 0; i < 3; i++)
        A[4 * i + 3] = xi[i];
    power_series(4, 0, A, M);
}

void rigid_inverse(double N[16], const double M[16]) {
    for (int i = 0; i < 3; i++) {
        N[4 * i + 3] = 0;
        for (int j = 0; j < 3; j++) {
            N[4 * i + j] = M[4 * j + i];
            N[4 * i + 3] -= M[4 * j + i] * M[4 * j + 3];
        }
    }
    for (int j = 0; j < 4; j++)
        N[12 + j] = j == 3;
}

void rigid_vee(double xi[6], const double M[16]) {
    for (int i = 0; i < 3; i++)
        xi[i] = M[4 * i + 3];
    xi[3] = (M[9] - M[6]) / 2;
    xi[4] = (M[2] - M[8]) / 2;
    xi[5] = (M[4] - M[1]) / 2;
}

void rigid_ad(double ad[36], const double xi[6]) {
    memset(ad, 0, 36 * sizeof *ad);
    put_skew(ad, 6, 0, 0, xi + 3);
    put_skew(ad, 6, 3, 3, xi + 3);
    put_skew(ad, 6, 0, 3, xi);
}

void rigid_right_jacobian(double Jr[36], const double xi[6]) {
    double ad[36];
    rigid_ad(ad, xi);
    for (int i = 0; i < 36; i++)
        ad[i] = -ad[i];
    power_series(6, 1, ad, Jr);
}
