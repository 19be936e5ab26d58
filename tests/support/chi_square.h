// SPDX-License-Identifier: MIT
/* What a mean of chi-squares may be if they are that. */
#ifndef PELORUS_TEST_CHI_SQUARE_H
#define PELORUS_TEST_CHI_SQUARE_H

/* Bounds of a chi-square of so many degrees of freedom, divided by them: 99.9 % lie within (Wilson
 * and Hilferty, 1931). */
void chi_square_bounds(unsigned freedom, double *low, double *high);

/* Demands that one which was divided by them lies within. */
void chi_square_demand(const char *what, double per_freedom, unsigned freedom);

#endif
