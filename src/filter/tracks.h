// SPDX-License-Identifier: MIT
/*
 * Detects landmarks that move, from their innovations over many frames. A gate looks at one frame:
 * a point that moves a little in each passes it every time, its landmark follows it, and the pose
 * is pulled along. But its innovations have a mean, where those of a point at rest are white noise
 * (docs/MATH.md 17).
 */
#ifndef PLR_FILTER_TRACKS_H
#define PLR_FILTER_TRACKS_H

#include <stdbool.h>

#include "filter/gate.h"
#include "pelorus/state.h"

/* `left_out`: the supervisor's rules that are left out. */

/* Adds the whitened innovation e, 3 rows, of an accepted observation, predicted from all other
 * observations. Sets `moving` if the mean of the innovations is larger than noise explains: the
 * point moves. */
void plr_track_add(plr_slot *slot, uint64_t left_out, const plr_real e[3]);

/* Counts a frame that matched the landmark. A landmark that is far off
 * was not good: its track was lost, and goes on at another point. One whose point begins to move is off by
 * little at first. */
void plr_track_count(plr_slot *slot, plr_gate_result result);

/* True if the landmark was rejected in so many successive frames that its position may be wrong: it
 * was initialised from an outlier, or its point has moved and is at rest again. */
bool plr_track_may_restart(const plr_slot *slot, uint64_t left_out);

/* For a landmark that is initialised again: keeps the counts of the one before, and doubles the
 * number of rejections that it needs the next time. */
void plr_track_restart(plr_slot *slot, const plr_slot *before);

#endif
