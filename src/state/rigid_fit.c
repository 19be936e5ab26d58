// SPDX-License-Identifier: MIT
#include "state/rigid_fit.h"

#include <string.h>

#include "math/dense.h"
#include "math/small.h"

/* s: the weight of the pose's correction beside the landmarks'. Measured: docs/NUMERICS.md 10. */
#define SHARE_OF_POSE PLR_R(0.1)
/* Keeps A regular where no landmark determines it, such as in the roll about a single one's ray. */
#define TINY PLR_R(1e-12)
/* This part of the diagonal is added: rounding is not to decide where all points lie alike. */
#define SMALL_SHARE PLR_R(1e-5)
/* Added to the prior's variances, which may be zero. */
#define SMALLEST_VARIANCE PLR_R(1e-20)

void plr_rigid_fit_add(plr_rigid_fit *fit, const plr_real J[PLR_ROWS * PLR_POSE_DIM],
                       const plr_real w[3], const plr_real W[3]) {
    fit->landmarks++;
    for (unsigned row = 0; row < 3; row++, J += PLR_POSE_DIM) {
        plr_real weighted[PLR_POSE_DIM];
        fit->w2 = PLR_FMA(W[row] * w[row], w[row], fit->w2);
        for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
            weighted[k] = W[row] * J[k];
            fit->b[k] = PLR_FMA(weighted[k], w[row], fit->b[k]);
        }
        plr_upper6_add(fit->A, weighted, J);
    }
}

/* a: the squared rest of the corrections after the best common motion, per degree of freedom,
 * (w2 - b^T A^-1 b) / (3 m - 6), and `most` at most. */
static plr_real scatter(const plr_rigid_fit *fit, plr_real most) {
    plr_real A[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN], y[PLR_POSE_DIM];
    if (fit->landmarks < 3)
        return most;
    memcpy(A, fit->A, sizeof A);
    memcpy(y, fit->b, sizeof y);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        plr_real *diagonal = A + plr_upper_row(PLR_POSE_DIM, k);
        *diagonal += PLR_FMA(SMALL_SHARE, *diagonal, TINY);
    }
    if (!plr_cholesky_upper(PLR_POSE_DIM, A))
        return most;
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, A, y, 1);
    const plr_real freedom = (plr_real)(PLR_ROWS * fit->landmarks - PLR_POSE_DIM);
    const plr_real rest = (fit->w2 - plr_norm2_of_6(y)) / freedom;
    return rest < 0 ? 0 : rest < most ? rest : most;
}

void plr_rigid_fit_solve(plr_rigid_fit *fit, const plr_real xi[PLR_POSE_DIM],
                         const plr_real spread[PLR_POSE_DIM], plr_real noise,
                         plr_real eta[PLR_POSE_DIM]) {
    const plr_real a = scatter(fit, noise);
    memcpy(eta, fit->b, sizeof fit->b);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        plr_real *diagonal = fit->A + plr_upper_row(PLR_POSE_DIM, k);
        const plr_real weight = PLR_FMA(SHARE_OF_POSE, *diagonal, TINY);
        eta[k] = PLR_FMA(weight, xi[k], eta[k]);
        *diagonal += weight + a / (spread[k] + SMALLEST_VARIANCE);
    }
    if (fit->landmarks > 0 && plr_cholesky_upper(PLR_POSE_DIM, fit->A)) {
        plr_solve_upper_transposed(PLR_POSE_DIM, 1, fit->A, eta, 1);
        plr_solve_upper(PLR_POSE_DIM, fit->A, eta);
        if (plr_dot3(eta + 3, eta + 3) < PLR_MAX_CORRECTION_TURN2)
            return;
    }
    memcpy(eta, xi, PLR_POSE_DIM * sizeof *eta);
}
