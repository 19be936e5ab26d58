// SPDX-License-Identifier: MIT
/*
 * The covariance P of the whole state: the blocks of plr_layout, then three rows a landmark, as a
 * packed lower triangle. No file outside src/state reads or writes an element of it.
 */
#ifndef PLR_STATE_COVARIANCE_H
#define PLR_STATE_COVARIANCE_H

#include <stdbool.h>

#include "pelorus/belief.h"
#include "pelorus/camera.h"
#include "pelorus/workspace.h"
#include "state/blocks.h"
#include "state/model.h"
#include "state/motion.h"
#include "state/rows.h"

/* --- blocks --- */

/* Sets a block to P_own (the lower triangle), uncorrelated with all others. Without landmarks. */
void plr_covariance_begin(plr_belief *belief, plr_block_id block, const double *P_own);

/* The same with a diagonal. */
void plr_covariance_begin_diagonal(plr_belief *belief, plr_block_id block, const double *variance);

/* Sets the part between two blocks, row by row; the one of the rows comes later in the state. */
void plr_covariance_set(plr_belief *belief, plr_block_id rows, plr_block_id columns,
                        const plr_real *P);

/* Sets a block's variances and makes it uncorrelated with all others, landmarks too. */
void plr_covariance_forget(plr_belief *belief, plr_block_id block, const plr_real *variance);

/* A block's own covariance += C, size x size and symmetric. */
void plr_covariance_add(plr_belief *belief, plr_block_id block, const plr_real *C);

/* The same for its variances alone. */
void plr_covariance_add_variance(plr_belief *belief, plr_block_id block, const plr_real *variance);

/* The part of P between two blocks, row by row. */
void plr_covariance_get(const plr_belief *belief, plr_block_id rows, plr_block_id columns,
                        plr_real *P);

/* P between `rows` rows, from `row` on, and the drivers (plr_layout), rows x drivers. */
void plr_covariance_with_drivers(const plr_belief *belief, unsigned row, unsigned rows,
                                 plr_real *P);

/* g = P_xp P_pp^-1 xi, of all rows x, with p the pose and xi exactly in its rows; P += g g^T.
 * False, and nothing is changed, if P_pp cannot be factorised. */
bool plr_covariance_shift(plr_belief *belief, const plr_real xi[PLR_POSE_DIM], plr_real *g);

/* A landmark's own block += C, 3x3 and symmetric. */
void plr_covariance_add_to_landmark(plr_belief *belief, unsigned slot, const plr_real C[9]);

/* A landmark's own block, 3x3. */
void plr_covariance_landmark(const plr_belief *belief, unsigned slot, plr_real P_ll[9]);

/* The variance of a landmark's third number: in `body` its inverse range. */
plr_real plr_covariance_of_range(const plr_belief *belief, unsigned slot);

double plr_covariance_trace(const plr_belief *belief);

/* Elements of P with that many landmarks; those of fewer are the first of those of more. */
size_t plr_covariance_size(const plr_belief *belief, unsigned landmarks);

/* The elements themselves, for a checksum or a saved state. */
const plr_real *plr_covariance_elements(const plr_belief *belief);

/* False if a variance is negative or not finite. */
bool plr_covariance_is_positive(const plr_belief *belief);

/* --- motion --- */

/* P <- T P T^T with T = diag(A, I, F_0, F_1, ...): A 6x6, F 3x3 a landmark, back to back; the sensitivity of the
 * landmarks is the caller's. F may
 * stand at the beginning of work.Vt; the next 21 numbers a landmark there are used. */
void plr_covariance_transport(plr_belief *belief, plr_real *Vt, const plr_real A[PLR_POSE_SQUARE],
                              const plr_real *F);

/* The pose's rows alone: xi <- A xi. */
void plr_covariance_turn_pose(plr_belief *belief, const plr_real A[PLR_POSE_SQUARE]);

/* Moves the part of P that is correlated with the motion's noise from P to W: with
 * C = P_(:,d) B^T, d the drivers, and nu = L^-1 n,
 *   P -= (C L^-T) (C L^-T)^T,  W += C L^-T,  Lambda = I,  eta = -z,  dx = C L^-T z,
 * so that the state is x + W (nu - z) with x and nu independent. Before the call W^T (6 x dim,
 * leading dimension plr_covariance_ld) must hold the motion's direct effect on the state before it, which P is of
 * but for velocity and biases: they are carried on. */
void plr_covariance_open_noise(plr_belief *belief, const plr_motion *motion, plr_workspace *work,
                               const plr_applied_motion *applied);

/* The reverse, after the observations: with Lambda = U^T U, P += (W U^-1)(W U^-1)^T, dx += W
 * Lambda^-1 eta, and nu (6, or NULL) = z + Lambda^-1 eta. Nothing if none was opened. PLR_E_DIVERGED if
 * Lambda cannot be factorised. */
plr_status plr_covariance_close_noise(plr_belief *belief, const plr_camera_model *camera,
                                      plr_workspace *work, plr_real nu[PLR_POSE_DIM]);

/* V = C L^-T = P_(:,d) Kt (plr_motion_transpose): three rows' covariance with nu, from `row` on. */
void plr_covariance_motion_share(const plr_belief *belief, unsigned row,
                                 const plr_real Kt[PLR_MOTION_BY],
                                 plr_real V[PLR_ROWS * PLR_POSE_DIM]);

/* The pose's rows alone, drivers behind it: xi <- A xi + B x_d + N(0, Q), M = B P_dd B^T + Q. */
void plr_covariance_predict_pose(plr_belief *belief, const plr_real A[PLR_POSE_SQUARE],
                                 const plr_real B[PLR_MOTION_BY],
                                 const plr_real M[PLR_POSE_SQUARE]);

/* Where there is a velocity: its and the biases' own covariance after the motion. */
void plr_covariance_carry_core(plr_belief *belief, const plr_motion *motion);

/* --- update --- */

/* S = H P H^T, 3x3. */
void plr_covariance_of_rows(const plr_belief *belief, const plr_rows *H, plr_real S[9]);

/* S += (H W)(H W)^T, 3x3: the part of H P H^T that is in W. Only before the first batch. */
void plr_covariance_add_open_noise(const plr_belief *belief, const plr_noise *noise,
                                   const plr_rows *H, plr_real S[9]);

/* The three rows of (P H^T)^T, each of dim elements, then zeros up to the leading dimension ld. */
void plr_covariance_project(const plr_belief *belief, const plr_rows *H, plr_real *rows, size_t ld);

/* P -= V V^T, where V^T is depth x dim in the workspace with leading dimension plr_covariance_ld.
 * False, and nothing is changed, if a variance would not be positive. */
bool plr_covariance_subtract(plr_belief *belief, const plr_real *Vt, unsigned depth);

/* P_ii *= 1 + 8 epsilon for the landmarks that a frame saw, more than rounding can have removed:
 * else it adds up while a robot stands still, until P is not positive (docs/NUMERICS.md 1). */
void plr_covariance_make_up_for_rounding(plr_belief *belief);

/* --- slots --- */

/* Appends the rows of slot belief->count (not yet counted): error = J_pose xi + N(0, landmark->P). */
void plr_covariance_append(plr_belief *belief, const plr_new_landmark *landmark);

/* Moves the rows of the last slot into those of `slot`. */
void plr_covariance_remove(plr_belief *belief, unsigned slot);

#endif
