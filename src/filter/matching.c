// SPDX-License-Identifier: MIT
#include "filter/matching.h"

#include "filter/filter_internal.h"
#include "filter/gate.h"
#include "known_map/lookup.h"
#include "math/order.h"
#include "pelorus/assertions.h"
#include "state/model.h"
#include "state/sightings.h"

/* A coordinate beyond this lies in no image, px. */
#define MAX_PIXEL 1e6F

static bool is_pixel(float x) {
    return x > -MAX_PIXEL && x < MAX_PIXEL; /* false for NaN too */
}

static bool id_before(const void *context, uint16_t a, uint16_t b) {
    const plr_observation *observations = context;
    return observations[a].id < observations[b].id;
}

/* One row for each index, where no other has its id. */
static void fill_rows(const plr_observation *seen, const uint16_t *order, unsigned n,
                      plr_sightings *sightings, plr_report *report) {
    sightings->count = 0;
    for (unsigned i = 0; i < n;) {
        unsigned end = i + 1;
        while (end < n && seen[order[end]].id == seen[order[i]].id)
            end++;
        if (end == i + 1)
            sightings->at[sightings->count++] =
                (plr_sighting){&seen[order[i]], PLR_NO_SLOT, PLR_GATE_NOT_JUDGED, 0};
        else
            report->duplicates = (uint16_t)(report->duplicates + end - i);
        i = end;
    }
}

void plr_match_in_order(const plr_frame *frame, plr_sightings *sightings, plr_report *report) {
    uint16_t order[PLR_MAX_OBSERVATIONS];
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
    fill_rows(seen, order, n, sightings, report);
}

/* The row of an id; NULL if the frame does not see it. */
static plr_sighting *find(plr_sightings *sightings, uint32_t id) {
    unsigned low = 0, high = sightings->count;
    while (low < high) {
        const unsigned middle = (low + high) / 2;
        if (sightings->at[middle].seen->id < id)
            low = middle + 1;
        else
            high = middle;
    }
    const bool found = low < sightings->count && sightings->at[low].seen->id == id;
    return found ? &sightings->at[low] : NULL;
}

/* One binary search a slot. */
void plr_match_slots(plr_filter *f, plr_sightings *sightings) {
    for (unsigned k = 0; k < sightings->count; k++) {
        PLR_ASSERT(k == 0 || sightings->at[k - 1].seen->id < sightings->at[k].seen->id);
        sightings->at[k].slot = PLR_NO_SLOT;
        sightings->at[k].verdict = PLR_GATE_NOT_JUDGED;
        sightings->at[k].used = 0;
    }
    for (unsigned slot = 0; slot < f->belief.count; slot++) {
        plr_sighting *row = find(sightings, f->belief.slots[slot].id);
        if (!row)
            continue;
        PLR_ASSERT(!plr_is_matched(row)); /* no two slots have one id */
        row->slot = (uint16_t)slot;
        f->belief.slots[slot].last_frame =
            f->belief.frame_number; /* so it is not evicted for another */
    }
}

void plr_match_count(plr_filter *f, const plr_sightings *sightings) {
    for (unsigned k = 0; k < sightings->count; k++) {
        if (!plr_is_matched(&sightings->at[k]))
            continue;
        plr_slot *slot = plr_slot_of(&f->belief, &sightings->at[k]);
        slot->times_seen++;
        slot->last_seen_ns = f->belief.t_ns;
    }
}

void plr_match_known(plr_filter *f, plr_sightings *sightings, plr_frame_events *events,
                     plr_report *report) {
    const bool alone = f->config.mode == PLR_MODE_LOCALIZATION;
    if (!plr_map_is_asked(&f->config, &f->map))
        return;
    unsigned before = report->created;
    for (unsigned k = 0; k < sightings->count; k++) {
        const plr_sighting *row = &sightings->at[k];
        plr_landmark known;
        plr_new_landmark landmark;
        if (plr_is_matched(row) || !plr_map_ask(&f->map, row->seen->id, &known))
            continue;
        if (!plr_model_of(&f->belief)
                 ->adopt(&f->belief, &f->camera, &f->motion, &known, &landmark)) {
            events->unplaced++;
            continue;
        }
        if (!plr_slots_make_room(&f->belief, &f->camera, &f->motion, &f->map, &report->evicted,
                                 &events->sink_failed)) {
            report->no_room = (uint16_t)(report->no_room + alone);
            continue;
        }
        plr_slots_append(&f->belief, row->seen->id, true, &landmark);
        report->created++;
    }
    events->adopted = report->created - before;
    if (events->adopted == 0)
        return;
    plr_match_slots(f, sightings);
}
