// SPDX-License-Identifier: MIT
/* The oracle where OpenBLAS and LAPACKE are missing: CMake takes this file instead of oracle_blas.c. */
#include "support/oracle.h"

#include "support/plain_algebra.h"

void oracle_gemm(oracle_op op_A, oracle_op op_B, unsigned m, unsigned n, unsigned k, double alpha,
                 const double *A, const double *B, double beta, double *C) {
    plain_gemm(op_A == ORACLE_TRANSPOSED, op_B == ORACLE_TRANSPOSED, m, n, k, alpha, A, B, beta, C);
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

void oracle_downdate(unsigned n, unsigned m, const double *V, double *P, size_t ld) {
    plain_downdate(n, m, V, P, ld);
}

void oracle_eigenvalues_of(unsigned n, double *A, double *values) {
    plain_eigenvalues(n, A, values);
}
