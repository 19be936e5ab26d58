// SPDX-License-Identifier: MIT
#include "filter/tracks.h"

#include "limits/limits.h"
#include "math/leaky.h"
#include "math/small.h"
#include "pelorus/assertions.h"

enum { MAX_RESTARTS = 8 }; /* the number of rejections doubles at most so often */

void plr_track_add(plr_slot *slot, uint64_t left_out, const plr_real e[3]) {
    const plr_real keeps = plr_limit(left_out, PLR_LIMIT_MOVING_KEEPS);
    for (unsigned r = 0; r < 3; r++)
        slot->innovation_sum[r] = plr_leaky_sum(slot->innovation_sum[r], keeps, e[r]);
    slot->innovation_variance = plr_leaky_sum(slot->innovation_variance, keeps * keeps, PLR_R(1));
    PLR_ASSERT(slot->innovation_variance >= 1);
    if (plr_dot3(slot->innovation_sum, slot->innovation_sum) >
        plr_limit(left_out, PLR_LIMIT_MOVING_ABOVE) * slot->innovation_variance)
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

bool plr_track_may_restart(const plr_slot *slot, uint64_t left_out) {
    PLR_ASSERT(slot->restarts <= MAX_RESTARTS);
    const bool was_good =
        slot->moving || slot->accepted >= plr_limit_count(left_out, PLR_LIMIT_GOOD_FRAMES);
    const unsigned first = plr_limit_count(left_out, was_good ? PLR_LIMIT_RESTART_OF_GOOD
                                                              : PLR_LIMIT_RESTART_REJECTIONS);
    return !slot->known && slot->rejected >= first << slot->restarts;
}

void plr_track_restart(plr_slot *slot, const plr_slot *before) {
    slot->restarts = (uint8_t)(before->restarts + (before->restarts < MAX_RESTARTS));
    slot->times_seen = before->times_seen;
    slot->times_gated = before->times_gated;
    slot->pixel_hash = before->pixel_hash;
}
