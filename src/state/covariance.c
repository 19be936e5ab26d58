// SPDX-License-Identifier: MIT
#include "state/covariance.h"

#include "pelorus/assertions.h"

#include "math/dense.h"
#include "math/small.h"
#include "state/blocks.h"
#include "state/elements.h"
#include "state/sensitivity.h"

unsigned plr_covariance_row(const plr_filter *f, unsigned slot) {
    return plr_core_dim(f) + PLR_LANDMARK_DIM * slot;
}

unsigned plr_covariance_dim(const plr_filter *f) {
    return plr_covariance_row(f, f->belief.count);
}

unsigned plr_covariance_ld(const plr_filter *f) {
    const unsigned n = plr_covariance_dim(f);
    const unsigned ld = (n + PLR_TILE_COLUMNS - 1) / PLR_TILE_COLUMNS * PLR_TILE_COLUMNS;
    PLR_ASSERT(ld <= PLR_MAX_LD);
    return ld;
}

/* ---------------------------------------------------------------- blocks */

PLR_SELDOM void plr_covariance_begin(plr_filter *f, plr_block_id block, const double *P_own) {
    const unsigned row = plr_row_of(f, block), size = plr_block_size(f, block);
    plr_sensitivity_clear(f, row, size);
    for (unsigned i = row; i < plr_core_dim(f); i++)
        for (unsigned j = 0; j <= i; j++) {
            const bool own_row = i < row + size, own_column = j >= row && j < row + size;
            if (own_row && own_column)
                f->belief.P[plr_packed_row(i) + j] = (plr_real)P_own[(i - row) * size + j - row];
            else if (own_row || own_column)
                f->belief.P[plr_packed_row(i) + j] = 0;
        }
}

void plr_covariance_begin_diagonal(plr_filter *f, plr_block_id block, const double *variance) {
    const unsigned size = plr_block_size(f, block);
    double P_own[PLR_WIDEST_BLOCK * PLR_WIDEST_BLOCK] = {0};
    for (unsigned i = 0; i < size; i++)
        P_own[(size + 1) * i] = variance[i];
    plr_covariance_begin(f, block, P_own);
}

PLR_SELDOM void plr_covariance_set(plr_filter *f, plr_block_id rows, plr_block_id columns,
                                   const plr_real *P) {
    PLR_ASSERT(plr_row_of(f, rows) > plr_row_of(f, columns));
    for (unsigned i = 0; i < plr_block_size(f, rows); i++)
        for (unsigned j = 0; j < plr_block_size(f, columns); j++)
            f->belief.P[plr_packed_at(plr_row_of(f, rows) + i, plr_row_of(f, columns) + j)] =
                P[plr_block_size(f, columns) * i + j];
}

PLR_SELDOM bool plr_covariance_shift(plr_filter *f, const plr_real xi[PLR_POSE_DIM], plr_real *g) {
    const unsigned n = plr_covariance_dim(f);
    plr_real P[PLR_POSE_SQUARE], U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN], y[PLR_POSE_DIM];
    plr_covariance_get(f, PLR_BLOCK_POSE, PLR_BLOCK_POSE, P);
    plr_upper6_pack(U, P);
    if (!plr_cholesky_upper(PLR_POSE_DIM, U))
        return false;
    memcpy(y, xi, sizeof y);
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, y, 1);
    plr_solve_upper(PLR_POSE_DIM, U, y);
    memcpy(g, xi, sizeof y);
    for (unsigned i = PLR_POSE_DIM; i < n; i++) {
        g[i] = 0;
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            g[i] = PLR_FMA(f->belief.P[plr_packed_row(i) + k], y[k], g[i]);
    }
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++) {
            plr_real *own = &f->belief.P[plr_packed_row(i) + j];
            *own = PLR_FMA(g[i], g[j], *own);
        }
    return true;
}

PLR_SELDOM void plr_covariance_forget(plr_filter *f, plr_block_id block, const plr_real *variance) {
    const unsigned row = plr_row_of(f, block), n = plr_covariance_dim(f);
    plr_sensitivity_clear(f, row, plr_block_size(f, block));
    for (unsigned i = row; i < row + plr_block_size(f, block); i++) {
        for (unsigned j = 0; j < n; j++)
            f->belief.P[plr_packed_at(i, j)] = 0;
        f->belief.P[plr_packed_at(i, i)] = variance[i - row];
    }
}

void plr_covariance_add(plr_filter *f, plr_block_id block, const plr_real *C) {
    const unsigned row = plr_row_of(f, block), size = plr_block_size(f, block);
    for (unsigned i = 0; i < size; i++)
        for (unsigned j = 0; j <= i; j++)
            f->belief.P[plr_packed_at(row + i, row + j)] += C[size * i + j];
}

