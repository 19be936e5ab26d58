// SPDX-License-Identifier: MIT
/* The rows of a frame: plr_sighting in pelorus/state.h. */
#ifndef PLR_STATE_SIGHTINGS_H
#define PLR_STATE_SIGHTINGS_H

#include <stdbool.h>

#include "pelorus/assertions.h"
#include "pelorus/belief.h"
#include "pelorus/workspace.h"
#include "state/slots.h"

/* True if the state holds the landmark that is seen. */
static inline bool plr_is_matched(const plr_sighting *s) {
    return s->slot != PLR_NO_SLOT;
}

/* The landmark of a matched one. */
static inline plr_slot *plr_slot_of(plr_belief *belief, const plr_sighting *s) {
    PLR_ASSERT(s->slot < belief->count && belief->slots[s->slot].id == s->seen->id);
    return &belief->slots[s->slot];
}

/* True if one is matched with a landmark of a given map. */
static inline bool plr_is_of_known(const plr_belief *belief, const plr_sighting *s) {
    return plr_is_matched(s) && belief->slots[s->slot].known;
}

#endif
