// SPDX-License-Identifier: MIT
/*
 * Dense matrices, row by row, with a leading dimension (elements from one row to the next).
 * Every kernel adds the products for one element of the result in the same order: it starts with
 * the element's old value and k ascends. Therefore blocked, plain and vectorised code agree bit for
 * bit.
 */
#ifndef PLR_MATH_DENSE_H
#define PLR_MATH_DENSE_H

#include <stdbool.h>
#include <stddef.h>

#include "pelorus/assertions.h"
#include "pelorus/config.h"

/* C += A B. A is m x k, B is k x n, C is m x n and overlaps neither. Inlined, because in
 * nearly all uses the sizes are small constants. */
static inline void plr_gemm_nn(unsigned m, unsigned n, unsigned k, const plr_real *restrict A,
                               size_t lda, const plr_real *restrict B, size_t ldb,
                               plr_real *restrict C, size_t ldc) {
    PLR_ASSERT(lda >= k && ldb >= n && ldc >= n);
    for (unsigned i = 0; i < m; i++)
        for (unsigned l = 0; l < k; l++) {
            const plr_real a = A[i * lda + l];
            for (unsigned j = 0; j < n; j++)
                C[i * ldc + j] = PLR_FMA(a, B[l * ldb + j], C[i * ldc + j]);
        }
}

/* C += A B^T. A is m x k, B is n x k, C is m x n and overlaps neither. */
static inline void plr_gemm_nt(unsigned m, unsigned n, unsigned k, const plr_real *restrict A,
                               size_t lda, const plr_real *restrict B, size_t ldb,
                               plr_real *restrict C, size_t ldc) {
    PLR_ASSERT(lda >= k && ldb >= k && ldc >= n);
    for (unsigned i = 0; i < m; i++)
        for (unsigned j = 0; j < n; j++) {
            plr_real sum = C[i * ldc + j];
            for (unsigned l = 0; l < k; l++)
                sum = PLR_FMA(A[i * lda + l], B[j * ldb + l], sum);
            C[i * ldc + j] = sum;
        }
}

/* y = A x for 6x6; y may not be x */
static inline void plr_mat6_vec(plr_real y[PLR_POSE_DIM], const plr_real A[PLR_POSE_SQUARE],
                                const plr_real x[PLR_POSE_DIM]) {
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        y[i] = 0;
    plr_gemm_nn(PLR_POSE_DIM, 1, PLR_POSE_DIM, A, PLR_POSE_DIM, x, 1, y, 1);
}

/* C = A B for 6x6; C may not be A or B */
static inline void plr_mat6_mul(plr_real C[PLR_POSE_SQUARE], const plr_real A[PLR_POSE_SQUARE],
                                const plr_real B[PLR_POSE_SQUARE]) {
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        C[i] = 0;
    plr_gemm_nn(PLR_POSE_DIM, PLR_POSE_DIM, PLR_POSE_DIM, A, PLR_POSE_DIM, B, PLR_POSE_DIM, C,
                PLR_POSE_DIM);
}

/* S = A P A^T for 6x6: P symmetric; S overlaps neither and comes out symmetric to the bit. */
void plr_sandwich6(plr_real S[36], const plr_real A[36], const plr_real P[36]);

/* S = B P B^T, 6x6: B is 6 x m with leading dimension PLR_DRIVERS, P m x m and symmetric, m at most
 * PLR_DRIVERS. For m = 6 the same bits as plr_sandwich6. */
void plr_sandwich_drivers(plr_real S[PLR_POSE_SQUARE], unsigned m, const plr_real B[PLR_MOTION_BY],
                          const plr_real *P);

/* S += M P M^T, 3x3: M is 3x6, P 6x6 and symmetric. MP, 3x6, receives M P. */
void plr_sandwich3(plr_real S[9], plr_real MP[PLR_ROWS * PLR_POSE_DIM],
                   const plr_real M[PLR_ROWS * PLR_POSE_DIM], const plr_real P[PLR_POSE_SQUARE]);

