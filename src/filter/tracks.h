// SPDX-License-Identifier: MIT
/*
 * Each landmark's track against its own past. A gate looks at one frame: a point that moves a little in
 * each, or drifts with its tracker, passes it every time, is pulled along by its landmark and pulls the
 * pose with it. Its innovations lean to one side, though, where those of a point that stands are white
 * (docs/MATH.md 17).
 */
#ifndef PLR_FILTER_TRACKS_H
#define PLR_FILTER_TRACKS_H

#include <stdbool.h>

#include "pelorus/state.h"

/* Takes in what an accepted observation said beside all others: e, 3 rows, whitened. Sets `strays` where
 * the innovations lean to one side by more than noise would: the point moves. */
void plr_track_add(plr_slot *slot, const plr_real e[3]);

/* A frame matched the landmark and the gate let it through, or did not. */
void plr_track_count(plr_slot *slot, bool rejected);

/* True where the landmark was rejected in so many successive frames that it is the landmark that may be
 * wrong: it was born from an outlier, or its point has moved and stands again. */
bool plr_track_may_begin_anew(const plr_slot *slot);

/* What a landmark that began anew keeps of the one before: its counts, and twice the patience. */
void plr_track_begin_anew(plr_slot *slot, const plr_slot *before);

#endif
