// SPDX-License-Identifier: MIT
/* In the place of src/known_map where a build leaves it out (PLR_KNOWN_MAP=0): no map is asked. */
#include "known_map/find.h"
#include "known_map/lookup.h"

#if !PLR_KNOWN_MAP

bool plr_map_is_asked(const plr_config *config, const plr_map *map) {
    (void)config, (void)map;
    return false;
}

bool plr_map_ask(const plr_map *map, uint32_t id, plr_landmark *known) {
    (void)map, (void)id, (void)known;
    return false;
}

bool plr_find_pose(const plr_belief *belief, const plr_camera_model *camera, const plr_map *map,
                   plr_real *Vt, const plr_sightings *sightings, bool guesses,
                   plr_found_pose *found) {
    (void)belief, (void)camera, (void)map, (void)Vt, (void)sightings, (void)guesses, (void)found;
    return false;
}

bool plr_find_likeliest_pose(const plr_belief *belief, const plr_camera_model *camera,
                             const plr_motion *motion, const plr_map *map, plr_real *Vt,
                             const plr_sightings *sightings, plr_found_pose *found) {
    (void)belief, (void)camera, (void)motion, (void)map, (void)Vt, (void)sightings, (void)found;
    return false;
}

bool plr_find_gap(const plr_belief *belief, const plr_camera_model *camera,
                  const plr_motion *motion, const plr_found_pose *found, plr_pose_gap *gap) {
    (void)belief, (void)camera, (void)motion, (void)found, (void)gap;
    return false;
}

#endif
