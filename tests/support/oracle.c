// SPDX-License-Identifier: MIT
/* What the oracle does alike with OpenBLAS and without. */
#include "support/oracle.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Memory for n x m numbers, or the end of the program. */
static double *matrix(unsigned n, unsigned m) {
    double *A = malloc(((size_t)n * m + 1) * sizeof *A);
    if (A == NULL) {
        fprintf(stderr, "oracle: no memory for %u x %u numbers\n", n, m);
        exit(EXIT_FAILURE);
    }
    return A;
}

void oracle_sandwich(unsigned m, unsigned n, const double *A, const double *P, double *S) {
    double *AP = matrix(m, n);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, m, n, n, 1, A, P, 0, AP);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, m, m, n, 1, AP, A, 0, S);
    free(AP);
}

void oracle_eigenvalues(unsigned n, const double *A, double *values) {
    double *copy = matrix(n, n);
    memcpy(copy, A, (size_t)n * n * sizeof *copy);
    oracle_eigenvalues_of(n, copy, values);
    free(copy);
}

double oracle_smallest_eigenvalue(unsigned n, const double *A) {
    double *values = matrix(n, 1);
    oracle_eigenvalues(n, A, values);
    const double smallest = values[0];
    free(values);
    return smallest;
}
