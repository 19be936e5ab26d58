// SPDX-License-Identifier: MIT
/* Whether the pose and a known map agree where the map comes in sight: the first frames correct the pose by
 * no more than the covariances of both allow. Otherwise the map is off as a whole, or the pose that was set
 * is; the gate, which looks at single landmarks, sees neither. */
#ifndef PLR_SUPERVISE_MAP_H
#define PLR_SUPERVISE_MAP_H

#include "pelorus/supervisor.h"

/* Nothing has been summed up. */
void plr_map_forget(plr_supervisor *s);

/* By how much the map has moved the pose, and that is more than chance does: m and rad in the body, the
 * same in sigmas, and the expected square of that by chance. */
typedef struct plr_map_verdict {
    bool disagrees;
    plr_real n[PLR_POSE_DIM], nu[PLR_POSE_DIM], noise;
} plr_map_verdict;

/* Adds a frame. Where at least four landmarks have come in, and they are half of the known ones in sight, a
 * map comes in sight: from this frame on some are summed up. */
void plr_map_add(plr_supervisor *s, const plr_map_evidence *e, plr_map_verdict *verdict);

#endif
