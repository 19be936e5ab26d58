// SPDX-License-Identifier: MIT
/* Times of the filter's frames. */
#ifndef PELORUS_BENCH_TIMING_H
#define PELORUS_BENCH_TIMING_H

#include <stdbool.h>

#include "pelorus/pelorus.h"

enum { MAX_RUNS = 4000, MIN_RUNS = 9, WARM_UP = 3 };

typedef struct timing {
    double us[MAX_RUNS];
    unsigned count;
    double total_us;
} timing;

double now_us(void);

/* True while there are fewer runs than MIN_RUNS, or neither their number nor the budget is used up. */
bool wants_more(const timing *t, double budget_us);

void add_run(timing *t, double us);

/* Sorts the times; the share-th of them. */
double quantile(timing *t, double share);

/* The filter at N landmarks: frames, each with the last step before it, into *frames; that step
 * alone, a twist or a reading of an IMU, into *steps. With a budget of 0 it is always the same frames. */
bool time_filter(unsigned n, plr_process_kind process, double budget_us, timing *frames,
                 timing *steps);

#endif
