// SPDX-License-Identifier: MIT
/*
 * Dense matrices, row by row, with a leading dimension (elements from one row to the next).
 * Kernels are in axpy form: an accumulator starts at the element that it changes and k ascends, so
 * blocked, plain and vectorised code agree bit for bit.
 */
#ifndef PLR_LINALG_DENSE_H
#define PLR_LINALG_DENSE_H

#include <stdbool.h>
#include <stddef.h>

#include "pelorus/config.h"

/* C += A B. A is m x k, B is k x n, C is m x n and overlaps neither. */
void plr_gemm_nn(unsigned m, unsigned n, unsigned k, const plr_real *A, size_t lda,
                 const plr_real *B, size_t ldb, plr_real *C, size_t ldc);

/* C += A B^T. A is m x k, B is n x k, C is m x n and overlaps neither. */
void plr_gemm_nt(unsigned m, unsigned n, unsigned k, const plr_real *A, size_t lda,
                 const plr_real *B, size_t ldb, plr_real *C, size_t ldc);

/* S = A P A^T for 6x6: P symmetric; S overlaps neither and comes out symmetric to the bit. */
void plr_sandwich6(plr_real S[36], const plr_real A[36], const plr_real P[36]);

/* L L^T = S in place: S is n x n packed lower (row by row), and so is L. False, with S spoiled, if
 * a pivot is not a positive finite number. */
bool plr_cholesky_packed(unsigned n, plr_real *S);

/* X <- L^-1 X: L is k x k packed lower, X is k x n with leading dimension ldx. */
void plr_solve_lower_packed(unsigned k, unsigned n, const plr_real *L, plr_real *X, size_t ldx);

#endif
