// SPDX-License-Identifier: MIT
/*
 * Linear algebra as a textbook writes it down, in double: loops over rows, columns and terms. Slow,
 * and it needs nothing. It stands in for OpenBLAS and LAPACKE where they are missing
 * (oracle_plain.c), so that no test is left out for want of them. Matrices are row by row and without
 * gaps.
 */
#ifndef PELORUS_TEST_PLAIN_ALGEBRA_H
#define PELORUS_TEST_PLAIN_ALGEBRA_H

#include <stdbool.h>
#include <stddef.h>

/* C = alpha op(A) op(B) + beta C: op(A) is m x k, op(B) is k x n, C is m x n. With beta = 0 what
 * stood in C does not matter. */
void plain_gemm(bool transpose_A, bool transpose_B, unsigned m, unsigned n, unsigned k,
                double alpha, const double *A, const double *B, double beta, double *C);

/* P <- P - V^T V, of P the lower triangle alone: P is n x n with ld numbers a row, V is m x n. */
void plain_downdate(unsigned n, unsigned m, const double *V, double *P, size_t ld);

/* L L^T = A in place, the strict upper triangle becomes 0. False if A is not positive definite. */
bool plain_cholesky(unsigned n, double *A);

/* X <- L^-1 X, and X <- L^-T X: L is n x n lower triangular, X is n x columns. */
void plain_solve_lower(unsigned n, unsigned columns, const double *L, double *X);
void plain_solve_lower_transposed(unsigned n, unsigned columns, const double *L, double *X);

/* Eigenvalues of symmetric A, ascending, by Jacobi's rotations; A is spoiled. */
void plain_eigenvalues(unsigned n, double *A, double *values);

#endif
