// SPDX-License-Identifier: MIT
/* Whether the pose and a known map agree where the map comes in sight: the first frames correct
 * the pose by no more than the covariances of both allow. Otherwise the map is off as a whole, or
 * the pose that was set is; the gate, which looks at single landmarks, sees neither (docs/MATH.md
 * 17). */
#ifndef PLR_FILTER_MAP_CHECK_H
#define PLR_FILTER_MAP_CHECK_H

#include <stdbool.h>

#include "pelorus/state.h"

/* The pose before a correction. */
typedef struct plr_map_check_pose {
    plr_real R_WB[9];
    double p_WB[3];
    plr_real P_xi[PLR_POSE_SQUARE]; /* its covariance */
} plr_map_check_pose;

/* Nothing has been summed up. */
void plr_map_check_clear(plr_filter *f);

/* Before the correction by a frame of `n` observations, for which `adopted` known landmarks have
 * come in. Where these are at least four, and half of the known ones in sight, a map comes in
 * sight: from this frame on some are summed up. True if this is one of them: then `before` is
 * filled. */
bool plr_map_check_begin(plr_filter *f, unsigned adopted, unsigned n, plr_map_check_pose *before);

/* After the correction by such a frame. True if the map has moved the pose by more than chance
 * does; the covariance that is told then covers the poses by prediction and by the map, until
 * section 17's frames of agreement. */
bool plr_map_check_end(plr_filter *f, const plr_map_check_pose *before);

#endif
