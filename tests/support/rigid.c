// SPDX-License-Identifier: MIT
#include "support/rigid.h"

#include <stdbool.h>
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

/* total += term; false if that changed nothing. */
static bool added(unsigned n, long double *total, const long double *term) {
    bool changed = false;
    for (unsigned i = 0; i < n * n; i++) {
        const long double before = total[i];
        total[i] += term[i];
        changed |= total[i] != before;
    }
    return changed;
}

/* sum = sum_k A^k shift! / (k + shift)! for n x n, in long double: beyond a double's rounding while
 * |A| < 5 or so. It ends where, of terms that only shrink, two in a row changed nothing: in the powers of
 * a turn about an axis every second one has a zero where its neighbours have none. */
static void power_series(unsigned n, unsigned shift, const double *A, double *sum) {
    enum { TERMS = 40, SHRINKING = 10, LARGEST = 36 };
    long double term[LARGEST] = {0}, next[LARGEST], total[LARGEST];
    unsigned idle = 0;
    for (unsigned i = 0; i < n; i++)
        term[i * n + i] = 1;
    memcpy(total, term, sizeof total);
    for (unsigned k = 1; k <= TERMS && (idle < 2 || k <= SHRINKING); k++) {
        for (unsigned i = 0; i < n * n; i++) {
            next[i] = 0;
            for (unsigned l = 0; l < n; l++)
                next[i] += term[i / n * n + l] * (long double)A[l * n + i % n];
            next[i] /= k + shift;
        }
        memcpy(term, next, n * n * sizeof *term);
        idle = added(n, total, term) ? 0 : idle + 1;
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

void rigid_apply(double y[3], const double M[16], const double x[3]) {
    const double from[3] = {x[0], x[1], x[2]};
    for (int i = 0; i < 3; i++)
        y[i] = M[4 * i] * from[0] + M[4 * i + 1] * from[1] + M[4 * i + 2] * from[2] + M[4 * i + 3];
}

void rigid_rotation(double R[9], const double M[16]) {
    for (int i = 0; i < 3; i++)
        memcpy(R + 3 * i, M + 4 * i, 3 * sizeof *R);
}

void rigid_rotation_back(double Rt[9], const double M[16]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            Rt[3 * i + j] = M[4 * j + i];
}

/* R <- R (3 I - R^T R) / 2: Newton's step, which squares what is wrong. */
void rigid_clean(double M[16]) {
    double R[9], Rt[9], RtR[9], cleaned[9];
    rigid_rotation(R, M);
    rigid_rotation_back(Rt, M);
    square_multiply(3, Rt, R, RtR);
    for (int i = 0; i < 9; i++)
        RtR[i] = (i % 4 == 0 ? 1.5 : 0) - 0.5 * RtR[i];
    square_multiply(3, R, RtR, cleaned);
    for (int i = 0; i < 9; i++)
        M[4 * (i / 3) + i % 3] = cleaned[i];
}

void rigid_from_pose(double M[16], const plr_pose *pose) {
    memset(M, 0, 16 * sizeof *M);
    for (int i = 0; i < 3; i++) {
        memcpy(M + 4 * i, pose->R + 3 * i, 3 * sizeof *M);
        M[4 * i + 3] = pose->p[i];
    }
    M[15] = 1;
}

void rigid_to_pose(plr_pose *pose, const double M[16]) {
    rigid_rotation(pose->R, M);
    for (int i = 0; i < 3; i++)
        pose->p[i] = M[4 * i + 3];
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

void rigid_adjoint(double Ad[36], const double M[16]) {
    const double p[3] = {M[3], M[7], M[11]};
    double R[9], S[9] = {0}, SR[9];
    rigid_rotation(R, M);
    put_skew(S, 3, 0, 0, p);
    square_multiply(3, S, R, SR);
    memset(Ad, 0, 36 * sizeof *Ad);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            Ad[6 * i + j] = Ad[6 * (i + 3) + j + 3] = R[3 * i + j];
            Ad[6 * i + j + 3] = SR[3 * i + j];
        }
}

void rigid_right_jacobian(double Jr[36], const double xi[6]) {
    double ad[36];
    rigid_ad(ad, xi);
    for (int i = 0; i < 36; i++)
        ad[i] = -ad[i];
    power_series(6, 1, ad, Jr);
}

void rigid_log(double xi[6], const double E[16]) {
    rigid_vee(xi, E);
    bool changed = true;
    for (int step = 0; step < 10 && changed; step++) {
        double X[16], inverse[16], rest[16], d[6];
        rigid_exp(X, xi);
        rigid_inverse(inverse, X);
        square_multiply(4, inverse, E, rest);
        rigid_vee(d, rest);
        changed = false;
        for (int i = 0; i < 6; i++) {
            changed |= xi[i] + d[i] != xi[i];
            xi[i] += d[i];
        }
    }
}
