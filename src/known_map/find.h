// SPDX-License-Identifier: MIT
/* The pose by known landmarks in sight: a stereo frame shows where they lie relative to the camera, and the
 * map where in the world (docs/MATH.md 13). Nothing here changes the filter but its workspace. */
#ifndef PLR_KNOWN_MAP_FIND_H
#define PLR_KNOWN_MAP_FIND_H

#include "known_map/placing.h"
#include "pelorus/belief.h"
#include "pelorus/map.h"
#include "pelorus/workspace.h"

/* A pose that known landmarks in sight agree on. */
typedef struct plr_found_pose {
    plr_real R_WB[9], P_xi[PLR_POSE_SQUARE]; /* P_xi: as far as this frame tells it */
    double p_WB[3];
    unsigned count; /* of `seen` */
} plr_found_pose;

/* A pose that was found, held against the predicted one. */
typedef struct plr_pose_gap {
    plr_real xi[PLR_POSE_DIM];   /* from the predicted one, m and rad in the body */
    plr_real nu[PLR_POSE_DIM];   /* xi in sigmas of P + P_found */
    plr_real back[PLR_POSE_DIM]; /* P_found (P + P_found)^-1 xi: what the prediction knows better */
    plr_real least, largest;     /* of the ratios of P's variances to P_found's */
} plr_pose_gap;

/* The largest such multiple at which pose and frame are joined in one matrix: beyond it the
 * update would take more digits off P than float32 has. */
#define PLR_TOO_WIDE PLR_R(1e4)

static inline bool plr_has_just_come_in(const plr_belief *belief, unsigned slot) {
    return belief->slots[slot].known && belief->slots[slot].times_seen == 0;
}

/* The known landmarks that a pose was found by: in work.Vt. */
static inline plr_seen_known *plr_seen_known_of(plr_real *Vt) {
    return (plr_seen_known *)(void *)Vt;
}

/* By the frame alone; `guesses`: from the present pose. False if fewer than three fifths agree. */
bool plr_find_pose(const plr_belief *belief, const plr_camera_model *camera, const plr_map *map,
                   plr_real *Vt, const plr_sightings *sightings, bool guesses,
                   plr_found_pose *found);

/* By the landmarks that have just come in, and by what is known of the pose. False if there are none, or if
 * fewer than three fifths agree. found->P_xi is zero. */
bool plr_find_likeliest_pose(const plr_belief *belief, const plr_camera_model *camera,
                             const plr_motion *motion, const plr_map *map, plr_real *Vt,
                             const plr_sightings *sightings, plr_found_pose *found);

/* Holds a pose that was found against the predicted one. False if P + P_found cannot be factorised. */
bool plr_find_gap(const plr_belief *belief, const plr_camera_model *camera,
                  const plr_motion *motion, const plr_found_pose *found, plr_pose_gap *gap);

#endif
