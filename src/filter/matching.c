// SPDX-License-Identifier: MIT
#include "filter/matching.h"

#include "filter/filter_internal.h"
#include "known_map/lookup.h"
#include "math/order.h"
#include "pelorus/assertions.h"
#include "state/model.h"
#include "state/slots.h"

/* A coordinate beyond this lies in no image, px. */
#define MAX_PIXEL 1e6F

static bool is_pixel(float x) {
    return x > -MAX_PIXEL && x < MAX_PIXEL; /* false for NaN too */
}

static bool id_before(const void *context, uint16_t a, uint16_t b) {
    const plr_observation *observations = context;
    return observations[a].id < observations[b].id;
}

unsigned plr_match_in_order(plr_filter *f, const plr_frame *frame, plr_report *report) {
    uint16_t *order = f->work.order;
    const plr_observation *seen = frame->observations;
    unsigned n = 0;
    for (uint16_t i = 0; i < frame->count; i++) {
        const plr_observation *o = &seen[i];
        if (is_pixel(o->uL_px) && is_pixel(o->vL_px) && is_pixel(o->uR_px) && is_pixel(o->vR_px))
            order[n++] = i;
        else
            report->refused++;
    }
    plr_order_sort(order, n, id_before, seen);
    unsigned kept = 0;
    for (unsigned i = 0; i < n;) {
        unsigned end = i + 1;
        while (end < n && seen[order[end]].id == seen[order[i]].id)
            end++;
        if (end == i + 1)
            order[kept++] = order[i];
        else
            report->duplicates = (uint16_t)(report->duplicates + end - i);
        i = end;
    }
    return kept;
}

/* One binary search a slot. */
void plr_match_slots(plr_filter *f, const plr_observation *seen, unsigned n) {
    plr_workspace *w = &f->work;
    for (unsigned k = 0; k < n; k++)
        w->slot_of[k] = PLR_NO_SLOT;
    for (unsigned slot = 0; slot < f->belief.count; slot++) {
        const uint32_t id = f->belief.slots[slot].id;
        unsigned low = 0, high = n;
        while (low < high) {
            const unsigned middle = (low + high) / 2;
            if (seen[w->order[middle]].id < id)
                low = middle + 1;
            else
                high = middle;
        }
        if (low < n && seen[w->order[low]].id == id) {
            PLR_ASSERT(w->slot_of[low] == PLR_NO_SLOT); /* no two slots have one id */
            w->slot_of[low] = (uint16_t)slot;
            f->belief.slots[slot].last_frame =
                f->belief.frame_number; /* so it is not evicted for another */
        }
    }
}

void plr_match_count(plr_filter *f, unsigned n) {
    for (unsigned k = 0; k < n; k++)
        if (f->work.slot_of[k] != PLR_NO_SLOT) {
            PLR_ASSERT(f->work.slot_of[k] < f->belief.count);
            plr_slot *slot = &f->belief.slots[f->work.slot_of[k]];
            slot->times_seen++;
            slot->last_seen_ns = f->belief.t_ns;
        }
}

void plr_match_known(plr_filter *f, const plr_observation *seen, unsigned n,
                     plr_frame_events *events, plr_report *report) {
    const bool alone = f->config.mode == PLR_MODE_LOCALIZATION;
    if (!plr_map_is_asked(f))
        return;
    unsigned before = report->created;
    for (unsigned k = 0; k < n; k++) {
        const uint32_t id = seen[f->work.order[k]].id;
        plr_landmark known;
        plr_new_landmark landmark;
        if (f->work.slot_of[k] != PLR_NO_SLOT || !plr_map_ask(f, id, &known))
            continue;
        if (!plr_model_of(f)->adopt(f, &known, &landmark)) {
            events->unplaced++;
            continue;
        }
        if (!plr_slots_make_room(f, &report->evicted, &events->sink_failed)) {
            report->no_room = (uint16_t)(report->no_room + alone);
            continue;
        }
        plr_slots_append(f, id, true, &landmark);
        report->created++;
    }
    events->adopted = report->created - before;
    if (events->adopted == 0)
        return;
    plr_match_slots(f, seen, n);
}
