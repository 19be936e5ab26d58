// SPDX-License-Identifier: MIT
/*
 * Numbers that no sensor gives. What arrives is finite or not, which the filter looks at itself; but
 * a speed of 1e30 m/s is finite, and accepted as a reading it would make every step from there on
 * impossible. Beyond these limits a number is a fault of the sender, and its message is refused
 * with PLR_E_RANGE:
 *
 *     speed, and its bias          1e4 m/s
 *     turn rate, and its bias      1e3 rad/s
 *     position                     1e9 m
 *     variance, covariance         1e12, in any unit
 *
 * What is not finite passes: it is refused further on, for what it is.
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

/* Every one of n numbers is finite. */
bool plr_plausible_finite(const double *x, unsigned n);

bool plr_plausible_variance(const double *variance, unsigned n);

#endif
