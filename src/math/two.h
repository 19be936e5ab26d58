// SPDX-License-Identifier: MIT
/* Matrices of 2x2, row by row; symmetric ones as xx xy yy. */
#ifndef PLR_MATH_TWO_H
#define PLR_MATH_TWO_H

#include "pelorus/config.h"

static inline plr_real plr_det2(const plr_real A[4]) {
    return PLR_FMA(A[0], A[3], -(A[1] * A[2]));
}

/* x with A x = b; x may not be b. */
static inline void plr_solve2(plr_real x[2], const plr_real A[4], const plr_real b[2]) {
    const plr_real by_det = 1 / plr_det2(A);
    x[0] = PLR_FMA(A[3], b[0], -(A[1] * b[1])) * by_det;
    x[1] = PLR_FMA(A[0], b[1], -(A[2] * b[0])) * by_det;
}

/* The same, S symmetric. */
static inline void plr_solve2_symmetric(plr_real x[2], const plr_real S[3], const plr_real b[2]) {
    const plr_real A[4] = {S[0], S[1], S[1], S[2]};
    plr_solve2(x, A, b);
}

/* a^T S b, S symmetric. */
static inline plr_real plr_product2(const plr_real a[2], const plr_real S[3], const plr_real b[2]) {
    return PLR_FMA(a[0], PLR_FMA(S[0], b[0], S[1] * b[1]), a[1] * PLR_FMA(S[1], b[0], S[2] * b[1]));
}

#endif
