// SPDX-License-Identifier: MIT
#include "state/slots.h"

#include <string.h>

#include "math/finite.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/sensitivity.h"

uint16_t plr_slots_find(const plr_filter *f, uint32_t id) {
    for (unsigned slot = 0; slot < f->belief.count; slot++)
        if (f->belief.slots[slot].id == id)
            return (uint16_t)slot;
    return PLR_NO_SLOT;
}

/* The landmark longest unseen, or PLR_NO_SLOT. Frame numbers may wrap: ages are differences. */
static uint16_t oldest(const plr_filter *f) {
    uint16_t found = PLR_NO_SLOT;
    uint32_t age = 0;
    for (unsigned slot = 0; slot < f->belief.count; slot++) {
        const uint32_t unseen = f->belief.frame_number - f->belief.slots[slot].last_frame;
        if (unseen > age) {
            age = unseen;
            found = (uint16_t)slot;
        }
    }
    return found;
}

unsigned plr_slots_room(const plr_filter *f) {
    unsigned room = f->config.slots > f->belief.count ? f->config.slots - f->belief.count : 0;
    for (unsigned slot = 0; slot < f->belief.count; slot++)
        room += f->belief.slots[slot].last_frame != f->belief.frame_number;
    return room;
}

bool plr_slots_make_room(plr_filter *f, uint16_t *evicted, bool *sink_failed) {
    if (f->belief.count < f->config.slots)
        return true;
    const uint16_t slot = oldest(f);
    if (slot == PLR_NO_SLOT)
        return false;
    if (f->map.sink) {
        plr_landmark landmark;
        if (plr_slots_export(f, slot, &landmark) && f->map.sink(f->map.context, &landmark) != 0) {
            *sink_failed = true;
            return false;
        }
    }
    plr_slots_remove(f, slot);
    (*evicted)++;
    return true;
}

void plr_slots_append(plr_filter *f, uint32_t id, bool known, const plr_new_landmark *landmark) {
    plr_covariance_append(f, landmark);
    plr_slot *slot = &f->belief.slots[f->belief.count++];
    memset(slot, 0, sizeof *slot);
    memcpy(slot->x, landmark->x, sizeof slot->x);
    slot->id = id;
    slot->known = known;
    slot->times_seen = known ? 0 : 1; /* a known one is counted when it is matched */
    slot->last_frame = f->belief.frame_number;
    slot->last_seen_ns = f->belief.t_ns;
}

void plr_slots_remove(plr_filter *f, unsigned slot) {
    plr_covariance_remove(f, slot);
    f->belief.count--;
    if (slot == f->belief.count)
        return;
    f->belief.slots[slot] = f->belief.slots[f->belief.count];
    f->work.verdict[slot] = f->work.verdict[f->belief.count];
}

bool plr_slots_export(const plr_filter *f, unsigned slot, plr_landmark *landmark) {
    const plr_slot *s = &f->belief.slots[slot];
    plr_world_point point;
    plr_real P[9];
    plr_model_of(f)->in_world(f, s, &point);
    plr_covariance_of_rows(f, &point.J, P);
    plr_sensitivity_add_to_rows(f, &point.J, P);
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
