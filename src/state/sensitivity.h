// SPDX-License-Identifier: MIT
/*
 * What errors of the camera's calibration do to the state.
 *
 * Focal length, baseline and T_CB of a real camera are off by a part of a percent or degree. No
 * frame shows it, and being the same in all frames it does not average out as noise does. The
 * state's error is therefore x + S s: x as P says, and s ~ N(0, diag(par.calibrated.variance)) the
 * errors of the calibration. S, a column for each, is carried along beside P through motions and
 * corrections, whose gains take no notice of it, and what is told of covariances contains S Sigma
 * S^T, Sigma the covariance of s: that of the prior, a consider covariance analysis (Tapley, Schutz
 * and Born, Statistical Orbit Determination, chapter 6; docs/MATH.md 20), but for what calibration.h
 * estimates.
 */
#ifndef PLR_STATE_SENSITIVITY_H
#define PLR_STATE_SENSITIVITY_H

#include <stdbool.h>
#include <stddef.h>

#include "pelorus/belief.h"
#include "pelorus/camera.h"
#include "pelorus/workspace.h"
#include "state/model.h"

/* ---------------------------------------------------------------- as P changes */

/* The error of these rows does not depend on the calibration. */
void plr_sensitivity_clear(plr_belief *belief, unsigned row, unsigned rows);

/* A landmark's rows, behind all others: it has been made by the camera, or is known. */
void plr_sensitivity_append(plr_belief *belief, unsigned row, const plr_new_landmark *landmark);

/* Landmark rows `from` become rows `to`. */
void plr_sensitivity_remove(plr_belief *belief, unsigned to, unsigned from);

/* S_xi <- A S_xi, 6x6. */
void plr_sensitivity_turn_pose(plr_belief *belief, const plr_real A[PLR_POSE_SQUARE]);

/* The rows of a landmark <- F (3x3) times them. */
void plr_sensitivity_turn_landmark(plr_belief *belief, unsigned slot, const plr_real F[9]);

/* A landmark is linearised elsewhere on its ray, where its inverse range is `ratio` times what it was:
 * so is its derivative by those errors that are estimated; by a shift of the camera the square of it. Of
 * what has always been considered it stays as it is, to the bit. */
void plr_sensitivity_move_range(plr_belief *belief, const plr_camera_model *camera, unsigned slot,
                                plr_real ratio);

/* The rows of the velocity <- V S_d, of the drivers d. */
void plr_sensitivity_carry_velocity(plr_belief *belief, const plr_real *V);

/* S += W K S_d: the drivers d move the state by n = L K d, and Wt (6 x dim, ld between rows) is
 * what a motion L nu does to it. The velocity's rows, if there are any, <- V S_d. */
void plr_sensitivity_move(plr_belief *belief, const plr_real K[PLR_MOTION_BY], const plr_real *V,
                          const plr_real *Wt, size_t ld);

/* S += X U^-T eta: what a frame says of the motion's noise; Lambda = U^T U, Xt = U^-T W^T. */
void plr_sensitivity_close_noise(plr_belief *belief, plr_noise *noise, const plr_real *Xt,
                                 size_t ld);

/* S_xi += B S_d, where the drivers move the pose alone. */
void plr_sensitivity_move_pose(plr_belief *belief, const plr_real B[PLR_MOTION_BY]);

/* ---------------------------------------------------------------- what is told */

/* C (rows x rows) += S Sigma S^T of `rows` rows from `row` on; at most six. */
void plr_sensitivity_add_to(const plr_belief *belief, const plr_camera_model *camera, unsigned row,
                            unsigned rows, plr_real *C);

/* The same of the pose after the motion that has not been applied yet. */
void plr_sensitivity_add_to_pose(const plr_belief *belief, const plr_camera_model *camera,
                                 const plr_motion *motion, plr_real P_xi[PLR_POSE_SQUARE]);

/* The same of the body's velocity (v, w). */
void plr_sensitivity_add_to_velocity(const plr_belief *belief, const plr_camera_model *camera,
                                     const plr_motion *motion, plr_real P_u[PLR_POSE_SQUARE]);

/* The same of a linear function of the state: C = J P J^T (3x3) gains J S Sigma S^T J^T; with H_s, of a
 * wheel's reading, (J S + H_s) Sigma (J S + H_s)^T. */
void plr_sensitivity_add_to_rows(const plr_belief *belief, const plr_camera_model *camera,
                                 const plr_rows *J, const plr_by_wheel *H_s, plr_real C[9]);

/* False after a correction that went wrong. */
bool plr_sensitivity_is_finite(const plr_belief *belief);

#endif
