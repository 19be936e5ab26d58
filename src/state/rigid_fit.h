// SPDX-License-Identifier: MIT
/*
 * The rigid motion that is common to a frame's corrections of all landmarks: eta, a twist of the
 * body, (rho, theta), that minimises
 *     sum_i |w_i - J_i eta|^2_W + |eta - xi|^2_(s diag A) + a sum_k eta_k^2 / spread_k,
 *     A = sum_i J_i^T W J_i, s = 0.1:
 * w_i are the corrections in their charts, J_i says how a twist enters there, and W weighs the parts
 * as the image shows them. a is what the corrections scatter by about a common motion. Where the
 * landmarks say little, the correction xi of the pose decides, and where none has a voice, xi alone.
 * docs/MATH.md, "Retraction and transport".
 */
#ifndef PLR_STATE_RIGID_FIT_H
#define PLR_STATE_RIGID_FIT_H

#include "pelorus/config.h"

/* A correction that turns further, rad^2, is none that a retraction can follow. */
#define PLR_MAX_CORRECTION_TURN2 PLR_R(9)

typedef struct plr_rigid_fit {
    plr_real A[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN]; /* 6x6, upper triangle packed row by row */
    plr_real b[PLR_POSE_DIM];                          /* sum_i J_i^T W w_i */
    plr_real w2;                                       /* sum_i w_i^T W w_i */
    unsigned voices;
} plr_rigid_fit;

void plr_rigid_fit_clear(plr_rigid_fit *fit);

/* A landmark: J 3x6, w and the diagonal of W, 3 each. */
void plr_rigid_fit_add(plr_rigid_fit *fit, const plr_real J[PLR_ROWS * PLR_POSE_DIM],
                       const plr_real w[3], const plr_real W[3]);

/* eta, 6; xi itself if no landmark has a voice, if A cannot be factorised, or if eta turns by more than a
 * correction may. `noise` is the most that a can be. Spends the fit. */
void plr_rigid_fit_solve(plr_rigid_fit *fit, const plr_real xi[PLR_POSE_DIM],
                         const plr_real spread[PLR_POSE_DIM], plr_real noise,
                         plr_real eta[PLR_POSE_DIM]);

#endif
