// SPDX-License-Identifier: MIT
/*
 * Finds numbers that no sensor measures. A speed of 1e30 m/s is finite, and a filter that used it
 * could never continue. A message with a number beyond one of these limits is refused with
 * PLR_E_RANGE:
 *
 *     speed, and its bias          1e4 m/s
 *     turn rate, and its bias      1e3 rad/s
 *     position                     1e9 m
 *     variance, covariance         1e12, in any unit
 *
 * NaN and infinity are within the limits here, because the filter refuses them with a status of
 * their own.
 */
#ifndef PLR_SESSION_PLAUSIBLE_H
#define PLR_SESSION_PLAUSIBLE_H

#include "pelorus/wire.h"

/* A TWIST; a START's pose and, where it is given, its covariance; a LANDMARK; the value of a READING.
 * Of other kinds true. */
bool plr_plausible_message(const plr_message *message);

bool plr_plausible_pose(const plr_pose *pose);

/* A START's bias prior. */
bool plr_plausible_bias(const plr_start *start);

/* True if all n numbers are finite. */
bool plr_plausible_finite(const double *x, unsigned n);

bool plr_plausible_variance(const double *variance, unsigned n);

#endif
