// SPDX-License-Identifier: MIT
/*
 * Motion first: how the body moved since the last frame, told by all matched observations together,
 * before any of them enters the state (docs/MATH.md 10). Each landmark stands in with its own 3x3
 * covariance; the answer is where the update linearises, and what the gate judges by.
 */
#ifndef PLR_FILTER_MOTION_FIRST_H
#define PLR_FILTER_MOTION_FIRST_H

#include "filter/motion.h"
#include "pelorus/state.h"

/* What the observations said of the motion D Exp(L nu), nu ~ N(0, I). */
typedef struct plr_motion_first {
    plr_applied_motion motion; /* at the nu that was found, or at 0 */
    bool found;                /* false: too few observations, or no better than the twists */
    bool
        contradicted; /* the observations agree on a motion that the twists exclude: `motion` has their
                          word, with a prior wide enough for it */
} plr_motion_first;

/* Finds nu, and judges every matched observation there: work.gain[k] >= 0 of those accepted, -1 of
 * those rejected. Adds d^2 of the accepted ones to *nis. Landmarks and P stand before the motion. */
void plr_motion_find(plr_filter *f, const plr_frame *frame, unsigned n, plr_motion_first *first,
                     float *nis);

#endif
