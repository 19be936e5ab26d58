// SPDX-License-Identifier: MIT
/*
 * How a frame's motion is found in the dense filter, before the frame's observations enter it
 * (docs/MATH.md 10): the least of |z|^2 + sum rho(|residual|^2) over the motions D Exp(L z), by
 * Levenberg and Marquardt, with each landmark's own covariance. In double and in errors of points; an
 * observation is left out by adding up all the others.
 */
#ifndef PELORUS_TEST_DENSE_FIRST_H
#define PELORUS_TEST_DENSE_FIRST_H

#include "support/dense_ekf.h"

/* Where a frame is linearised, and what it thinks of its observations. */
typedef struct dense_first {
    double L[36];             /* the motion's prior: n = L nu, nu ~ N(0, I), 6x6 lower triangle */
    double z[6];              /* nu at which the frame is linearised */
    double closer[DENSE_MAX]; /* by how much each landmark's inverse range is changed before, 1/m */
    bool judged;              /* d2 is filled */
    unsigned accepted;
    double d2[DENSE_MAX]; /* by landmark, without what the rows of an image differ by */
} dense_first;

/* L L^T = the covariance of the pending motion, with the small part of the biases' effect that is
 * charged as noise besides (docs/MATH.md 10). Columns that are zero to rounding are zero. */
void dense_motion_prior(const dense_ekf *e, double L[36]);

/* Fills all but L from the frame's observations of landmarks that are not yet moved. */
void dense_find_motion(const dense_ekf *e, const plr_frame *frame, dense_first *first);

#endif
