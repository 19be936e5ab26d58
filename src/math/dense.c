// SPDX-License-Identifier: MIT
#include "math/dense.h"

#include <string.h>

#include "math/small.h"
#include "math/tile.h"

/* S = B P B^T, B 6 x m with leading dimension ldb. Inlined for each m: constants are faster. */
static inline void sandwich(plr_real S[PLR_POSE_SQUARE], unsigned m, const plr_real *B, size_t ldb,
                            const plr_real *P) {
    plr_real BP[PLR_MOTION_BY] = {0};
    plr_gemm_nn(PLR_POSE_DIM, m, m, B, ldb, P, m, BP, ldb);
    memset(S, 0, PLR_POSE_SQUARE * sizeof *S);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++) {
        plr_gemm_nt(1, i + 1, m, BP + ldb * i, ldb, B, ldb, S + PLR_POSE_DIM * i, PLR_POSE_DIM);
        for (unsigned j = 0; j < i; j++)
            S[PLR_POSE_DIM * j + i] = S[PLR_POSE_DIM * i + j];
    }
}

void plr_sandwich6(plr_real S[36], const plr_real A[36], const plr_real P[36]) {
    sandwich(S, PLR_POSE_DIM, A, PLR_POSE_DIM, P);
}

void plr_sandwich_drivers(plr_real S[PLR_POSE_SQUARE], unsigned m, const plr_real B[PLR_MOTION_BY],
                          const plr_real *P) {
    if (m == PLR_BIAS_DIM)
        sandwich(S, PLR_BIAS_DIM, B, PLR_DRIVERS, P);
    else if (m == PLR_DRIVERS)
        sandwich(S, PLR_DRIVERS, B, PLR_DRIVERS, P);
    else
        sandwich(S, m, B, PLR_DRIVERS, P);
}

enum { STRIP = PLR_TILE_COLUMNS, EIGHT = 8, FOUR = 4, FEW = 3 };

/* x[c] = from[c] - sum_l U(l, i) y_l[c] for a strip of columns, l = 0 .. i-1, y_l = y + sum of the
 * steps before: STRIP numbers that stay in registers. The first step reads `from`, for a copy would
 * cost as much as a few steps. U is k x k, packed upper; i > 0. `down` is what brings y_l to y_l+1:
 * ldx for a dense matrix; 0 where the rows are those of U itself, k - 1, k - 2, ... */
static inline void reduce_strip(unsigned k, const plr_real *restrict U, unsigned i,
                                const plr_real *restrict y, size_t down,
                                const plr_real *restrict from, plr_real *restrict x) {
    PLR_ASSERT(i > 0 && i < k);
    const plr_real *u = U + i; /* (0, i), then down the column */
    plr_real sum[STRIP];
    plr_tile_less(sum, *u, y, from);
    for (size_t step = k - 1; step > k - i; step--) {
        u += step;
        y += down ? down : step;
        plr_tile_reduce(sum, *u, y);
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
            for (unsigned c = 0; c < STRIP && j + c < n; c++)
                row[j - i + c] = x[c] * inverse;
        }
    }
    return true;
}

/* Rows i .. i + 3 of the solution for STRIP columns, where the rows above have been solved. */
static inline void solve_four_rows(unsigned k, const plr_real *U, unsigned i, plr_real *X,
                                   size_t ldx) {
    plr_real *const row[PLR_TILE_ROWS] = {X + i * ldx, X + (i + 1) * ldx, X + (i + 2) * ldx,
                                          X + (i + 3) * ldx};
    if (i > 0) {
        const plr_tile_factors above = {
            .U = U + i, .W = X, .to_next_U = k - 1, .to_next_W = ldx, .shrink = 1};
        plr_real *tile[PLR_TILE_ROWS] = {row[0], row[1], row[2], row[3]};
        plr_tile_subtract(i, above, tile);
    }
    const plr_real *u0 = U + plr_upper_row(k, i), *u1 = u0 + (k - i);
    const plr_real *u2 = u1 + (k - i - 1), *u3 = u2 + (k - i - 2);
    plr_real x0[STRIP], x1[STRIP], x2[STRIP], x3[STRIP];
    plr_tile_scale(x0, PLR_R(1) / u0[0], row[0]);
    plr_tile_less(x1, u0[1], x0, row[1]);
    plr_tile_less(x2, u0[2], x0, row[2]);
    plr_tile_less(x3, u0[3], x0, row[3]);
    for (int c = 0; c < STRIP; c++)
        row[0][c] = x0[c];
    plr_tile_scale(row[1], PLR_R(1) / u1[0], x1);
    plr_tile_reduce(x2, u1[1], row[1]);
    plr_tile_reduce(x3, u1[2], row[1]);
    plr_tile_scale(row[2], PLR_R(1) / u2[0], x2);
    plr_tile_reduce(x3, u2[1], row[2]);
    plr_tile_scale(row[3], PLR_R(1) / u3[0], x3);
}

/* The rows beyond a multiple of four come first. A tile has two rows above it or more. */
static void solve_strip(unsigned k, const plr_real *U, plr_real *X, size_t ldx) {
    enum { ROWS = PLR_TILE_ROWS };
    const unsigned alone = k % ROWS == 1 && k > 1 ? ROWS + 1 : k % ROWS;
    plr_real x[STRIP];
    unsigned i = 0;
    for (; i < alone; i++) {
        plr_real *row = X + i * ldx;
        if (i > 0)
            reduce_strip(k, U, i, X, ldx, row, x);
        else
            memcpy(x, row, sizeof x);
        plr_tile_scale(row, PLR_R(1) / U[plr_upper_row(k, i)], x);
    }
    for (; i < k; i += ROWS)
        solve_four_rows(k, U, i, X, ldx);
}

