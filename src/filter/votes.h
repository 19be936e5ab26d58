// SPDX-License-Identifier: MIT
/*
 * Which are right where twists and pictures contradict each other: did the wheels slip, or do most
 * points move? A few points at a time are followed over many frames under both motions. One that
 * stands fits the true motion, one that moves fits the motion in which it seems to stand. Where a
 * share of the points fits the twists, and the pictures' motion does not explain those, it is the
 * others that move (docs/MATH.md 17). With twists only: an IMU does not slip.
 */
#ifndef PLR_FILTER_VOTES_H
#define PLR_FILTER_VOTES_H

#include <stdbool.h>

#include "filter/correction.h"
#include "state/motion.h"

/* No point asked, nothing counted. */
void plr_votes_clear(plr_filter *f);

/* The pose has become known from elsewhere: what the pictures moved it by before is no error. Points
 * are followed from frame to frame, and begin anew, for the motion up to now has been applied. */
void plr_votes_keep_pose(plr_filter *f);

/* Asks the points of a frame that has been applied; after plr_consistency_add, whose arguments
 * believed, applied and moved it shares. If they say that the twists are right, the pose goes back to
 * where these have put it since the contradiction began, totals.widened counts it, and the result is
 * true. */
bool plr_votes_add(plr_filter *f, const plr_frame *frame, unsigned n,
                   const plr_applied_motion *believed, const plr_applied_motion *applied,
                   const plr_correction *correction, const plr_real moved[PLR_POSE_DIM]);

/* True if points have said lately that the twists are right: then no majority contradicts them. */
bool plr_votes_trust_twists(const plr_filter *f);

#endif
