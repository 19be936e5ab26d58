// SPDX-License-Identifier: MIT
/*
 * Vectors of 3 and matrices of 3x3, row by row. Everything is inlined, because a call would take
 * longer than the work. Sums are written as fused multiply-adds in a fixed order, so that every
 * target computes the same bits.
 */
#ifndef PLR_MATH_SMALL_H
#define PLR_MATH_SMALL_H

#include <stdbool.h>
#include <string.h>

#include "pelorus/assertions.h"
#include "pelorus/config.h"

/* a^T b */
static inline plr_real plr_dot3(const plr_real a[3], const plr_real b[3]) {
    return PLR_FMA(a[2], b[2], PLR_FMA(a[1], b[1], a[0] * b[0]));
}

/* x^T x of six numbers */
static inline plr_real plr_norm2_of_6(const plr_real x[6]) {
    return plr_dot3(x, x) + plr_dot3(x + 3, x + 3);
}

/* The turn of a small rotation I + E: half of what is skew in it, rad. */
static inline void plr_turn_of(plr_real turn[3], const plr_real E[9]) {
    turn[0] = PLR_R(0.5) * (E[7] - E[5]);
    turn[1] = PLR_R(0.5) * (E[2] - E[6]);
    turn[2] = PLR_R(0.5) * (E[3] - E[1]);
}

/* c = a x b; c may not be a or b */
static inline void plr_cross3(plr_real c[3], const plr_real a[3], const plr_real b[3]) {
    PLR_ASSERT(c != a && c != b);
    c[0] = PLR_FMA(a[1], b[2], -(a[2] * b[1]));
    c[1] = PLR_FMA(a[2], b[0], -(a[0] * b[2]));
    c[2] = PLR_FMA(a[0], b[1], -(a[1] * b[0]));
}

/* y = A x; y may not be x */
static inline void plr_mat3_vec(plr_real y[3], const plr_real A[9], const plr_real x[3]) {
    PLR_ASSERT(y != x);
    for (int i = 0; i < 3; i++)
        y[i] = plr_dot3(A + 3 * i, x);
}

/* y = A^T x; y may not be x */
static inline void plr_mat3_tvec(plr_real y[3], const plr_real A[9], const plr_real x[3]) {
    PLR_ASSERT(y != x);
    for (int i = 0; i < 3; i++)
        y[i] = PLR_FMA(A[6 + i], x[2], PLR_FMA(A[3 + i], x[1], A[i] * x[0]));
}

/* C = A B; C may not be A or B */
static inline void plr_mat3_mul(plr_real C[9], const plr_real A[9], const plr_real B[9]) {
    PLR_ASSERT(C != A && C != B);
    for (int i = 0; i < 3; i++)
        plr_mat3_tvec(C + 3 * i, B, A + 3 * i);
}

/* C = A B^T; C may not be A or B */
static inline void plr_mat3_mul_nt(plr_real C[9], const plr_real A[9], const plr_real B[9]) {
    PLR_ASSERT(C != A && C != B);
    for (int i = 0; i < 3; i++)
        plr_mat3_vec(C + 3 * i, B, A + 3 * i);
}

/* C = A^T B; C may not be A or B */
static inline void plr_mat3_mul_tn(plr_real C[9], const plr_real A[9], const plr_real B[9]) {
    PLR_ASSERT(C != A && C != B);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            C[3 * i + j] = PLR_FMA(A[6 + i], B[6 + j], PLR_FMA(A[3 + i], B[3 + j], A[i] * B[j]));
}

/* T = A^T; T may not be A */
static inline void plr_mat3_transpose(plr_real T[9], const plr_real A[9]) {
    PLR_ASSERT(T != A);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            T[3 * i + j] = A[3 * j + i];
}

/* S = [x]x, so that S y = x cross y */
static inline void plr_skew(plr_real S[9], const plr_real x[3]) {
    const plr_real S_of_x[9] = {0, -x[2], x[1], x[2], 0, -x[0], -x[1], x[0], 0};
    memcpy(S, S_of_x, sizeof S_of_x);
}

static inline void plr_mat3_identity(plr_real A[9]) {
    static const plr_real identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    memcpy(A, identity, sizeof identity);
}

static inline plr_real plr_abs(plr_real x) {
    return x < 0 ? -x : x;
}

/* False for NaN and infinities. */
static inline bool plr_is_finite(plr_real x) {
    return x - x == 0;
}

/* S <- U with U^T U = S: 3x3, packed upper (0,0) (0,1) (0,2) (1,1) (1,2) (2,2). False, and S is
 * destroyed, if a pivot is not a positive finite number. The bits of plr_cholesky_upper(3, S). */
static inline bool plr_cholesky3(plr_real S[6]) {
    if (!(S[0] > 0) || !plr_is_finite(S[0]))
        return false;
    plr_real inverse = PLR_R(1) / PLR_SQRT(S[0]);
    S[0] *= inverse;
    S[1] *= inverse;
    S[2] *= inverse;
    S[3] = PLR_FMA(-S[1], S[1], S[3]);
    S[4] = PLR_FMA(-S[1], S[2], S[4]);
    if (!(S[3] > 0) || !plr_is_finite(S[3]))
        return false;
    inverse = PLR_R(1) / PLR_SQRT(S[3]);
    S[3] *= inverse;
    S[4] *= inverse;
    S[5] = PLR_FMA(-S[4], S[4], PLR_FMA(-S[2], S[2], S[5]));
    if (!(S[5] > 0) || !plr_is_finite(S[5]))
        return false;
    S[5] *= PLR_R(1) / PLR_SQRT(S[5]);
    return true;
}

/* U of U^T U = S for a full symmetric S, 3x3; U packed as above. False as plr_cholesky3. */
static inline bool plr_factorise3(plr_real U[6], const plr_real S[9]) {
    const plr_real packed[6] = {S[0], S[3], S[6], S[4], S[7], S[8]};
    memcpy(U, packed, sizeof packed);
    return plr_cholesky3(U);
}

/* y = U^T x: U is 3x3, packed upper; y may not be x. */
static inline void plr_multiply3_transposed(plr_real y[3], const plr_real U[6],
                                            const plr_real x[3]) {
    y[0] = U[0] * x[0];
    y[1] = PLR_FMA(U[3], x[1], U[1] * x[0]);
    y[2] = PLR_FMA(U[5], x[2], PLR_FMA(U[4], x[1], U[2] * x[0]));
}

/* X <- U^-T X, 3 x n, U packed upper: the bits of plr_solve_upper_transposed(3, n, U, X, n). */
static inline void plr_solve3_transposed(unsigned n, const plr_real U[6], plr_real *X) {
    const plr_real by0 = PLR_R(1) / U[0], by1 = PLR_R(1) / U[3], by2 = PLR_R(1) / U[5];
    for (unsigned c = 0; c < n; c++) {
        const plr_real x0 = X[c] * by0;
        const plr_real x1 = PLR_FMA(-U[1], x0, X[n + c]) * by1;
        X[c] = x0;
        X[n + c] = x1;
        X[2 * n + c] = PLR_FMA(-U[4], x1, PLR_FMA(-U[2], x0, X[2 * n + c])) * by2;
    }
}

#endif
