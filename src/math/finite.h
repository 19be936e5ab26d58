// SPDX-License-Identifier: MIT
/* Checks that doubles are numbers: not NaN, not infinite, not beyond a limit. */
#ifndef PLR_MATH_FINITE_H
#define PLR_MATH_FINITE_H

#include <stdbool.h>

/* True if none of them is NaN or infinite. */
bool plr_all_finite(const double *x, unsigned n);

/* True if |x_i| <= limit for all of them; false for NaN. */
bool plr_all_within(const double *x, unsigned n, double limit);

#endif
