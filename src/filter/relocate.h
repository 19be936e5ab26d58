// SPDX-License-Identifier: MIT
/*
 * Finds the pose anew from known landmarks alone. Known landmarks come in by the predicted pose, so where
 * that is wrong by many sigmas they are rejected, and taken up again at the same wrong place. But a stereo
 * frame shows where they lie relative to the camera, and the map where in the world: three of them tell
 * the pose (docs/MATH.md 13).
 */
#ifndef PLR_FILTER_RELOCATE_H
#define PLR_FILTER_RELOCATE_H

#include <stdbool.h>

#include "pelorus/state.h"

/* True in the modes that ask the map source for landmarks, if there is one. */
bool plr_relocate_asks_map(const plr_filter *f);

/* Counts the successive frames that rejected nearly all known landmarks in sight. Call it after the
 * gate. `unplaced`: known landmarks in sight that could not be taken up at the predicted pose. */
void plr_relocate_watch(plr_filter *f, unsigned n, unsigned unplaced);

/* Lost: after each ten frames of plr_relocate_watch. If the known landmarks of this frame tell a pose, and
 * at least four of them and three fifths of those in sight agree on it, begins anew at that pose with
 * these landmarks and returns true; the others come in with the next frame. P is ten sigmas wide then,
 * which the update with this frame takes back. Works in work.Vt. */
bool plr_relocate_when_lost(plr_filter *f, const plr_frame *frame, unsigned n);

typedef enum plr_relocation {
    PLR_PLACED,    /* nothing was changed */
    PLR_MOVED,     /* known landmarks have been dropped, and are to come in again */
    PLR_MOVED_FAR, /* the same, and the pose was further off than its covariance says */
    PLR_BEGUN_ANEW /* as plr_relocate_when_lost */
} plr_relocation;

/* Uncertain: four known landmarks in sight have come in at a pose, or been moved by a motion, that is so uncertain
 * that what is seen of them is not linear in its error. The estimate moves to the pose that the frame
 * tells, so that they are linearised there; P stays as uncertain as it was, and the frame is used as any
 * other. Only where the frame tells more along each axis than was known. Works in work.Vt. */
plr_relocation plr_relocate_when_uncertain(plr_filter *f, const plr_frame *frame, unsigned n);

/* The pose's covariance has been enlarged by C. The known landmarks would not take that back, for they have told
 * the pose once. Where C is so much that their direction is not linear in it, lets go of them: they come
 * in again with the next frame. (Where it is little, they would tell the pose the same thing twice.) */
void plr_relocate_let_go(plr_filter *f, const plr_real C[PLR_POSE_SQUARE]);

#endif
