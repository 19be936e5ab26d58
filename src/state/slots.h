// SPDX-License-Identifier: MIT
/* The landmark slots: an array whose first `count` elements are in use, so that time depends on
 * their number. If it is full, the landmark that was not seen for the longest time is evicted
 * (docs/MATH.md 13). */
#ifndef PLR_STATE_SLOTS_H
#define PLR_STATE_SLOTS_H

#include <stdbool.h>

#include "pelorus/state.h"
#include "state/model.h"

/* No slot; also the end of what a uint16_t slot number can say. */
#define PLR_NO_SLOT UINT16_MAX

/* The slot of an id, or PLR_NO_SLOT. */
uint16_t plr_slots_find(const plr_filter *f, uint32_t id);

/* Makes room for one landmark if all slots are taken: the one longest unseen goes to the map sink,
 * never one seen in the current frame; ties: lowest slot. False if there is no room. `evicted` and
 * `sink_failed` are raised by what happened. */
bool plr_slots_make_room(plr_filter *f, uint16_t *evicted, bool *sink_failed);

/* Puts a landmark into a free slot, seen in the current frame. */
void plr_slots_append(plr_filter *f, uint32_t id, bool known, const plr_new_landmark *landmark);

/* Drops a landmark; the last slot takes its place. */
void plr_slots_remove(plr_filter *f, unsigned slot);

/* Landmark in the world with covariance. All motion must be applied. */
void plr_slots_export(const plr_filter *f, unsigned slot, plr_landmark *landmark);

#endif