void plr_covariance_add_variance(plr_filter *f, plr_block_id block, const plr_real *variance) {
    const unsigned row = plr_row_of(f, block);
    for (unsigned i = row; i < row + plr_block_size(f, block); i++)
        f->belief.P[plr_packed_at(i, i)] += variance[i - row];
}

void plr_covariance_add_to_landmark(plr_filter *f, unsigned slot, const plr_real C[9]) {
    const unsigned row = plr_covariance_row(f, slot);
    for (unsigned i = 0; i < PLR_LANDMARK_DIM; i++)
        for (unsigned j = 0; j <= i; j++)
            f->belief.P[plr_packed_at(row + i, row + j)] += C[PLR_LANDMARK_DIM * i + j];
}

void plr_covariance_get(const plr_filter *f, plr_block_id rows, plr_block_id columns, plr_real *P) {
    plr_get_block(f, plr_row_of(f, rows), plr_block_size(f, rows), plr_row_of(f, columns),
                  plr_block_size(f, columns), P);
}

void plr_covariance_with_drivers(const plr_filter *f, unsigned row, unsigned rows, plr_real *P) {
    plr_get_block(f, row, rows, f->belief.layout.driver, f->belief.layout.drivers, P);
}

void plr_covariance_landmark(const plr_filter *f, unsigned slot, plr_real P_ll[9]) {
    const unsigned s = plr_covariance_row(f, slot);
    plr_get_block(f, s, 3, s, 3, P_ll);
}

plr_real plr_covariance_of_range(const plr_filter *f, unsigned slot) {
    const unsigned row = plr_covariance_row(f, slot) + 2;
    return f->belief.P[plr_packed_at(row, row)];
}

size_t plr_covariance_size(const plr_filter *f, unsigned landmarks) {
    return plr_packed_row(plr_covariance_row(f, landmarks));
}

const plr_real *plr_covariance_elements(const plr_filter *f) {
    return f->belief.P;
}

double plr_covariance_trace(const plr_filter *f) {
    const unsigned n = plr_covariance_dim(f);
    double trace = 0;
    for (unsigned i = 0; i < n; i++)
        trace += (double)f->belief.P[plr_packed_row(i) + i];
    return trace;
}

bool plr_covariance_is_positive(const plr_filter *f) {
    const unsigned n = plr_covariance_dim(f);
    for (unsigned i = 0; i < n; i++) {
        const plr_real variance = f->belief.P[plr_packed_row(i) + i];
        if (!(variance >= 0) || !plr_is_finite(variance))
            return false;
    }
    return true;
}

/* ---------------------------------------------------------------- slots */

PLR_SELDOM void plr_covariance_append(plr_filter *f, const plr_new_landmark *landmark) {
    const unsigned s = plr_covariance_dim(f);
    for (unsigned i = 0; i < 3; i++)
        memset(f->belief.P + plr_packed_row(s + i), 0, (s + i + 1) * sizeof *f->belief.P);
    plr_real own[9];
    memcpy(own, landmark->P, sizeof own);
    if (landmark->uses_pose) {
        const unsigned pose = plr_row_of(f, PLR_BLOCK_POSE);
        const plr_real *J = landmark->J_pose;
        for (unsigned i = 0; i < 3; i++)
            for (unsigned c = 0; c < PLR_POSE_DIM; c++)
                plr_add_column(f, s, pose + c, J[PLR_POSE_DIM * i + c],
                               f->belief.P + plr_packed_row(s + i));
        for (unsigned i = 0; i < 3; i++)
            plr_gemm_nt(1, 3, PLR_POSE_DIM, f->belief.P + plr_packed_row(s + i), PLR_POSE_DIM, J,
                        PLR_POSE_DIM, own + 3 * i, 3);
    }
    plr_set_block(f, s, 3, s, 3, own);
    plr_sensitivity_append(f, s, landmark);
}

PLR_SELDOM void plr_covariance_remove(plr_filter *f, unsigned slot) {
    const unsigned to = plr_covariance_row(f, slot);
    const unsigned from = plr_covariance_row(f, f->belief.count - 1);
    if (to == from)
        return;
    plr_sensitivity_remove(f, to, from);
    plr_real own[9];
    plr_get_block(f, from, 3, from, 3, own);
    for (unsigned i = 0; i < 3; i++)
        memcpy(f->belief.P + plr_packed_row(to + i), f->belief.P + plr_packed_row(from + i),
               to * sizeof *f->belief.P);
    plr_set_block(f, to, 3, to, 3, own);
    for (unsigned i = to + 3; i < from; i++)
        for (unsigned c = 0; c < 3; c++)
            f->belief.P[plr_packed_row(i) + to + c] = f->belief.P[plr_packed_row(from + c) + i];
}
