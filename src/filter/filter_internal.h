// SPDX-License-Identifier: MIT
/* Constants and functions that several files of the filter use; not for callers. */
#ifndef PLR_FILTER_INTERNAL_H
#define PLR_FILTER_INTERNAL_H

#include <stdbool.h>

#include "pelorus/filter.h"

/* plr_filter.magic of an initialised filter. */
#define PLR_FILTER_MAGIC 0x504C5231U

/* Larger inputs are refused: they are errors of the sender, and products of them overflow in
 * float32. */
#define PLR_MAX_POSITION 1e9  /* m */
#define PLR_MAX_BIAS     1e4  /* m/s, rad/s */
#define PLR_MAX_VARIANCE 1e12 /* m^2, rad^2, ... */

/* Forgets the last twist reading: the body is assumed to stand still, reading - bias = 0. */
void plr_filter_forget_reading(plr_filter *f);

/* The biases' covariance becomes a diagonal, uncorrelated with the rest. Only without landmarks. */
void plr_filter_begin_bias(plr_filter *f, const double variance[PLR_BIAS_DIM]);

/* With an IMU: the velocity's covariance becomes that of an unknown one, likewise. */
void plr_filter_begin_velocity(plr_filter *f);

/* Counts a refused call in the totals, and returns its status. */
plr_status plr_filter_refuse(plr_filter *f, plr_status status);

/* Stores the pose's covariance after a good frame, for plr_filter_recover. */
void plr_filter_store_for_recovery(plr_filter *f);

/* Adds the motion that is about to be applied to the stored covariance. */
void plr_filter_propagate_recovery(plr_filter *f);

/* At the present pose: sets its covariance to P, drops the landmarks and the pending motion, takes the
 * velocity for unknown, and doubts the pose until pictures and twists agree. */
void plr_filter_begin_anew(plr_filter *f, const plr_real P[PLR_POSE_SQUARE]);

/* The biases' covariance becomes their prior's, and their mean too if it is more than 4 sigmas from it. Only
 * without landmarks. */
void plr_filter_begin_prior_bias(plr_filter *f);

/* After a divergence: keeps the pose, sets its covariance to the stored one, drops the landmarks,
 * and sets the biases' covariance to their prior's. */
void plr_filter_recover(plr_filter *f);

/* Finite and within the limits, with a covariance that is symmetric and positive. */
bool plr_landmark_is_valid(const plr_landmark *landmark);

/* Checks of what comes in as double. */
bool plr_is_rotation(const double R[9]);
bool plr_is_covariance(const double *P, unsigned n);

#endif
