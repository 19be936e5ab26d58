// SPDX-License-Identifier: MIT
#include "state/sensitivity.h"

#include <string.h>

#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "pelorus/assertions.h"
#include "state/blocks.h"
#include "state/calibration.h"

/* ---------------------------------------------------------------- as P changes */

void plr_sensitivity_clear(plr_belief *belief, unsigned row, unsigned rows) {
    PLR_ASSERT(row + rows <= PLR_MAX_LD && belief->layout.errors <= PLR_CALIBRATIONS);
    for (unsigned k = 0; k < belief->layout.errors; k++)
        memset(belief->S[k] + row, 0, rows * sizeof *belief->S[k]);
}

void plr_sensitivity_append(plr_belief *belief, unsigned row, const plr_new_landmark *landmark) {
    const unsigned pose = plr_row_of(belief, PLR_BLOCK_POSE);
    for (unsigned k = 0; k < belief->layout.errors; k++) {
        plr_real *S = belief->S[k];
        for (unsigned i = 0; i < PLR_LANDMARK_DIM; i++) {
            S[row + i] = landmark->by_calibration[k][i];
            for (unsigned c = 0; landmark->uses_pose && c < PLR_POSE_DIM; c++)
                S[row + i] =
                    PLR_FMA(landmark->J_pose[PLR_POSE_DIM * i + c], S[pose + c], S[row + i]);
        }
    }
}

void plr_sensitivity_remove(plr_belief *belief, unsigned to, unsigned from) {
    PLR_ASSERT(to <= from);
    for (unsigned k = 0; k < belief->layout.errors; k++)
        memcpy(belief->S[k] + to, belief->S[k] + from, PLR_LANDMARK_DIM * sizeof *belief->S[k]);
}

void plr_sensitivity_turn_pose(plr_belief *belief, const plr_real A[PLR_POSE_SQUARE]) {
    for (unsigned k = 0; k < belief->layout.errors; k++) {
        plr_real *S_xi = belief->S[k] + plr_row_of(belief, PLR_BLOCK_POSE), turned[PLR_POSE_DIM];
        plr_mat6_vec(turned, A, S_xi);
        memcpy(S_xi, turned, sizeof turned);
    }
}

void plr_sensitivity_turn_landmark(plr_belief *belief, unsigned slot, const plr_real F[9]) {
    PLR_ASSERT(slot < belief->count);
    for (unsigned k = 0; k < belief->layout.errors; k++) {
        plr_real *S = belief->S[k] + plr_covariance_row(belief, slot), turned[PLR_LANDMARK_DIM];
        plr_mat3_vec(turned, F, S);
        memcpy(S, turned, sizeof turned);
    }
}

void plr_sensitivity_move_range(plr_belief *belief, const plr_camera_model *camera, unsigned slot,
                                plr_real ratio) {
    PLR_ASSERT(slot < belief->count);
    PLR_ASSERT(camera->errors.count == belief->layout.errors);
    for (unsigned k = 0; k < belief->layout.errors; k++) {
        const unsigned kind = camera->errors.kind[k];
        const bool is_way = kind >= PLR_CAMERA_PLACE_X &&
                            kind <= PLR_CAMERA_CLOCK; /* it moves a point by its inverse range */
        plr_real *w = belief->S[k] + plr_covariance_row(belief, slot);
        if (k >= plr_calibration_estimated(&camera->errors) && !is_way)
            continue;
        w[2] *= is_way ? ratio * ratio : ratio;
        for (unsigned i = 0; i < 2 && is_way && kind != PLR_CAMERA_CLOCK; i++)
            w[i] *= ratio;
    }
}

