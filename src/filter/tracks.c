// SPDX-License-Identifier: MIT
#include "filter/tracks.h"

#include "math/small.h"

enum {
    PATIENCE = 8, /* frames, the first time */
    LONG_PATIENCE =
        64,          /* of one that was good: its point moves, and does so in the next frames too */
    GOOD_FRAMES = 3, /* that used it */
    MOST_CHANCES = 8 /* patience doubles so often */
};

/* The sums look back some 19 frames. */
#define KEEP PLR_R(0.9)
/* Chi-square, 3 degrees of freedom: sums of white noise are beyond it once in 13 millions. Real pixels have
 * heavier tails, and errors that last. */
#define LEANS PLR_R(36)

void plr_track_add(plr_slot *slot, const plr_real e[3]) {
    for (unsigned r = 0; r < 3; r++)
        slot->lean[r] = PLR_FMA(KEEP, slot->lean[r], e[r]);
    slot->lean_variance = PLR_FMA(KEEP * KEEP, slot->lean_variance, PLR_R(1));
    if (plr_dot3(slot->lean, slot->lean) > LEANS * slot->lean_variance)
        slot->strays = 1;
}

void plr_track_count(plr_slot *slot, bool rejected) {
    slot->times_gated += rejected;
    slot->accepted = (uint16_t)(slot->accepted + (!rejected && slot->accepted < UINT16_MAX));
    slot->rejected = rejected ? (uint16_t)(slot->rejected + (slot->rejected < UINT16_MAX)) : 0;
}

bool plr_track_may_begin_anew(const plr_slot *slot) {
    const bool was_good = slot->strays || slot->accepted >= GOOD_FRAMES;
    const unsigned first = was_good ? LONG_PATIENCE : PATIENCE;
    return !slot->known && slot->rejected >= first << slot->chances;
}

void plr_track_begin_anew(plr_slot *slot, const plr_slot *before) {
    slot->chances = (uint8_t)(before->chances + (before->chances < MOST_CHANCES));
    slot->times_seen = before->times_seen;
    slot->times_gated = before->times_gated;
    slot->print = before->print;
}
