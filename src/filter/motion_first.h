// SPDX-License-Identifier: MIT
/*
 * Estimates how the body moved since the last frame from all matched observations together, before
 * any of them is applied to the state (docs/MATH.md 10). Of the state's covariance it uses the 3x3
 * block of each landmark. The update is linearised at the result, and the gate compares each
 * observation with it.
 */
#ifndef PLR_FILTER_MOTION_FIRST_H
#define PLR_FILTER_MOTION_FIRST_H

#include "pelorus/state.h"
#include "state/motion.h"

/* The estimate of the motion D Exp(L nu), nu ~ N(0, I). */
typedef struct plr_motion_first {
    plr_applied_motion motion; /* at the nu that was found, or at 0 */
    bool outright;             /* the observations agree on a motion that the twists exclude, and
                                  `motion` is that one, with a prior wide enough for it */
} plr_motion_first;

/* Finds nu and gates every matched observation: verdict, d2 and det_S of its row. Accepted innovations are added
 * to their landmarks' sums, by which one may be found to move; a lost landmark counts as unseen. Call it before
 * the motion is applied to landmarks and P. */
void plr_motion_find(plr_filter *f, plr_sightings *sightings, const plr_picture_decision *decided,
                     plr_motion_first *first);

#endif
