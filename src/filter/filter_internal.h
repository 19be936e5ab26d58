// SPDX-License-Identifier: MIT
/* What the files of the filter share and no caller sees. */
#ifndef PLR_FILTER_INTERNAL_H
#define PLR_FILTER_INTERNAL_H

#include <stdbool.h>

#include "pelorus/filter.h"

/* In a filter that was initialised. */
#define PLR_FILTER_MAGIC 0x504C5231U

/* Beyond these a number is a fault of its sender, and products of it overflow in float32. */
#define PLR_MAX_POSITION 1e9  /* m */
#define PLR_MAX_BIAS     1e4  /* m/s, rad/s */
#define PLR_MAX_VARIANCE 1e12 /* m^2, rad^2, ... */

/* ns to s, in the filter's precision. */
static inline plr_real plr_seconds(plr_time_ns ns) {
    return (plr_real)((double)ns * 1e-9);
}

/* No reading says anything of now: the body is taken to stand. Reading less bias is 0. */
void plr_filter_forget_reading(plr_filter *f);

/* A refused call in the totals. */
void plr_filter_count_refusal(plr_filter *f, plr_status status);

/* Notes the pose's covariance of a frame that is in order. */
void plr_filter_keep_for_recovery(plr_filter *f);

/* Brings what was noted up to the end of the motion that is about to be applied. */
void plr_filter_carry_recovery(plr_filter *f);

/* After a divergence: the pose stays, with the covariance that it had when all was in order and that of
 * the motion since; landmarks are dropped, biases go back to their prior's covariance. */
void plr_filter_recover(plr_filter *f);

/* Finite and within the limits, with a covariance that is symmetric and positive. */
bool plr_landmark_is_valid(const plr_landmark *landmark);

/* Checks of what comes in as double. */
bool plr_all_finite(const double *x, unsigned n);
bool plr_all_within(const double *x, unsigned n, double limit); /* |x_i| <= limit; false for NaN */
bool plr_is_rotation(const double R[9]);
bool plr_is_covariance(const double *P, unsigned n);

#endif