/* out = X S_d, rows x drivers, PLR_DRIVERS between the rows of X. */
static void by_drivers(const plr_belief *belief, unsigned parameter, unsigned rows,
                       const plr_real *X, plr_real *out) {
    PLR_ASSERT(parameter < belief->layout.errors);
    const plr_real *S_d = belief->S[parameter] + belief->layout.driver;
    for (unsigned r = 0; r < rows; r++, X += PLR_DRIVERS) {
        out[r] = 0;
        for (unsigned d = 0; d < belief->layout.drivers; d++)
            out[r] = PLR_FMA(X[d], S_d[d], out[r]);
    }
}

static void set_velocity(plr_belief *belief, unsigned parameter,
                         const plr_real v[PLR_VELOCITY_DIM]) {
    PLR_ASSERT(plr_has_block(belief, PLR_BLOCK_VELOCITY));
    memcpy(belief->S[parameter] + plr_row_of(belief, PLR_BLOCK_VELOCITY), v,
           PLR_VELOCITY_DIM * sizeof *v);
}

/* S_k += sum over r of a_r X_r, X 6 x dim */
static void combine(plr_belief *belief, unsigned parameter, const plr_real a[PLR_POSE_DIM],
                    const plr_real *X, size_t ld) {
    PLR_ASSERT(parameter < belief->layout.errors);
    plr_combine_rows(plr_covariance_dim(belief), PLR_POSE_DIM, a, 1, X, ld, belief->S[parameter]);
}

void plr_sensitivity_carry_velocity(plr_belief *belief, const plr_real *V) {
    for (unsigned k = 0; k < belief->layout.errors; k++) {
        plr_real v[PLR_VELOCITY_DIM];
        by_drivers(belief, k, PLR_VELOCITY_DIM, V, v);
        set_velocity(belief, k, v);
    }
}

void plr_sensitivity_move(plr_belief *belief, const plr_real K[PLR_MOTION_BY], const plr_real *V,
                          const plr_real *Wt, size_t ld) {
    for (unsigned k = 0; k < belief->layout.errors; k++) {
        plr_real nu[PLR_POSE_DIM], v[PLR_VELOCITY_DIM];
        by_drivers(belief, k, PLR_POSE_DIM, K, nu);
        by_drivers(belief, k, V ? PLR_VELOCITY_DIM : 0, V, v);
        combine(belief, k, nu, Wt, ld);
        if (V)
            set_velocity(belief, k, v);
    }
}

void plr_sensitivity_close_noise(plr_belief *belief, plr_noise *noise, const plr_real *Xt,
                                 size_t ld) {
    for (unsigned k = 0; k < belief->layout.errors; k++) {
        plr_solve_upper_transposed(PLR_POSE_DIM, 1, noise->Lambda, noise->eta_of_S[k], 1);
        combine(belief, k, noise->eta_of_S[k], Xt, ld);
    }
}

void plr_sensitivity_move_pose(plr_belief *belief, const plr_real B[PLR_MOTION_BY]) {
    for (unsigned k = 0; k < belief->layout.errors; k++) {
        plr_real *S_xi = belief->S[k] + plr_row_of(belief, PLR_BLOCK_POSE), n[PLR_POSE_DIM];
        by_drivers(belief, k, PLR_POSE_DIM, B, n);
        for (unsigned i = 0; i < PLR_POSE_DIM; i++)
            S_xi[i] += n[i];
    }
}

/* ---------------------------------------------------------------- what is told */

/* A linear function of the state, of at most six numbers, by each error. */
typedef plr_real plr_by_error[PLR_CALIBRATIONS][PLR_POSE_DIM];

