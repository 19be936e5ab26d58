// SPDX-License-Identifier: MIT
/* Sums and means in which older terms count less. */
#ifndef PLR_MATH_LEAKY_H
#define PLR_MATH_LEAKY_H

#include "pelorus/config.h"

/* The sum with x added, of which `keep` of 0 to 1 stays from term to term: it looks back 1 / (1 - keep) terms. */
static inline plr_real plr_leaky_sum(plr_real sum, plr_real keep, plr_real x) {
    return PLR_FMA(keep, sum, x);
}

/* The mean with x taken in, which gets the share `share` of it: it looks back 1 / share terms. */
static inline plr_real plr_leaky_mean(plr_real mean, plr_real share, plr_real x) {
    return PLR_FMA(share, x - mean, mean);
}

#endif
