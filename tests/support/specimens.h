// SPDX-License-Identifier: MIT
/* Filters in the middle of their life, for unit tests: a random pose, landmarks, biases and a random
 * full covariance, without having driven there. */
#ifndef PELORUS_TEST_SPECIMENS_H
#define PELORUS_TEST_SPECIMENS_H

#include <stdbool.h>

#include "filter/gate.h"
#include "pelorus/filter.h"
#include "sensor/measurement.h"
#include "support/random.h"

/* A filter at a random pose a few metres from the origin, 1 s on its clock, with landmarks of ids 1,
 * 2, ... 2 to 30 m in front of the camera, and a positive covariance in which all is correlated.
 * Camera: support/scene.h's. */
void specimen_filter(plr_filter *f, rng *r, plr_model_kind model, bool bias, unsigned landmarks);

/* The same with an IMU, at a few m/s: the rows before the landmarks are (rho, theta, v, b_a, b_g). */
void specimen_imu(plr_filter *f, rng *r, unsigned landmarks);

/* P, dim x dim in double; to be freed. */
double *specimen_covariance(const plr_filter *f);

/* B of a motion by twists, 6x6: the derivative by their biases. */
void specimen_bias_derivative(const plr_motion *motion, double B[36]);

/* A random twist in `motion`: what 0.1 s of driving accumulates, with Q and, if the filter has
 * biases, B. The pose is not moved. */
void specimen_motion(const plr_filter *f, rng *r, plr_motion *motion);

/* The observation that a slot predicts, moved by so many pixels in uL, vL, uR, vR. */
plr_observation specimen_observation(const plr_filter *f, unsigned slot, const float shift_px[4]);

/* The measurement of a slot that the camera can see. */
plr_measurement specimen_measurement(const plr_filter *f, unsigned slot,
                                     const plr_observation *seen);

/* (uL, uR, v) as the filter predicts them, px. */
void specimen_prediction(const plr_filter *f, unsigned slot, plr_real z[3]);

/* The rows in H, 3 x n; what they have no part in stays as it is. */
void specimen_put_rows(double *H, unsigned n, const plr_rows *rows);

/* The gate's verdict of an observation; not accepted if the camera cannot see the slot. */
plr_verdict specimen_judge(const plr_filter *f, unsigned slot, const plr_observation *seen);

/* Jw and Ji of the chart at a point, as the filter has them. */
void specimen_chart(const plr_real x[3], double Jw[9], double Ji[9]);

/* Is the state the same to the bit? Workspace is not looked at, and of the totals only what tells
 * when the filter diverged: a refused call may count itself. */
bool specimen_same_state(const plr_filter *a, const plr_filter *b);

/* Is every number finite that the filter gives, and every status one that its header promises?
 * Applies the accumulated motion. */
bool specimen_gives_finite_numbers(plr_filter *f);

/* n x m zeros in double; to be freed. */
double *specimen_zeros(unsigned n, unsigned m);

/* A[row.., column..] = B, of rows x columns; ld is A's. */
void specimen_put(double *A, unsigned ld, unsigned row, unsigned column, unsigned rows,
                  unsigned columns, const double *B);

/* max |A_ij - B_ij| / sqrt(A_ii A_jj) over n x n. */
double specimen_gap(unsigned n, const double *A, const double *B);

#endif
