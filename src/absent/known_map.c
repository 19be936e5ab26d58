// SPDX-License-Identifier: MIT
/* In the place of src/known_map where a build leaves it out (PLR_KNOWN_MAP=0): no map is asked. */
#include "known_map/find.h"
#include "known_map/lookup.h"

#if !PLR_KNOWN_MAP

bool plr_map_is_asked(const plr_filter *f) {
    (void)f;
    return false;
}

bool plr_map_ask(const plr_filter *f, uint32_t id, plr_landmark *known) {
    (void)f, (void)id, (void)known;
    return false;
}

bool plr_find_pose(plr_filter *f, const plr_frame *frame, unsigned n, bool guesses,
                   plr_found_pose *found) {
    (void)f, (void)frame, (void)n, (void)guesses, (void)found;
    return false;
}

bool plr_find_likeliest_pose(plr_filter *f, const plr_frame *frame, unsigned n,
                             plr_found_pose *found) {
    (void)f, (void)frame, (void)n, (void)found;
    return false;
}

bool plr_find_gap(const plr_filter *f, const plr_found_pose *found, plr_pose_gap *gap) {
    (void)f, (void)found, (void)gap;
    return false;
}

#endif