/* M = L L^T for a 6x6 that need not be definite: a direction in which M is zero, to rounding,
 * becomes a zero column of the lower triangle L. */
void plr_factor6(plr_real L[PLR_POSE_SQUARE], const plr_real M[PLR_POSE_SQUARE]);

/* Index of (i, i) in a packed upper triangle, n x n, by rows: (0,0) (0,1) ... (1,1) ...; i <= n. */
static inline size_t plr_upper_row(unsigned n, unsigned i) {
    PLR_ASSERT(i <= n);
    return (size_t)i * n - (size_t)i * (i - 1U) / 2;
}

/* Row k of plr_upper6_add. Inlined for each k: with no loop left, S can stay in registers. */
static inline void plr_upper6_add_row(unsigned k, plr_real *S, const plr_real *a,
                                      const plr_real *b) {
    plr_real *row = S + plr_upper_row(PLR_POSE_DIM, k) - k;
    for (unsigned l = k; l < PLR_POSE_DIM; l++)
        row[l] = PLR_FMA(a[k], b[l], row[l]);
}

/* S += a b^T, upper triangle of a 6x6, packed row by row. */
static inline void plr_upper6_add(plr_real S[PLR_POSE_TRIANGLE], const plr_real a[PLR_POSE_DIM],
                                  const plr_real b[PLR_POSE_DIM]) {
    plr_upper6_add_row(0, S, a, b);
    plr_upper6_add_row(1, S, a, b);
    plr_upper6_add_row(2, S, a, b);
    plr_upper6_add_row(3, S, a, b);
    plr_upper6_add_row(4, S, a, b);
    plr_upper6_add_row(5, S, a, b);
}

/* The upper triangle of A, packed. */
static inline void plr_upper6_pack(plr_real U[PLR_POSE_TRIANGLE],
                                   const plr_real A[PLR_POSE_SQUARE]) {
    for (unsigned r = 0, at = 0; r < PLR_POSE_DIM; r++)
        for (unsigned c = r; c < PLR_POSE_DIM; c++, at++)
            U[at] = A[PLR_POSE_DIM * r + c];
}

/* The 6x6 symmetric matrix of a packed upper triangle. */
static inline void plr_upper6_unpack(plr_real A[PLR_POSE_SQUARE],
                                     const plr_real S[PLR_POSE_TRIANGLE]) {
    for (unsigned k = 0, at = 0; k < PLR_POSE_DIM; k++)
        for (unsigned l = k; l < PLR_POSE_DIM; l++, at++)
            A[PLR_POSE_DIM * k + l] = A[PLR_POSE_DIM * l + k] = S[at];
}

/* S <- U with U^T U = S: n x n, packed upper. False if a pivot is not a positive finite number; S
 * is then destroyed. PLR_KERNEL_MARGIN elements after its end must be readable. */
bool plr_cholesky_upper(unsigned n, plr_real *S);

/* X <- U^-T X: U is k x k, packed upper; X is k x n with leading dimension ldx. */
void plr_solve_upper_transposed(unsigned k, unsigned n, const plr_real *U, plr_real *X, size_t ldx);

/* x <- U^-1 x, k long: U is k x k, packed upper. */
void plr_solve_upper(unsigned k, const plr_real *U, plr_real *x);

/* x += sum_k a_k X_k: a with leading dimension lda, X depth x n with ldx, x of n elements. */
void plr_combine_rows(unsigned n, unsigned depth, const plr_real *a, size_t lda, const plr_real *X,
                      size_t ldx, plr_real *x);

/* X_r -= sum_k A(k, r) V_k for four rows X_r: V depth x n, A depth x 4, depth >= 2, n a multiple of
 * PLR_TILE_COLUMNS. The same order of operations, and so the same bits, as plr_combine_rows. */
void plr_subtract_four_rows(unsigned n, unsigned depth, const plr_real *A, size_t lda,
                            const plr_real *V, size_t ldv, plr_real *const X[4]);

#endif
