// SPDX-License-Identifier: MIT
/* What a mean of chi-squares may be if they are that. */
#ifndef PELORUS_TEST_CHI_SQUARE_H
#define PELORUS_TEST_CHI_SQUARE_H

#include <math.h>

/* Bounds of a chi-square of so many degrees of freedom, divided by them: 99.9 % lie within (Wilson
 * and Hilferty, 1931). */
static inline void chi_square_bounds(unsigned freedom, double *low, double *high) {
    const double z = 3.2905, v = 2.0 / (9.0 * freedom);
    *low = pow(1 - v - z * sqrt(v), 3);
    *high = pow(1 - v + z * sqrt(v), 3);
}

#endif
