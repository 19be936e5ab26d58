// SPDX-License-Identifier: MIT
#include "filter/births.h"

#include "filter/gate.h"
#include "filter/predict.h"
#include "filter/tracks.h"
#include "known_map/lookup.h"
#include "pelorus/assertions.h"
#include "sensor/stereo.h"
#include "state/sightings.h"
#include "supervise/supervise.h"

bool plr_births_are_allowed(const plr_filter *f) {
    return f->config.mode == PLR_MODE_SLAM || f->config.mode == PLR_MODE_MAPPING;
}

/* Initialises a landmark. A slot must be free, and plr_stereo_makes_landmark true. */
static void append_new(plr_filter *f, const plr_observation *seen) {
    PLR_ASSERT(f->belief.count < PLR_MAX_LANDMARKS &&
               plr_stereo_makes_landmark(&f->belief, &f->camera, seen));
    plr_new_landmark landmark;
    const plr_real beyond = plr_stereo_initialise(&f->belief, &f->camera, seen, &landmark);
    plr_slots_append(&f->belief, seen->id, false, &landmark);
    f->belief.slots[f->belief.count - 1].beyond = beyond;
}

enum { CELLS_ACROSS = 4, CELLS = CELLS_ACROSS * CELLS_ACROSS };

/* The quarter that x lies in, of an image twice as wide as its centre is far from its border. */
static unsigned quarter(plr_real x, plr_real centre) {
    return (unsigned)(x > PLR_R(0.5) * centre) + (x > centre) + (x > PLR_R(1.5) * centre);
}

static unsigned cell_of(const plr_filter *f, const plr_observation *seen) {
    const plr_camera *camera = &f->camera.given;
    return CELLS_ACROSS * quarter((plr_real)seen->vL_px, camera->cy) +
           quarter((plr_real)seen->uL_px, camera->cx);
}

/* Points of a cell of the left image. */
typedef struct plr_cell {
    unsigned seen;     /* that are landmarks, or could be */
    unsigned followed; /* that are, or become landmarks now */
} plr_cell;

/* True if one more point of cell a would be a smaller share of what is seen there than of b. */
static bool is_behind(const plr_cell *a, const plr_cell *b) {
    return (a->followed + 1) * b->seen < (b->followed + 1) * a->seen;
}

/* What becomes of an observation, in the place of its cell. */
enum { MATCHED = CELLS, POOR, BORN };

/* Chooses the observations that become landmarks. Where more are offered than slots are free, all parts of
 * the image have their share (D'Hondt's method), and in each the lowest ids come first: points that lie
 * together tell the same of the motion, those that are spread tell its six numbers apart. To begin where
 * the fewest are followed instead would take wrong matches, which often lie alone. */
static void choose_births(const plr_filter *f, const plr_sightings *sightings,
                          uint8_t fate[PLR_MAX_OBSERVATIONS]) {
    plr_cell cells[CELLS] = {{0, 0}};
    const unsigned n = sightings->count;
    for (unsigned k = 0; k < n; k++) {
        const plr_observation *o = sightings->at[k].seen;
        const unsigned cell = cell_of(f, o);
        const bool matched = plr_is_matched(&sightings->at[k]);
        fate[k] = (uint8_t)(matched                                                ? MATCHED
                            : plr_stereo_makes_landmark(&f->belief, &f->camera, o) ? cell
                                                                                   : POOR);
        cells[cell].seen += fate[k] != POOR;
        cells[cell].followed += matched;
    }
    for (unsigned room = plr_slots_room(&f->belief); room > 0; room--) {
        unsigned next = n;
        for (unsigned k = 0; k < n; k++)
            if (fate[k] < CELLS && (next == n || is_behind(&cells[fate[k]], &cells[fate[next]])))
                next = k;
        if (next == n)
            return;
        cells[fate[next]].followed++;
        fate[next] = BORN;
    }
}

/* Landmarks that a frame makes which rejects nearly all that it matched would agree with its pose in the
 * next frames, against those that show where the body is. */
void plr_births_from_unmatched(plr_filter *f, const plr_sightings *sightings, bool none,
                               plr_frame_events *events, plr_report *report) {
    const bool makes = plr_births_are_allowed(f) && !(none && f->config.model == PLR_MODEL_BODY);
    uint8_t fate[PLR_MAX_OBSERVATIONS];
    if (makes)
        choose_births(f, sightings, fate);
    for (unsigned k = 0; k < sightings->count; k++) {
        const plr_observation *o = sightings->at[k].seen;
        plr_landmark known;
        if (plr_is_matched(&sightings->at[k]))
            continue;
        if (makes && events->left_out && plr_map_is_asked(&f->config, &f->map) &&
            plr_map_ask(&f->map, o->id, &known)) {
            report->poor++; /* it keeps its place in the map, and is asked for again */
            continue;
        }
        if (!makes || fate[k] == POOR) {
            report->poor++;
            continue;
        }
        if (fate[k] != BORN || !plr_slots_make_room(&f->belief, &f->camera, &f->motion, &f->map,
                                                    &report->evicted, &events->sink_failed)) {
            report->no_room++;
            continue;
        }
        append_new(f, o);
        report->created++;
    }
    if (!makes) /* those without a slot are counted in no_room */
        report->poor = (uint16_t)(report->poor - report->no_room);
}

void plr_births_drop_rejected(plr_filter *f, plr_sightings *sightings) {
    for (unsigned k = 0; k < sightings->count; k++) {
        const plr_sighting *row = &sightings->at[k];
        if (plr_is_matched(row) && !plr_gate_accepted(row))
            plr_slots_remove(&f->belief, plr_slots_find(&f->belief, row->seen->id));
    }
    for (unsigned k = 0; k < sightings->count; k++)
        sightings->at[k].slot = plr_slots_find(&f->belief, sightings->at[k].seen->id);
}

plr_status plr_births_restart(plr_filter *f, const plr_sightings *sightings,
                              const plr_report *report) {
    const bool agrees = 2 * report->gated < report->matched;
    if (f->config.model != PLR_MODEL_BODY || !plr_births_are_allowed(f))
        return PLR_OK;
    for (unsigned k = 0; k < sightings->count; k++) {
        const plr_sighting *row = &sightings->at[k];
        if (!plr_is_matched(row) || plr_gate_accepted(row))
            continue;
        const unsigned slot =
            plr_slots_find(&f->belief, row->seen->id); /* a restart may have moved others */
        const plr_slot before = f->belief.slots[slot];
        const bool lost = row->verdict == PLR_GATE_LOST;
        if (!lost &&
            !(agrees && plr_track_may_restart(&before, plr_supervise_left_out(&f->supervisor))))
            continue;
        const bool makes = plr_stereo_makes_landmark(&f->belief, &f->camera, row->seen);
        if (!lost && !makes)
            continue;
        const plr_status status = plr_predict_apply_prior(f);
        if (status != PLR_OK)
            return status;
        plr_slots_remove(&f->belief, slot);
        if (!makes)
            continue;
        append_new(f, row->seen);
        plr_track_restart(&f->belief.slots[f->belief.count - 1], &before);
    }
    return PLR_OK;
}
