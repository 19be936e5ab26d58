// SPDX-License-Identifier: MIT
#include "state/covariance.h"

#include "pelorus/assertions.h"

#include "math/dense.h"
#include "math/small.h"
#include "state/blocks.h"
#include "state/elements.h"
#include "state/sensitivity.h"

PLR_SELDOM void plr_covariance_begin(plr_belief *belief, plr_block_id block, const double *P_own) {
    const unsigned row = plr_row_of(belief, block), size = plr_block_size(belief, block);
    plr_sensitivity_clear(belief, row, size);
    for (unsigned i = row; i < plr_core_dim(belief); i++)
        for (unsigned j = 0; j <= i; j++) {
            const bool own_row = i < row + size, own_column = j >= row && j < row + size;
            if (own_row && own_column)
                belief->P[plr_packed_row(i) + j] = (plr_real)P_own[(i - row) * size + j - row];
            else if (own_row || own_column)
                belief->P[plr_packed_row(i) + j] = 0;
        }
}

void plr_covariance_begin_diagonal(plr_belief *belief, plr_block_id block, const double *variance) {
    PLR_ASSERT(plr_block_size(belief, block) <= PLR_WIDEST_BLOCK);
    const unsigned size = plr_block_size(belief, block);
    double P_own[PLR_WIDEST_BLOCK * PLR_WIDEST_BLOCK] = {0};
    for (unsigned i = 0; i < size; i++)
        P_own[(size + 1) * i] = variance[i];
    plr_covariance_begin(belief, block, P_own);
}

PLR_SELDOM void plr_covariance_set(plr_belief *belief, plr_block_id rows, plr_block_id columns,
                                   const plr_real *P) {
    PLR_ASSERT(plr_row_of(belief, rows) > plr_row_of(belief, columns));
    for (unsigned i = 0; i < plr_block_size(belief, rows); i++)
        for (unsigned j = 0; j < plr_block_size(belief, columns); j++)
            belief
                ->P[plr_packed_at(plr_row_of(belief, rows) + i, plr_row_of(belief, columns) + j)] =
                P[plr_block_size(belief, columns) * i + j];
}

PLR_SELDOM bool plr_covariance_shift(plr_belief *belief, const plr_real xi[PLR_POSE_DIM],
                                     plr_real *g) {
    const unsigned n = plr_covariance_dim(belief);
    plr_real P[PLR_POSE_SQUARE], U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN], y[PLR_POSE_DIM];
    plr_covariance_get(belief, PLR_BLOCK_POSE, PLR_BLOCK_POSE, P);
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
            g[i] = PLR_FMA(belief->P[plr_packed_row(i) + k], y[k], g[i]);
    }
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++) {
            plr_real *own = &belief->P[plr_packed_row(i) + j];
            *own = PLR_FMA(g[i], g[j], *own);
        }
    return true;
}

PLR_SELDOM void plr_covariance_forget(plr_belief *belief, plr_block_id block,
                                      const plr_real *variance) {
    const unsigned row = plr_row_of(belief, block), n = plr_covariance_dim(belief);
    plr_sensitivity_clear(belief, row, plr_block_size(belief, block));
    for (unsigned i = row; i < row + plr_block_size(belief, block); i++) {
        for (unsigned j = 0; j < n; j++)
            belief->P[plr_packed_at(i, j)] = 0;
        belief->P[plr_packed_at(i, i)] = variance[i - row];
    }
}

void plr_covariance_add(plr_belief *belief, plr_block_id block, const plr_real *C) {
    const unsigned row = plr_row_of(belief, block), size = plr_block_size(belief, block);
    for (unsigned i = 0; i < size; i++)
        for (unsigned j = 0; j <= i; j++)
            belief->P[plr_packed_at(row + i, row + j)] += C[size * i + j];
}

void plr_covariance_add_variance(plr_belief *belief, plr_block_id block, const plr_real *variance) {
    const unsigned row = plr_row_of(belief, block);
    for (unsigned i = row; i < row + plr_block_size(belief, block); i++)
        belief->P[plr_packed_at(i, i)] += variance[i - row];
}

void plr_covariance_add_to_landmark(plr_belief *belief, unsigned slot, const plr_real C[9]) {
    PLR_ASSERT(slot < belief->count);
    const unsigned row = plr_covariance_row(belief, slot);
    for (unsigned i = 0; i < PLR_LANDMARK_DIM; i++)
        for (unsigned j = 0; j <= i; j++)
            belief->P[plr_packed_at(row + i, row + j)] += C[PLR_LANDMARK_DIM * i + j];
}

