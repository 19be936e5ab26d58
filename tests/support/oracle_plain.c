// SPDX-License-Identifier: MIT
/* The oracle where OpenBLAS and LAPACKE are missing: CMake takes this file instead of oracle_blas.c. */
#include "support/oracle.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/plain_algebra.h"

/* Memory for n x m numbers, or the end of the program. */
static double *matrix(unsigned n, unsigned m) {
    double *A = malloc(((size_t)n * m + 1) * sizeof *A);
    if (A == NULL) {
        fprintf(stderr, "oracle: no memory for %u x %u numbers\n", n, m);
        exit(EXIT_FAILURE);
    }
    return A;
}

void oracle_gemm(oracle_op op_A, oracle_op op_B, unsigned m, unsigned n, unsigned k, double alpha,
                 const double *A, const double *B, double beta, double *C) {
    plain_gemm(op_A == ORACLE_TRANSPOSED, op_B == ORACLE_TRANSPOSED, m, n, k, alpha, A, B, beta, C);
}

void oracle_sandwich(unsigned m, unsigned n, const double *A, const double *P, double *S) {
    double *AP = matrix(m, n);
    plain_gemm(false, false, m, n, n, 1, A, P, 0, AP);
    plain_gemm(false, true, m, m, n, 1, AP, A, 0, S);
    free(AP);
}

bool oracle_cholesky(unsigned n, double *A) {
    return plain_cholesky(n, A);
}

void oracle_solve_lower(unsigned n, unsigned columns, const double *L, double *X) {
    plain_solve_lower(n, columns, L, X);
}

bool oracle_solve_spd(unsigned n, unsigned columns, double *A, double *X) {
    if (!plain_cholesky(n, A))
        return false;
    plain_solve_lower(n, columns, A, X);
    plain_solve_lower_transposed(n, columns, A, X);
    return true;
}

void oracle_eigenvalues(unsigned n, const double *A, double *values) {
    double *copy = matrix(n, n);
    memcpy(copy, A, (size_t)n * n * sizeof *copy);
    plain_eigenvalues(n, copy, values);
    free(copy);
}

double oracle_smallest_eigenvalue(unsigned n, const double *A) {
    double *values = matrix(n, 1);
    oracle_eigenvalues(n, A, values);
    const double smallest = values[0];
    free(values);
    return smallest;
}
