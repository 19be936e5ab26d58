// SPDX-License-Identifier: MIT
/*
 * The rigid motion that a frame's corrections of the landmarks have in common: the twist eta =
 * (rho, theta) of the body that minimises
 *     sum_i |w_i - J_i eta|^2_W + |eta - xi|^2_(s diag A) + a sum_k eta_k^2 / spread_k,
 *     A = sum_i J_i^T W J_i, s = 0.1.
 * w_i: correction of landmark i in its chart; J_i: derivative of the chart by a twist; W: weights
 * of the chart's numbers in the image; a: the variance by which the corrections scatter about a
 * common motion. Where landmarks determine eta poorly, the pose's correction xi does (docs/MATH.md
 * 11).
 */
#ifndef PLR_STATE_RIGID_FIT_H
#define PLR_STATE_RIGID_FIT_H

#include "pelorus/config.h"

/* The largest rotation of a correction that a retraction can apply, squared, rad^2. */
#define PLR_MAX_CORRECTION_TURN2 PLR_R(9)

/* To be begun with zeros. */
typedef struct plr_rigid_fit {
    plr_real A[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN]; /* 6x6, upper triangle packed row by row */
    plr_real b[PLR_POSE_DIM];                          /* sum_i J_i^T W w_i */
    plr_real w2;                                       /* sum_i w_i^T W w_i */
    unsigned landmarks;
} plr_rigid_fit;

/* Adds a landmark: J 3x6, w and the diagonal of W, 3 each. */
void plr_rigid_fit_add(plr_rigid_fit *fit, const plr_real J[PLR_ROWS * PLR_POSE_DIM],
                       const plr_real w[3], const plr_real W[3]);

/* eta, 6: xi if there is no landmark, if A cannot be factorised, or for a turn beyond
 * PLR_MAX_CORRECTION_TURN2. spread: prior variances of eta; noise: most of a. Uses the fit up. */
void plr_rigid_fit_solve(plr_rigid_fit *fit, const plr_real xi[PLR_POSE_DIM],
                         const plr_real spread[PLR_POSE_DIM], plr_real noise,
                         plr_real eta[PLR_POSE_DIM]);

#endif
