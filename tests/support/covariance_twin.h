// SPDX-License-Identifier: MIT
/* A filter's covariance beside a dense matrix in double, over several sizes: what the tests of
 * src/state/covariance.c have in common. */
#ifndef PELORUS_TEST_COVARIANCE_TWIN_H
#define PELORUS_TEST_COVARIANCE_TWIN_H

#include "pelorus/filter.h"
#include "support/random.h"

enum { TWIN_MOST_LANDMARKS = 25 };

typedef struct covariance_twin {
    plr_filter filter;
    rng chance;
    unsigned n;       /* rows of P */
    double *P;        /* n x n, before the operation */
    double *expected; /* n x n, after it: for the check to fill */
    char at[48];      /* which specimen, for messages */
} covariance_twin;

extern covariance_twin twin;

/* Runs a check on 0, 1, 2, 7 and 25 landmarks, without and with biases; `expected` begins as P. */
void twin_for_each_size(void (*check)(void));

/* Demands that the filter's P is `expected`, to so many roundings of each pair of standard
 * deviations. */
void twin_demand_expected(double roundings);

/* Normal numbers for the filter, and the same for the oracle. */
void twin_random(plr_real *out, double *same, unsigned count);

/* n x n ones on the diagonal; to be freed. */
double *twin_identity(void);

#endif