/* C (n x n) += y Sigma y^T, Sigma = G D G^T the covariance of the errors. */
static void add_told(const plr_camera_model *camera, unsigned n, plr_by_error y, plr_real *C) {
    PLR_ASSERT(n <= PLR_POSE_DIM && camera->errors.estimated <= camera->errors.count);
    const plr_error_columns *errors = &camera->errors;
    for (unsigned k = 0; k < errors->count; k++) {
        const plr_real *G = camera->estimate.factor + PLR_CALIBRATIONS * k;
        const plr_real variance = errors->variance[k] * camera->estimate.told[k];
        plr_real s[PLR_POSE_DIM];
        memcpy(s, y[k], sizeof s);
        for (unsigned j = 0; j < k && j < plr_calibration_estimated(errors); j++)
            for (unsigned i = 0; i < n; i++)
                s[i] = PLR_FMA(G[j], y[j][i], s[i]);
        for (unsigned i = 0; i < n; i++)
            for (unsigned j = 0; j < n; j++)
                C[n * i + j] = PLR_FMA(variance * s[i], s[j], C[n * i + j]);
    }
}

void plr_sensitivity_add_to(const plr_belief *belief, const plr_camera_model *camera, unsigned row,
                            unsigned rows, plr_real *C) {
    PLR_ASSERT(rows <= PLR_POSE_DIM && camera->errors.count == belief->layout.errors);
    plr_by_error y;
    for (unsigned k = 0; k < belief->layout.errors; k++)
        memcpy(y[k], belief->S[k] + row, rows * sizeof **y);
    add_told(camera, rows, y, C);
}

void plr_sensitivity_add_to_pose(const plr_belief *belief, const plr_camera_model *camera,
                                 const plr_motion *motion, plr_real P_xi[PLR_POSE_SQUARE]) {
    plr_real A[PLR_POSE_SQUARE], R[9], n[PLR_POSE_DIM];
    plr_by_error y;
    plr_se3_rotation(R, motion->E);
    plr_se3_adjoint_inverse(A, R, motion->p);
    for (unsigned k = 0; k < belief->layout.errors; k++) {
        plr_mat6_vec(y[k], A, belief->S[k] + plr_row_of(belief, PLR_BLOCK_POSE));
        by_drivers(belief, k, PLR_POSE_DIM, motion->B, n);
        for (unsigned i = 0; i < PLR_POSE_DIM; i++)
            y[k][i] += n[i];
    }
    add_told(camera, PLR_POSE_DIM, y, P_xi);
}

void plr_sensitivity_add_to_velocity(const plr_belief *belief, const plr_camera_model *camera,
                                     const plr_motion *motion, plr_real P_u[PLR_POSE_SQUARE]) {
    const unsigned bias = plr_row_of(belief, PLR_BLOCK_BIAS);
    plr_by_error y;
    if (!plr_has_block(belief, PLR_BLOCK_BIAS))
        return;
    for (unsigned k = 0; k < belief->layout.errors; k++) {
        for (unsigned i = 0; i < PLR_POSE_DIM; i++)
            y[k][i] = -belief->S[k][bias + i];         /* reading less bias */
        if (plr_has_block(belief, PLR_BLOCK_VELOCITY)) /* after the motion that is pending */
            by_drivers(belief, k, PLR_VELOCITY_DIM, motion->core.V, y[k]);
    }
    add_told(camera, PLR_POSE_DIM, y, P_u);
}

void plr_sensitivity_add_to_rows(const plr_belief *belief, const plr_camera_model *camera,
                                 const plr_rows *J, const plr_by_wheel *H_s, plr_real C[9]) {
    plr_by_error y;
    for (unsigned k = 0; k < belief->layout.errors; k++) {
        const unsigned kind = camera->errors.kind[k];
        plr_rows_apply(J, belief->S[k], y[k]);
        for (unsigned i = 0; H_s && kind >= PLR_WHEEL_SCALE && i < PLR_ROWS; i++)
            y[k][i] += H_s->error[kind - PLR_WHEEL_SCALE][i];
    }
    add_told(camera, PLR_ROWS, y, C);
}

bool plr_sensitivity_is_finite(const plr_belief *belief) {
    for (unsigned k = 0; k < belief->layout.errors; k++)
        for (unsigned i = 0; i < plr_core_dim(belief); i++)
            if (!plr_is_finite(belief->S[k][i]))
                return false;
    return true;
}
