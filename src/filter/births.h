// SPDX-License-Identifier: MIT
/* Initialises new landmarks, and initialises those again that turned out to be wrong. */
#ifndef PLR_FILTER_BIRTHS_H
#define PLR_FILTER_BIRTHS_H

#include <stdbool.h>

#include "pelorus/state.h"

/* True if the mode initialises landmarks from pixels. */
bool plr_births_are_allowed(const plr_filter *f);

/* Initialises landmarks from the observations that match none; `none`: counts them alone. */
void plr_births_from_unmatched(plr_filter *f, const plr_sightings *sightings, bool none,
                               plr_frame_events *events, plr_report *report);

/* Drops the landmarks that the gate rejected in this frame, because it has rejected nearly
 * everything for too long. Their rows count as unmatched from now on. */
void plr_births_drop_rejected(plr_filter *f, plr_sightings *sightings);

/* Drops a lost landmark (gate.h), and initialises it again from this frame if its pixels allow it. If
 * at least half of the frame was accepted, a landmark that was rejected for long is taken to be wrong,
 * and is initialised again too. PLR_E_DIVERGED as plr_predict_apply. Slots of rows may be others afterwards. */
plr_status plr_births_restart(plr_filter *f, const plr_sightings *sightings,
                              const plr_report *report);

#endif
