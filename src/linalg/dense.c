// SPDX-License-Identifier: MIT
#include "linalg/dense.h"

#include <string.h>

#include "linalg/packed.h"
#include "linalg/small.h"

void plr_gemm_nn(unsigned m, unsigned n, unsigned k, const plr_real *A, size_t lda,
                 const plr_real *B, size_t ldb, plr_real *C, size_t ldc) {
    for (unsigned i = 0; i < m; i++)
        for (unsigned l = 0; l < k; l++) {
            const plr_real a = A[i * lda + l];
            for (unsigned j = 0; j < n; j++)
                C[i * ldc + j] = PLR_FMA(a, B[l * ldb + j], C[i * ldc + j]);
        }
}

void plr_gemm_nt(unsigned m, unsigned n, unsigned k, const plr_real *A, size_t lda,
                 const plr_real *B, size_t ldb, plr_real *C, size_t ldc) {
    for (unsigned i = 0; i < m; i++)
        for (unsigned j = 0; j < n; j++) {
            plr_real sum = C[i * ldc + j];
            for (unsigned l = 0; l < k; l++)
                sum = PLR_FMA(A[i * lda + l], B[j * ldb + l], sum);
            C[i * ldc + j] = sum;
        }
}

void plr_sandwich6(plr_real S[36], const plr_real A[36], const plr_real P[36]) {
    plr_real AP[36] = {0};
    plr_gemm_nn(6, 6, 6, A, 6, P, 6, AP, 6);
    memset(S, 0, 36 * sizeof *S);
    for (unsigned i = 0; i < 6; i++) {
        plr_gemm_nt(1, i + 1, 6, AP + 6 * i, 6, A, 6, S + 6 * i, 6);
        for (unsigned j = 0; j < i; j++)
            S[6 * j + i] = S[6 * i + j];
    }
}

bool plr_cholesky_packed(unsigned n, plr_real *S) {
    for (unsigned i = 0; i < n; i++) {
        plr_real *row_i = S + plr_packed_row(i);
        for (unsigned j = 0; j < i; j++) {
            const plr_real *row_j = S + plr_packed_row(j);
            plr_real sum = row_i[j];
            for (unsigned k = 0; k < j; k++)
                sum = PLR_FMA(-row_i[k], row_j[k], sum);
            row_i[j] = sum / row_j[j];
        }
        plr_real pivot = row_i[i];
        for (unsigned k = 0; k < i; k++)
            pivot = PLR_FMA(-row_i[k], row_i[k], pivot);
        if (!(pivot > 0) || !plr_is_finite(pivot))
            return false;
        row_i[i] = PLR_SQRT(pivot);
    }
    return true;
}

void plr_solve_lower_packed(unsigned k, unsigned n, const plr_real *L, plr_real *X, size_t ldx) {
    for (unsigned i = 0; i < k; i++) {
        const plr_real *row = L + plr_packed_row(i);
        plr_real *restrict x = X + i * ldx;
        for (unsigned l = 0; l < i; l++) {
            const plr_real a = -row[l];
            const plr_real *restrict y = X + l * ldx;
            for (unsigned j = 0; j < n; j++)
                x[j] = PLR_FMA(a, y[j], x[j]);
        }
        const plr_real inverse = PLR_R(1) / row[i];
        for (unsigned j = 0; j < n; j++)
            x[j] *= inverse;
    }
}
