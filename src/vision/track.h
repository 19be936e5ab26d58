// SPDX-License-Identifier: MIT
/* A track from the last left picture into this one, and from the left picture into the right one. */
#ifndef PLR_VISION_TRACK_H
#define PLR_VISION_TRACK_H

#include <stdbool.h>

#include "pelorus/vision.h"
#include "vision/pyramid.h"
#include "vision/rig.h"

/* What a pair is followed in. */
typedef struct plr_scene {
    plr_levels side[2];
    plr_expected_motion motion;
} plr_scene;

/* Moves a track to where it is expected in this left picture. False, and t->why, where that is outside. */
bool plr_track_expect(const plr_vision *v, const plr_expected_motion *m, plr_track *t);

/* Finds the patch of its birth there. False, and t->why, where it is not. */
bool plr_track_follow(plr_vision *v, const plr_scene *s, plr_track *t);

/* Finds the track in the right picture: a birth along the epipolar line, others from their last disparity on.
 * Fills right, disparity and var_right. */
bool plr_track_match(plr_vision *v, const plr_scene *s, plr_track *t, bool birth);

/* Begins a track at a place of the left picture; false where the patch has no contrast. */
bool plr_track_begin(const plr_vision *v, const plr_scene *s, plr_track *t, const plr_real at[2]);

/* Whether the expected motion, if it goes on, leaves the track in the left picture for two more pairs: else it
 * is not worth following. */
bool plr_track_stays(const plr_vision *v, const plr_expected_motion *m, const plr_track *t);

/* Whether the track is found as if the right picture were the left one. */
bool plr_track_mirrored(plr_vision *v, const plr_scene *s, const plr_track *t);

/* slope <- the mean of what a fit measures, of the older fits, which count less and less, and of the prior 0,
 * which is not forgotten: a slope that fits do not tell tends to that of a surface that faces the camera. `info`
 * and `fit` are inverses of covariances, xx xy yy, `prior` that of a variance. */
void plr_track_weigh_slope(plr_real slope[2], plr_real info[3], plr_real prior,
                           const plr_real measured[2], const plr_real fit[3]);

#endif