/* The same for columns that make no strip: row by row, each taken from all below at once, so that no sum
 * waits for the one before it. Inlined for each number of columns. */
static inline void solve_columns(unsigned columns, unsigned k, const plr_real *restrict U,
                                 plr_real *restrict X, size_t ldx) {
    for (unsigned l = 0; l < k; l++, X += ldx) {
        const plr_real inverse = PLR_R(1) / *U++;
        plr_real x[EIGHT], *below = X + ldx;
        for (unsigned c = 0; c < columns; c++)
            X[c] = x[c] = X[c] * inverse;
        for (unsigned i = l + 1; i < k; i++, below += ldx) {
            const plr_real u = *U++;
            for (unsigned c = 0; c < columns; c++)
                below[c] = PLR_FMA(u, -x[c], below[c]);
        }
    }
}

void plr_solve_upper_transposed(unsigned k, unsigned n, const plr_real *U, plr_real *X,
                                size_t ldx) {
    PLR_ASSERT(ldx >= n);
    unsigned j = 0;
    for (; j + STRIP <= n; j += STRIP)
        solve_strip(k, U, X + j, ldx);
    for (; STRIP > EIGHT && j + EIGHT <= n; j += EIGHT)
        solve_columns(EIGHT, k, U, X + j, ldx);
    for (; STRIP > EIGHT && j + FOUR <= n; j += FOUR)
        solve_columns(FOUR, k, U, X + j, ldx);
    for (; j + FEW <= n; j += FEW)
        solve_columns(FEW, k, U, X + j, ldx);
    for (; j < n; j++)
        solve_columns(1, k, U, X + j, ldx);
}

void plr_solve_upper(unsigned k, const plr_real *U, plr_real *x) {
    for (unsigned i = k; i-- > 0;) {
        const plr_real *row = U + plr_upper_row(k, i);
        for (unsigned j = i + 1; j < k; j++)
            x[i] = PLR_FMA(-row[j - i], x[j], x[i]);
        x[i] *= PLR_R(1) / row[0];
    }
}

void plr_combine_rows(unsigned n, unsigned depth, const plr_real *restrict a, size_t lda,
                      const plr_real *restrict X, size_t ldx, plr_real *restrict x) {
    PLR_ASSERT(ldx >= n || depth < 2);
    unsigned j = 0;
    for (; depth > 0 && j + STRIP <= n; j += STRIP) {
        const plr_real *restrict row = X + j;
        plr_real *restrict to = x + j;
        plr_real sum[STRIP];
        const plr_real *restrict factor = a;
        plr_tile_add(sum, *factor, row, to);
        for (unsigned k = 1; k < depth; k++) {
            factor += lda;
            row += ldx;
            plr_tile_accumulate(sum, *factor, row);
        }
        for (int c = 0; c < STRIP; c++)
            to[c] = sum[c];
    }
    for (; j < n; j++)
        for (unsigned k = 0; k < depth; k++)
            x[j] = PLR_FMA(a[k * lda], X[k * ldx + j], x[j]);
}

void plr_subtract_four_rows(unsigned n, unsigned depth, const plr_real *A, size_t lda,
                            const plr_real *V, size_t ldv, plr_real *const X[4]) {
    PLR_ASSERT(depth >= 2 && n % PLR_TILE_COLUMNS == 0);
    PLR_ASSERT(lda >= 4 && ldv >= n);
    plr_real *row[PLR_TILE_ROWS] = {X[0], X[1], X[2], X[3]};
    for (unsigned j = 0; j < n; j += STRIP) {
        const plr_tile_factors factors = {A, V + j, lda, ldv, 0};
        plr_tile_subtract(depth, factors, row);
    }
}

void plr_factor6(plr_real L[PLR_POSE_SQUARE], const plr_real M[PLR_POSE_SQUARE]) {
    memset(L, 0, PLR_POSE_SQUARE * sizeof *L);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        plr_real pivot = M[(PLR_POSE_DIM + 1) * k];
        for (unsigned l = 0; l < k; l++)
            pivot = PLR_FMA(-L[PLR_POSE_DIM * k + l], L[PLR_POSE_DIM * k + l], pivot);
        if (!(pivot > PLR_R(1e-6) * M[(PLR_POSE_DIM + 1) * k]))
            continue;
        const plr_real root = PLR_SQRT(pivot), inverse = PLR_R(1) / root;
        L[(PLR_POSE_DIM + 1) * k] = root;
        for (unsigned i = k + 1; i < PLR_POSE_DIM; i++) {
            plr_real sum = M[PLR_POSE_DIM * i + k];
            for (unsigned l = 0; l < k; l++)
                sum = PLR_FMA(-L[PLR_POSE_DIM * i + l], L[PLR_POSE_DIM * k + l], sum);
            L[PLR_POSE_DIM * i + k] = sum * inverse;
        }
    }
}

void plr_sandwich3(plr_real S[9], plr_real MP[PLR_ROWS * PLR_POSE_DIM],
                   const plr_real M[PLR_ROWS * PLR_POSE_DIM], const plr_real P[PLR_POSE_SQUARE]) {
    for (unsigned i = 0; i < PLR_ROWS * PLR_POSE_DIM; i++)
        MP[i] = 0;
    plr_gemm_nn(PLR_ROWS, PLR_POSE_DIM, PLR_POSE_DIM, M, PLR_POSE_DIM, P, PLR_POSE_DIM, MP,
                PLR_POSE_DIM);
    plr_gemm_nt(PLR_ROWS, PLR_ROWS, PLR_POSE_DIM, MP, PLR_POSE_DIM, M, PLR_POSE_DIM, S, PLR_ROWS);
}
