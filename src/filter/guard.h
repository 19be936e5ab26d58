// SPDX-License-Identifier: MIT
/*
 * Is the filter's memory as the last call left it? A stray write, a flipped bit or a stack that grew
 * into it must not become a crash, a NaN or a pose that is believed.
 *
 * Sums are kept of what never changes after init (settings, map, parameters, model), of the small
 * state that every call changes (times, pose, bias, motion, counts, the pose's and biases' rows of P),
 * and of all slots and the whole of P, which a frame changes. A change within one aligned 32-bit word
 * is found for sure, any other almost surely. A call that changes something ends by sealing it anew.
 * The workspace belongs to the call that runs, and is not looked at.
 *
 * Cost: three or four instructions a word; twice a frame over P, twice a call over the small state.
 * Once damage is found the sums stay wrong, so that every later call is refused too, until an init; or
 * a reset, if what never changes is sound.
 */
#ifndef PLR_FILTER_GUARD_H
#define PLR_FILTER_GUARD_H

#include "pelorus/state.h"

/* For a call that reads or changes the small state alone. PLR_E_NOT_READY; PLR_E_DAMAGED. */
plr_status plr_guard_look(const plr_filter *f);

/* For a call that reads or changes landmarks or P. */
plr_status plr_guard_look_whole(const plr_filter *f);

/* For a reset: settings, map, parameters, model. */
plr_status plr_guard_look_constant(const plr_filter *f);

/* Counts and choices are in their ranges: no index can leave its array. */
bool plr_guard_is_in_range(const plr_filter *f);

/* After a call that changed the small state; landmarks or P too; and once, at init. */
void plr_guard_seal(plr_filter *f);
void plr_guard_seal_whole(plr_filter *f);
void plr_guard_seal_constant(plr_filter *f);

#endif
