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

enum { STRIP = PLR_TILE_COLUMNS };

/* x[c] = from[c] - sum_l U(l, i) y_l[c] for a strip of columns, l = 0 .. i-1, y_l = y + sum of the
 * steps before: STRIP numbers that stay in registers. The first step reads `from`, for a copy would
 * cost as much as a few steps. U is k x k, packed upper; i > 0. `down` is what brings y_l to y_l+1:
 * ldx for a dense matrix; 0 where the rows are those of U itself, k - 1, k - 2, ... */
static inline void reduce_strip(unsigned k, const plr_real *restrict U, unsigned i,
                                const plr_real *restrict y, size_t down,
                                const plr_real *restrict from, plr_real *restrict x) {
    const plr_real *u = U + i; /* (0, i), then down the column */
    const plr_real first = -*u;
    plr_real sum[STRIP];
    for (int c = 0; c < STRIP; c++)
        sum[c] = PLR_FMA(first, y[c], from[c]);
    for (size_t step = k - 1; step > k - i; step--) {
        u += step;
        y += down ? down : step;
        const plr_real a = -*u;
        for (int c = 0; c < STRIP; c++)
            sum[c] = PLR_FMA(a, y[c], sum[c]);
    }
    for (int c = 0; c < STRIP; c++)
        x[c] = sum[c];
}

bool plr_cholesky_upper(unsigned n, plr_real *S) {
    for (unsigned i = 0; i < n; i++) {
        plr_real *row = S + plr_upper_row(n, i);
        plr_real inverse = 1;
        for (unsigned j = i; j < n; j += STRIP) {
            plr_real x[STRIP];
            if (i > 0)
                reduce_strip(n, S, i, S + j, 0, row + (j - i), x);
            else
                memcpy(x, row + (j - i), sizeof x);
            if (j == i) {
                if (!(x[0] > 0) || !plr_is_finite(x[0]))
                    return false;
                inverse = PLR_R(1) / PLR_SQRT(x[0]);
            }
            for (int c = 0; c < STRIP; c++)
                x[c] *= inverse;
            memcpy(row + (j - i), x, (n - j < STRIP ? n - j : STRIP) * sizeof *x);
        }
    }
    return true;
}

/* to[c] = a y[c] + from[c] over a strip */
static inline void add_row(plr_real *restrict to, plr_real a, const plr_real *restrict y,
                           const plr_real *restrict from) {
    for (int c = 0; c < STRIP; c++)
        to[c] = PLR_FMA(a, y[c], from[c]);
}

/* to[c] += a y[c] over a strip */
static inline void accumulate_row(plr_real *restrict to, plr_real a, const plr_real *restrict y) {
    for (int c = 0; c < STRIP; c++)
        to[c] = PLR_FMA(a, y[c], to[c]);
}

/* to[c] = a from[c] over a strip */
static inline void scale_row(plr_real *restrict to, plr_real a, const plr_real *restrict from) {
    for (int c = 0; c < STRIP; c++)
        to[c] = a * from[c];
}

/* Rows i > 0 and i + 1 of the solution for STRIP columns: both take the rows above from one reading.
 */
static inline void solve_two_rows(unsigned k, const plr_real *restrict U, unsigned i, plr_real *X,
                                  size_t ldx) {
    plr_real *row0 = X + i * ldx, *row1 = row0 + ldx;
    plr_real x0[STRIP], x1[STRIP];
    const plr_real *u = U + i; /* (0, i) and (0, i + 1), then down both columns */
    const plr_real *y = X;
    add_row(x0, -u[0], y, row0);
    add_row(x1, -u[1], y, row1);
    u += k - 1;
    for (size_t step = k - 2; step > k - 1 - i; step--) {
        y += ldx;
        const plr_real a0 = -u[0], a1 = -u[1];
        accumulate_row(x0, a0, y);
        accumulate_row(x1, a1, y);
        u += step;
    }
    scale_row(row0, PLR_R(1) / u[0], x0);
    accumulate_row(x1, -u[1], row0);
    scale_row(row1, PLR_R(1) / U[plr_upper_row(k, i + 1)], x1);
}

static void solve_strip(unsigned k, const plr_real *U, plr_real *X, size_t ldx) {
    plr_real x[STRIP];
    memcpy(x, X, sizeof x);
    scale_row(X, PLR_R(1) / U[0], x);
    unsigned i = 1;
    for (; i + 1 < k; i += 2)
        solve_two_rows(k, U, i, X, ldx);
    if (i < k) {
        reduce_strip(k, U, i, X, ldx, X + i * ldx, x);
        scale_row(X + i * ldx, PLR_R(1) / U[plr_upper_row(k, i)], x);
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

void plr_combine_rows(unsigned n, unsigned depth, const plr_real *restrict a,
                      const plr_real *restrict X, size_t ldx, plr_real *restrict x) {
    unsigned j = 0;
    for (; depth > 0 && j + STRIP <= n; j += STRIP) {
        const plr_real *restrict row = X + j;
        plr_real *restrict to = x + j;
        plr_real sum[STRIP];
        add_row(sum, a[0], row, to);
        for (unsigned k = 1; k < depth; k++) {
            row += ldx;
            accumulate_row(sum, a[k], row);
        }
        for (int c = 0; c < STRIP; c++)
            to[c] = sum[c];
    }
    for (; j < n; j++)
        for (unsigned k = 0; k < depth; k++)
            x[j] = PLR_FMA(a[k], X[k * ldx + j], x[j]);
}
