// SPDX-License-Identifier: MIT
/* Which observation belongs to which landmark: the rows of the frame. */
#ifndef PLR_FILTER_MATCHING_H
#define PLR_FILTER_MATCHING_H

#include "pelorus/state.h"

/* Makes a row of each good observation, by id. Malformed ones are counted, and so are all copies of an
 * id that occurs twice, because none of them can be known to be the right one. */
void plr_match_in_order(const plr_frame *frame, plr_sightings *sightings, plr_report *report);

/* Finds the slot of each row; none is judged. */
void plr_match_slots(plr_filter *f, plr_sightings *sightings);

/* Asks the map source for the ids that the state does not hold, and adds those found to the state and P; where no
 * slot is free, those unseen for longest are evicted for them. What still finds no slot is counted here in
 * localization; in slam it is initialised, or counted, with the births. */
void plr_match_known(plr_filter *f, plr_sightings *sightings, plr_frame_events *events,
                     plr_report *report);

/* Counts the frame in every landmark that it saw. */
void plr_match_count(plr_filter *f, const plr_sightings *sightings);

#endif
