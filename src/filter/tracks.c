// SPDX-License-Identifier: MIT
#include "filter/tracks.h"

#include "math/leaky.h"
#include "math/small.h"
#include "pelorus/assertions.h"

enum {
    MIN_REJECTIONS = 8, /* successive rejections before a landmark is initialised again */
    MIN_REJECTIONS_OF_GOOD =
        64,          /* the same for one that was good: its point moves, and will go on */
    GOOD_FRAMES = 3, /* a landmark was good if so many frames used it */
    MAX_RESTARTS = 8 /* the number of rejections doubles at most so often */
};

/* What the sums keep from frame to frame: they cover about 19 frames. */
#define DECAY PLR_R(0.9)
/* Chi-square with 3 degrees of freedom. White noise exceeds it once in 13 million; the limit is
 * wide because real pixels have heavier tails and lasting errors. */
#define MOVING_ABOVE PLR_R(36)

void plr_track_add(plr_slot *slot, const plr_real e[3]) {
    for (unsigned r = 0; r < 3; r++)
        slot->innovation_sum[r] = plr_leaky_sum(slot->innovation_sum[r], DECAY, e[r]);
    slot->innovation_variance = plr_leaky_sum(slot->innovation_variance, DECAY * DECAY, PLR_R(1));
    PLR_ASSERT(slot->innovation_variance >= 1);
    if (plr_dot3(slot->innovation_sum, slot->innovation_sum) >
        MOVING_ABOVE * slot->innovation_variance)
        slot->moving = 1;
}

void plr_track_count(plr_slot *slot, plr_gate_result result) {
    const bool rejected = result != PLR_GATE_ACCEPTED;
    slot->times_gated += rejected;
    slot->accepted = (uint16_t)(slot->accepted + (!rejected && slot->accepted < UINT16_MAX));
    if (result == PLR_GATE_FAR)
        slot->accepted = 0;
    slot->rejected = rejected ? (uint16_t)(slot->rejected + (slot->rejected < UINT16_MAX)) : 0;
}

bool plr_track_may_restart(const plr_slot *slot) {
    PLR_ASSERT(slot->restarts <= MAX_RESTARTS);
    const bool was_good = slot->moving || slot->accepted >= GOOD_FRAMES;
    const unsigned first = was_good ? MIN_REJECTIONS_OF_GOOD : MIN_REJECTIONS;
    return !slot->known && slot->rejected >= first << slot->restarts;
}

void plr_track_restart(plr_slot *slot, const plr_slot *before) {
    slot->restarts = (uint8_t)(before->restarts + (before->restarts < MAX_RESTARTS));
    slot->times_seen = before->times_seen;
    slot->times_gated = before->times_gated;
    slot->pixel_hash = before->pixel_hash;
}
