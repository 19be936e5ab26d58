// SPDX-License-Identifier: MIT
#include "linalg/dense.h"

#include <string.h>

#include "linalg/small.h"

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

bool plr_cholesky_upper(unsigned n, plr_real *S) {
    for (unsigned k = 0; k < n; k++) {
        plr_real *restrict row_k = S + plr_upper_row(n, k); /* (k, k), (k, k+1), ... */
        if (!(row_k[0] > 0) || !plr_is_finite(row_k[0]))
            return false;
        row_k[0] = PLR_SQRT(row_k[0]);
        const plr_real inverse = PLR_R(1) / row_k[0];
        for (unsigned j = 1; j < n - k; j++)
            row_k[j] *= inverse;
        for (unsigned i = 1; i < n - k; i++) {
            plr_real *restrict row_i = S + plr_upper_row(n, k + i);
            const plr_real a = -row_k[i];
            for (unsigned j = 0; j < n - k - i; j++)
                row_i[j] = PLR_FMA(a, row_k[i + j], row_i[j]);
        }
    }
    return true;
}

enum { STRIP = PLR_TILE_COLUMNS };

/* The solution for STRIP columns: one row of them at a time, in registers. */
static void solve_strip(unsigned k, const plr_real *restrict U, plr_real *restrict X, size_t ldx) {
    for (unsigned i = 0; i < k; i++) {
        plr_real x[STRIP];
        memcpy(x, X + i * ldx, sizeof x);
        const plr_real *u = U + i; /* (0, i), then down the column */
        for (unsigned l = 0; l < i; l++) {
            const plr_real a = -*u;
            const plr_real *restrict y = X + l * ldx;
            for (int c = 0; c < STRIP; c++)
                x[c] = PLR_FMA(a, y[c], x[c]);
            u += k - l - 1;
        }
        const plr_real inverse = PLR_R(1) / *u;
        for (int c = 0; c < STRIP; c++)
            x[c] *= inverse;
        memcpy(X + i * ldx, x, sizeof x);
    }
}

/* The same for a single column. */
static void solve_column(unsigned k, const plr_real *restrict U, plr_real *X, size_t ldx) {
    for (unsigned i = 0; i < k; i++) {
        plr_real x = X[i * ldx];
        const plr_real *u = U + i;
        for (unsigned l = 0; l < i; l++) {
            x = PLR_FMA(-*u, X[l * ldx], x);
            u += k - l - 1;
        }
        X[i * ldx] = x * (PLR_R(1) / *u);
    }
}

void plr_solve_upper_transposed(unsigned k, unsigned n, const plr_real *U, plr_real *X,
                                size_t ldx) {
    unsigned j = 0;
    for (; j + STRIP <= n; j += STRIP)
        solve_strip(k, U, X + j, ldx);
    for (; j < n; j++)
        solve_column(k, U, X + j, ldx);
}
