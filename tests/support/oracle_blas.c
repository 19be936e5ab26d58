// SPDX-License-Identifier: MIT
#include "support/oracle.h"

#include <cblas.h>
#include <lapacke.h>
#include <stdio.h>
#include <stdlib.h>

/* LAPACK's info < 0 names a wrong argument. */
static void demand_arguments(const char *routine, lapack_int info) {
    if (info < 0) {
        fprintf(stderr, "oracle: argument %d of %s is wrong\n", -(int)info, routine);
        exit(EXIT_FAILURE);
    }
}

static int at_least_1(unsigned n) {
    return n > 0 ? (int)n : 1;
}

void oracle_gemm(oracle_op op_A, oracle_op op_B, unsigned m, unsigned n, unsigned k, double alpha,
                 const double *A, const double *B, double beta, double *C) {
    cblas_dgemm(CblasRowMajor, op_A == ORACLE_PLAIN ? CblasNoTrans : CblasTrans,
                op_B == ORACLE_PLAIN ? CblasNoTrans : CblasTrans, (int)m, (int)n, (int)k, alpha, A,
                at_least_1(op_A == ORACLE_PLAIN ? k : m), B,
                at_least_1(op_B == ORACLE_PLAIN ? n : k), beta, C, at_least_1(n));
}

bool oracle_cholesky(unsigned n, double *A) {
    const lapack_int info = LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'L', (lapack_int)n, A, at_least_1(n));
    demand_arguments("dpotrf", info);
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = i + 1; j < n; j++)
            A[i * n + j] = 0;
    return info == 0;
}

void oracle_solve_lower(unsigned n, unsigned columns, const double *L, double *X) {
    cblas_dtrsm(CblasRowMajor, CblasLeft, CblasLower, CblasNoTrans, CblasNonUnit, (int)n,
                (int)columns, 1, L, at_least_1(n), X, at_least_1(columns));
}

bool oracle_solve_spd(unsigned n, unsigned columns, double *A, double *X) {
    const lapack_int info = LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', (lapack_int)n, (lapack_int)columns,
                                          A, at_least_1(n), X, at_least_1(columns));
    demand_arguments("dposv", info);
    return info == 0;
}

void oracle_downdate(unsigned n, unsigned m, const double *V, double *P, size_t ld) {
    cblas_dsyrk(CblasRowMajor, CblasLower, CblasTrans, (int)n, (int)m, -1, V, at_least_1(n), 1, P,
                at_least_1((unsigned)ld));
}

void oracle_eigenvalues_of(unsigned n, double *A, double *values) {
    const lapack_int info =
        LAPACKE_dsyev(LAPACK_ROW_MAJOR, 'N', 'L', (lapack_int)n, A, at_least_1(n), values);
    demand_arguments("dsyev", info);
    if (info > 0) {
        fprintf(stderr, "oracle: dsyev did not converge\n");
        exit(EXIT_FAILURE);
    }
}
