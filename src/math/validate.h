// SPDX-License-Identifier: MIT
/* Checks of what comes in as double. */
#ifndef PLR_MATH_VALIDATE_H
#define PLR_MATH_VALIDATE_H

#include <stdbool.h>

#include "pelorus/config.h"

/* Larger inputs are refused: they are errors of the sender, and products of them overflow in float32. */
#define PLR_MAX_POSITION 1e9  /* m */
#define PLR_MAX_BIAS     1e4  /* m/s, rad/s */
#define PLR_MAX_VARIANCE 1e12 /* m^2, rad^2, ... */

/* Orthonormal to 1e-3, and no mirror image. */
bool plr_is_rotation(const double R[9]);

/* Symmetric and positive semidefinite but for rounding; n <= 6. */
bool plr_is_covariance(const double *P, unsigned n);

/* Finite and within the limits, with a covariance that is symmetric and positive. */
bool plr_is_place(const double p[3], const double P[9]);

#endif
