// SPDX-License-Identifier: MIT
/* Finds the pose anew from known landmarks alone. Known landmarks come in by the predicted pose,
 * so where that is wrong by many sigmas they are rejected, and taken up again at the same wrong
 * place. But a stereo frame shows where they lie relative to the camera, and the map where in the
 * world: three of them tell the pose (docs/MATH.md 13). */
#ifndef PLR_FILTER_RELOCATE_H
#define PLR_FILTER_RELOCATE_H

#include <stdbool.h>

#include "pelorus/state.h"

/* Counts the successive frames that rejected nearly all known landmarks in sight. Call it after the
 * gate. `unplaced`: known landmarks in sight that could not be taken up at the predicted pose. */
void plr_relocate_watch(plr_filter *f, const plr_sightings *sightings, unsigned unplaced);

/* Where the pose is lost: after each ten frames of plr_relocate_watch. If the known landmarks of
 * this frame tell a pose, and at least four of them and three fifths of those in sight agree on it,
 * begins anew at that pose with these landmarks and returns true; the others come in with the next
 * frame. The pose's sigmas are ten times those that the frame tells, until the update with this
 * frame. If it comes to that again before the pose is out of doubt, an IMU's biases begin at their
 * prior, too. (Twists that are wrong would teach theirs.) If no pose is found,
 * events->lost_in_map. `decided`: what the supervisor has decided of the picture; anew, where the filter begins
 * anew. Works in work.Vt. */
bool plr_relocate_when_lost(plr_filter *f, const plr_sightings *sightings, plr_frame_events *events,
                            plr_picture_decision *decided);

typedef enum plr_relocation {
    PLR_PLACED, /* the pose fits the map: nothing was changed */
    PLR_MOVED, /* the pose was moved to the one found; known landmarks were dropped, and come in again */
    PLR_LEFT_OUT /* those that had just come in have been dropped: no pose fits them */
} plr_relocation;

/* Where the pose is uncertain: known landmarks in sight have come in at a pose, or been moved by
 * a motion, so uncertain that what is seen of them is not linear in its error. The estimate moves
 * to the pose that the frame tells, so that they are linearised there: if four tell more about each
 * axis of the pose than was known, by the frame alone, else by those that have just come in and
 * what was known (if no pose fits, they are left out of this frame). P is not reduced by it, and
 * the frame is used as any other. events->moved_far if the pose was further off than its covariance
 * says. Works in work.Vt. PLR_E_DIVERGED as plr_predict_apply. Slots of rows are others, unless *what is
 * PLR_PLACED. */
plr_status plr_relocate_when_uncertain(plr_filter *f, const plr_sightings *sightings,
                                       plr_frame_events *events, plr_relocation *what);

/* The pose's covariance has been enlarged by C. What known landmarks say about the pose has been
 * used already, so those that stay in the state would not reduce it again. Removes those whose
 * direction is not linear in an error of size C: they come in again with the next frame, as at an
 * uncertain pose. For a small C they stay, because what they say would be used twice. */
void plr_relocate_let_go(plr_filter *f, const plr_real C[PLR_POSE_SQUARE]);

#endif
