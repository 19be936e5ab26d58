// SPDX-License-Identifier: MIT
/*
 * The oracle: dense linear algebra in double by OpenBLAS and LAPACKE (oracle_blas.c) or, where they
 * are missing, by plain loops (oracle_plain.c); neither shares anything with the library. What both
 * have in common is in oracle.c. Matrices are row by row and without gaps where no ld is given. A LAPACK failure that is the caller's fault (a wrong argument) ends the
 * program.
 */
#ifndef PELORUS_TEST_ORACLE_H
#define PELORUS_TEST_ORACLE_H

#include <stdbool.h>
#include <stddef.h>

typedef enum oracle_op { ORACLE_PLAIN, ORACLE_TRANSPOSED } oracle_op;

/* C = alpha op(A) op(B) + beta C: op(A) is m x k, op(B) is k x n, C is m x n. */
void oracle_gemm(oracle_op op_A, oracle_op op_B, unsigned m, unsigned n, unsigned k, double alpha,
                 const double *A, const double *B, double beta, double *C);

/* S = A P A^T: A is m x n, P is n x n. */
void oracle_sandwich(unsigned m, unsigned n, const double *A, const double *P, double *S);

/* P <- P - V^T V, of P the lower triangle alone: P is n x n with ld numbers a row, V is m x n. */
void oracle_downdate(unsigned n, unsigned m, const double *V, double *P, size_t ld);

/* L L^T = A in place; the strict upper triangle becomes 0. False if A is not positive definite. */
bool oracle_cholesky(unsigned n, double *A);

/* X <- L^-1 X: L is n x n lower triangular, X is n x columns. */
void oracle_solve_lower(unsigned n, unsigned columns, const double *L, double *X);

/* X <- A^-1 X for positive definite A, which is spoiled. False if it is not positive definite. */
bool oracle_solve_spd(unsigned n, unsigned columns, double *A, double *X);

/* Eigenvalues of symmetric A, ascending; A is kept. */
void oracle_eigenvalues(unsigned n, const double *A, double *values);

/* The same; A is spoiled. */
void oracle_eigenvalues_of(unsigned n, double *A, double *values);

/* The smallest of them. */
double oracle_smallest_eigenvalue(unsigned n, const double *A);

#endif
