// SPDX-License-Identifier: MIT
/* The landmark slots: the first `count` of an array, so that a frame's time depends on their
 * number. If it is full, the one unseen for longest is evicted (docs/MATH.md 13). */
#ifndef PLR_STATE_SLOTS_H
#define PLR_STATE_SLOTS_H

#include <stdbool.h>

#include "pelorus/belief.h"
#include "pelorus/camera.h"
#include "pelorus/map.h"
#include "state/model.h"

/* No slot. */
#define PLR_NO_SLOT UINT16_MAX

/* The slot of an id, or PLR_NO_SLOT. */
uint16_t plr_slots_find(const plr_belief *belief, uint32_t id);

/* How many landmarks can begin: the free slots, and those of landmarks that this frame does not see. */
unsigned plr_slots_room(const plr_belief *belief);

/* Makes room for one landmark if all slots are taken: the one unseen for the longest time goes to
 * the map sink, in a tie that of the lowest slot, and never one seen in the current frame. False if
 * there is no room. *evicted is counted up, *sink_failed set if the sink failed. */
bool plr_slots_make_room(plr_belief *belief, const plr_camera_model *camera,
                         const plr_motion *motion, const plr_map *map, uint16_t *evicted,
                         bool *sink_failed);

/* Puts a landmark into a free slot, seen in the current frame. */
void plr_slots_append(plr_belief *belief, uint32_t id, bool known,
                      const plr_new_landmark *landmark);

/* Drops a landmark; the last slot takes its place. */
void plr_slots_remove(plr_belief *belief, unsigned slot);

/* Landmark in the world with covariance, all motion applied. False if a number is not finite. */
bool plr_slots_export(const plr_belief *belief, const plr_camera_model *camera,
                      const plr_motion *motion, unsigned slot, plr_landmark *landmark);

#endif
