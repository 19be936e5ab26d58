// SPDX-License-Identifier: MIT
/* The gate's threshold from a probability, and back. */
#ifndef PELORUS_POSIX_GATE_H
#define PELORUS_POSIX_GATE_H

/* The x with P(chi^2 of 4 degrees of freedom <= x) = 1 - (1 + x/2) exp(-x/2) = probability, for a
 * probability above 0 and below 1: 0.95 gives 9.488. */
double gate_threshold(double probability);

/* P(chi^2 of 4 degrees of freedom > x): the share of sound observations that a gate at x >= 0 turns
 * away. */
double gate_excess(double x);

#endif