void plr_covariance_get(const plr_belief *belief, plr_block_id rows, plr_block_id columns,
                        plr_real *P) {
    plr_get_block(belief, plr_row_of(belief, rows), plr_block_size(belief, rows),
                  plr_row_of(belief, columns), plr_block_size(belief, columns), P);
}

void plr_covariance_with_drivers(const plr_belief *belief, unsigned row, unsigned rows,
                                 plr_real *P) {
    PLR_ASSERT(row + rows <= PLR_MAX_LD && belief->layout.drivers <= PLR_DRIVERS);
    plr_get_block(belief, row, rows, belief->layout.driver, belief->layout.drivers, P);
}

void plr_covariance_landmark(const plr_belief *belief, unsigned slot, plr_real P_ll[9]) {
    PLR_ASSERT(slot < belief->count);
    const unsigned s = plr_covariance_row(belief, slot);
    plr_get_block(belief, s, 3, s, 3, P_ll);
}

plr_real plr_covariance_of_range(const plr_belief *belief, unsigned slot) {
    PLR_ASSERT(slot < belief->count);
    const unsigned row = plr_covariance_row(belief, slot) + 2;
    return belief->P[plr_packed_at(row, row)];
}

size_t plr_covariance_size(const plr_belief *belief, unsigned landmarks) {
    PLR_ASSERT(landmarks <= PLR_MAX_LANDMARKS);
    return plr_packed_row(plr_covariance_row(belief, landmarks));
}

const plr_real *plr_covariance_elements(const plr_belief *belief) {
    return belief->P;
}

double plr_covariance_trace(const plr_belief *belief) {
    const unsigned n = plr_covariance_dim(belief);
    double trace = 0;
    for (unsigned i = 0; i < n; i++)
        trace += (double)belief->P[plr_packed_row(i) + i];
    return trace;
}

bool plr_covariance_is_positive(const plr_belief *belief) {
    const unsigned n = plr_covariance_dim(belief);
    for (unsigned i = 0; i < n; i++) {
        const plr_real variance = belief->P[plr_packed_row(i) + i];
        if (!(variance >= 0) || !plr_is_finite(variance))
            return false;
    }
    return true;
}

/* ---------------------------------------------------------------- slots */

PLR_SELDOM void plr_covariance_append(plr_belief *belief, const plr_new_landmark *landmark) {
    PLR_ASSERT(belief->count < PLR_MAX_LANDMARKS);
    const unsigned s = plr_covariance_dim(belief);
    for (unsigned i = 0; i < 3; i++)
        memset(belief->P + plr_packed_row(s + i), 0, (s + i + 1) * sizeof *belief->P);
    plr_real own[9];
    memcpy(own, landmark->P, sizeof own);
    if (landmark->uses_pose) {
        const unsigned pose = plr_row_of(belief, PLR_BLOCK_POSE);
        const plr_real *J = landmark->J_pose;
        for (unsigned i = 0; i < 3; i++)
            for (unsigned c = 0; c < PLR_POSE_DIM; c++)
                plr_add_column(belief, s, pose + c, J[PLR_POSE_DIM * i + c],
                               belief->P + plr_packed_row(s + i));
        for (unsigned i = 0; i < 3; i++)
            plr_gemm_nt(1, 3, PLR_POSE_DIM, belief->P + plr_packed_row(s + i), PLR_POSE_DIM, J,
                        PLR_POSE_DIM, own + 3 * i, 3);
    }
    plr_set_block(belief, s, 3, s, 3, own);
    plr_sensitivity_append(belief, s, landmark);
}

PLR_SELDOM void plr_covariance_remove(plr_belief *belief, unsigned slot) {
    PLR_ASSERT(slot < belief->count);
    const unsigned to = plr_covariance_row(belief, slot);
    const unsigned from = plr_covariance_row(belief, belief->count - 1);
    if (to == from)
        return;
    plr_sensitivity_remove(belief, to, from);
    plr_real own[9];
    plr_get_block(belief, from, 3, from, 3, own);
    for (unsigned i = 0; i < 3; i++)
        memcpy(belief->P + plr_packed_row(to + i), belief->P + plr_packed_row(from + i),
               to * sizeof *belief->P);
    plr_set_block(belief, to, 3, to, 3, own);
    for (unsigned i = to + 3; i < from; i++)
        for (unsigned c = 0; c < 3; c++)
            belief->P[plr_packed_row(i) + to + c] = belief->P[plr_packed_row(from + c) + i];
}
