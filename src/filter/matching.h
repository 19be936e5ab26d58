// SPDX-License-Identifier: MIT
/* Which observation belongs to which landmark: the frame's part of the workspace. */
#ifndef PLR_FILTER_MATCHING_H
#define PLR_FILTER_MATCHING_H

#include "pelorus/state.h"

/* Fills work.order with the good observations by id, and returns their number. Malformed ones are
 * counted, and so are all copies of an id that occurs twice, because none of them can be known to
 * be the right one. */
unsigned plr_match_in_order(plr_filter *f, const plr_frame *frame, plr_report *report);

/* Fills work.slot_of for the n observations in order. */
void plr_match_slots(plr_filter *f, const plr_observation *seen, unsigned n);

/* Asks the map source for the ids that the state does not hold. Ids that the map does not have are
 * counted when landmarks are initialised; in slam, so are those without a slot. */
void plr_match_known(plr_filter *f, const plr_observation *seen, unsigned n,
                     plr_frame_events *events, plr_report *report);

/* Counts the frame in every landmark that it saw. */
void plr_match_count(plr_filter *f, unsigned n);

#endif
