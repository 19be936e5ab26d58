// SPDX-License-Identifier: MIT
#include "state/slots.h"

#include <string.h>

#include "math/finite.h"
#include "pelorus/assertions.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/sensitivity.h"

uint16_t plr_slots_find(const plr_belief *belief, uint32_t id) {
    for (unsigned slot = 0; slot < belief->count; slot++)
        if (belief->slots[slot].id == id)
            return (uint16_t)slot;
    return PLR_NO_SLOT;
}

/* The landmark longest unseen, or PLR_NO_SLOT. Frame numbers may wrap: ages are differences. */
static uint16_t oldest(const plr_belief *belief) {
    uint16_t found = PLR_NO_SLOT;
    uint32_t age = 0;
    for (unsigned slot = 0; slot < belief->count; slot++) {
        const uint32_t unseen = belief->frame_number - belief->slots[slot].last_frame;
        if (unseen > age) {
            age = unseen;
            found = (uint16_t)slot;
        }
    }
    return found;
}

unsigned plr_slots_room(const plr_belief *belief) {
    unsigned room = belief->capacity > belief->count ? belief->capacity - belief->count : 0;
    for (unsigned slot = 0; slot < belief->count; slot++)
        room += belief->slots[slot].last_frame != belief->frame_number;
    return room;
}

bool plr_slots_make_room(plr_belief *belief, const plr_camera_model *camera,
                         const plr_motion *motion, const plr_map *map, uint16_t *evicted,
                         bool *sink_failed) {
    if (belief->count < belief->capacity)
        return true;
    const uint16_t slot = oldest(belief);
    if (slot == PLR_NO_SLOT)
        return false;
    if (map->sink) {
        plr_landmark landmark;
        if (plr_slots_export(belief, camera, motion, slot, &landmark) &&
            map->sink(map->context, &landmark) != 0) {
            *sink_failed = true;
            return false;
        }
    }
    plr_slots_remove(belief, slot);
    (*evicted)++;
    return true;
}

void plr_slots_append(plr_belief *belief, uint32_t id, bool known,
                      const plr_new_landmark *landmark) {
    PLR_ASSERT(belief->count < belief->capacity && plr_slots_find(belief, id) == PLR_NO_SLOT);
    plr_covariance_append(belief, landmark);
    plr_slot *slot = &belief->slots[belief->count++];
    memset(slot, 0, sizeof *slot);
    memcpy(slot->x, landmark->x, sizeof slot->x);
    slot->id = id;
    slot->known = known;
    slot->times_seen = known ? 0 : 1; /* a known one is counted when it is matched */
    slot->last_frame = belief->frame_number;
    slot->last_seen_ns = belief->t_ns;
}

void plr_slots_remove(plr_belief *belief, unsigned slot) {
    PLR_ASSERT(slot < belief->count);
    plr_covariance_remove(belief, slot);
    belief->count--;
    if (slot < belief->count)
        belief->slots[slot] = belief->slots[belief->count];
}

bool plr_slots_export(const plr_belief *belief, const plr_camera_model *camera,
                      const plr_motion *motion, unsigned slot, plr_landmark *landmark) {
    PLR_ASSERT(slot < belief->count);
    const plr_slot *s = &belief->slots[slot];
    plr_world_point point;
    plr_real P[9];
    plr_model_of(belief)->in_world(belief, camera, motion, s, &point);
    plr_covariance_of_rows(belief, &point.J, P);
    plr_sensitivity_add_to_rows(belief, camera, &point.J, NULL, P);
    landmark->id = s->id;
    landmark->times_seen = s->times_seen;
    landmark->times_gated = s->times_gated;
    landmark->last_seen_ns = s->last_seen_ns;
    landmark->known = s->known != 0;
    for (int i = 0; i < 3; i++) {
        landmark->p_W_m[i] = point.p_W[i];
        for (int j = 0; j < 3; j++)
            landmark->P_W_m2[3 * i + j] = (double)P[i >= j ? 3 * i + j : 3 * j + i];
    }
    return plr_all_finite(landmark->p_W_m, 3) && plr_all_finite(landmark->P_W_m2, 9);
}
