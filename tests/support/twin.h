// SPDX-License-Identifier: MIT
/* A filter and the textbook's beside it: what they differ by. */
#ifndef PELORUS_TEST_TWIN_H
#define PELORUS_TEST_TWIN_H

#include <stdbool.h>

#include "pelorus/filter.h"
#include "textbook/textbook.h"

/* The largest differences between textbook and filter. */
typedef struct twin_gap {
    double position_m, rotation_rad, bias;
    double landmark;   /* |x - x'| over its distance */
    double covariance; /* |P_ij - P'_ij| / sqrt(P_ii P_jj), in the textbook's errors */
} twin_gap;

/* Compares after a frame. False if they do not hold the same landmarks, or one has a motion pending and
 * the other has not. */
bool twin_compare(const textbook *t, const plr_filter *f, twin_gap *gap);

/* Demands that, and that they differ by no more than so many roundings, and by `floor` where a number may be
 * zero. */
void twin_demand_same(const textbook *t, const plr_filter *f, double floor, double rounding,
                      const char *at);

/* What the filter adds to the landmarks' variances at the end of a frame (docs/NUMERICS.md 1): a rounding of
 * each, eight of those that it saw, in its own charts. */
void twin_make_up_for_rounding(textbook *t, const plr_frame *frame, double rounding);

/* A filter's pose, camera and settings in a textbook without memory (textbook_stand). */
void twin_of_specimen(textbook *t, const plr_filter *f);

#endif
