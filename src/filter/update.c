// SPDX-License-Identifier: MIT
/*
 * A stereo frame: predict, match, gate, update, retract, evict, initialise, in this order.
 * Observations are looked at by id, so the order in which they arrive changes no bit.
 */
#include <string.h>

#include "filter/consistency.h"
#include "filter/correction.h"
#include "filter/filter_internal.h"
#include "filter/gate.h"
#include "filter/guard.h"
#include "filter/health.h"
#include "filter/motion_first.h"
#include "filter/predict.h"
#include "filter/tracks.h"
#include "math/order.h"
#include "math/small.h"
#include "process/twist.h"
#include "sensor/stereo.h"
#include "state/model.h"
#include "state/motion.h"
#include "state/slots.h"

/* ---------------------------------------------------------------- cleaning and order */

/* A coordinate beyond this lies in no image, px. */
#define MAX_PIXEL 1e6F

static bool is_pixel(float x) {
    return x > -MAX_PIXEL && x < MAX_PIXEL; /* false for NaN too */
}

static bool id_before(const void *context, uint16_t a, uint16_t b) {
    const plr_observation *observations = context;
    return observations[a].id < observations[b].id;
}

/* work.order: the good observations by id. Returns their number; malformed ones are counted, and so
 * are all copies of an id that stands twice: none of them can be told to be the right one. */
static unsigned put_in_order(plr_filter *f, const plr_frame *frame, plr_report *report) {
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

/* ---------------------------------------------------------------- matching */

/* work.slot_of[k] = the slot of observation order[k]: one binary search a slot. */
static void match(plr_filter *f, const plr_observation *seen, unsigned n) {
    plr_workspace *w = &f->work;
    for (unsigned k = 0; k < n; k++)
        w->slot_of[k] = PLR_NO_SLOT;
    for (unsigned slot = 0; slot < f->count; slot++) {
        const uint32_t id = f->slots[slot].id;
        unsigned low = 0, high = n;
        while (low < high) {
            const unsigned middle = (low + high) / 2;
            if (seen[w->order[middle]].id < id)
                low = middle + 1;
            else
                high = middle;
        }
        if (low < n && seen[w->order[low]].id == id) {
            w->slot_of[low] = (uint16_t)slot;
            f->slots[slot].last_frame = f->frame_number; /* so it is not evicted for another */
        }
    }
}

static void count_seen(plr_filter *f, unsigned n) {
    for (unsigned k = 0; k < n; k++)
        if (f->work.slot_of[k] != PLR_NO_SLOT) {
            plr_slot *slot = &f->slots[f->work.slot_of[k]];
            slot->times_seen++;
            slot->last_seen_ns = f->t_ns;
        }
}

/* Asks the map source for the ids that the state does not hold. What it does not know is for
 * initialise_new to count, and in slam what finds no slot is too. */
static void adopt_known(plr_filter *f, const plr_observation *seen, unsigned n,
                        plr_frame_events *events, plr_report *report) {
    const bool alone = f->config.mode == PLR_MODE_LOCALIZATION;
    const bool asks = alone || (f->config.mode == PLR_MODE_SLAM && f->config.known_map);
    if (!asks || !f->map.source)
        return;
    bool moved = false;
    for (unsigned k = 0; k < n; k++) {
        const uint32_t id = seen[f->work.order[k]].id;
        plr_landmark known;
        plr_new_landmark landmark;
        if (f->work.slot_of[k] != PLR_NO_SLOT || !f->map.source(f->map.context, id, &known))
            continue;
        if (!plr_landmark_is_valid(&known) || !plr_model_of(f)->adopt(f, &known, &landmark))
            continue;
        if (!plr_slots_make_room(f, &report->evicted, &events->sink_failed)) {
            report->no_room = (uint16_t)(report->no_room + alone);
            continue;
        }
        plr_slots_append(f, id, true, &landmark);
        report->created++;
        moved = true;
    }
    if (moved)
        match(f, seen, n);
}

/* ---------------------------------------------------------------- gate and budget */

static bool gain_before(const void *context, uint16_t a, uint16_t b) {
    const plr_real *gain = context;
    return gain[a] > gain[b] || (!(gain[a] < gain[b]) && a < b);
}

static bool position_before(const void *context, uint16_t a, uint16_t b) {
    (void)context;
    return a < b;
}

/* In work.gain, where an accepted observation has a positive number. */
#define REJECTED PLR_R(-1)

/* work.used: the positions in order that pass the gate, at most `budget` of them: those with the
 * largest gain, ties to the lower id. */
static unsigned choose(plr_filter *f, const plr_frame *frame, unsigned n, plr_report *report) {
    plr_workspace *w = &f->work;
    unsigned used = 0;
    for (unsigned k = 0; k < n; k++) {
        const uint16_t slot = w->slot_of[k];
        if (slot == PLR_NO_SLOT)
            continue;
        report->matched++;
        plr_track_count(&f->slots[slot], w->gain[k] < 0);
        if (w->gain[k] < 0) {
            report->gated++;
            continue;
        }
        w->used[used++] = (uint16_t)k;
    }
    if (used <= frame->budget)
        return used;
    plr_order_sort(w->used, used, gain_before, w->gain);
    report->left_out = (uint16_t)(used - frame->budget);
    plr_order_sort(w->used, frame->budget, position_before, NULL);
    return frame->budget;
}

/* work.gain by each observation's own prediction: where the motion is given, or has been applied. */
static void gate_each(plr_filter *f, const plr_frame *frame, unsigned n, plr_report *report) {
    plr_workspace *w = &f->work;
    for (unsigned k = 0; k < n; k++) {
        if (w->slot_of[k] == PLR_NO_SLOT)
            continue;
        const plr_verdict verdict =
            plr_gate_judge(f, w->slot_of[k], &frame->observations[w->order[k]]);
        w->gain[k] = verdict.accepted ? verdict.gain : REJECTED;
        report->nis += verdict.accepted ? (float)verdict.d2 : 0;
    }
}

/* ---------------------------------------------------------------- new landmarks */

/* The disparity of a point at infinity lies above this but for one in 700. */
static plr_real least_disparity(const plr_filter *f) {
    return f->config.model == PLR_MODEL_BODY ? PLR_R(-4.25) * PLR_SQRT(f->par.pixel_variance) : 0;
}

/* A landmark stands no further at its birth than where this is its disparity, px: further off, what a
 * single observation says of its bearing would be left to rounding in float32. */
static plr_real farthest_disparity(const plr_filter *f) {
    const plr_real by_range =
        f->par.camera.fx * f->par.camera.baseline * f->par.min_inverse_range * PLR_R(1.5);
    return by_range > PLR_R(0.05) ? by_range : PLR_R(0.05);
}

/* The tests that pixels must pass before they may make a landmark. */
static bool is_worth_a_landmark(const plr_filter *f, const plr_observation *o, plr_real z[3]) {
    z[0] = (plr_real)o->uL_px;
    z[1] = (plr_real)o->uR_px;
    z[2] = PLR_R(0.5) * ((plr_real)o->vL_px + (plr_real)o->vR_px);
    const plr_real disparity = z[0] - z[1];
    const plr_real row_gap = plr_abs((plr_real)o->vL_px - (plr_real)o->vR_px);
    const plr_real least = f->par.min_disparity > 0 ? f->par.min_disparity : least_disparity(f);
    if (!(disparity >= least) || (f->par.max_row_gap > 0 && row_gap > f->par.max_row_gap))
        return false;
    const bool any_depth = f->config.model == PLR_MODEL_BODY && f->par.max_depth <= 0;
    if (any_depth && disparity < farthest_disparity(f))
        return true;
    const plr_real depth = f->par.camera.fx * f->par.camera.baseline / disparity;
    return disparity > 0 && depth >= f->par.min_depth &&
           (f->par.max_depth <= 0 || depth <= f->par.max_depth) &&
           depth * f->par.min_inverse_range < 1;
}

/* Where a point's noise has left it no disparity to stand at, the landmark stands at this one, and what
 * is missing goes into its inverse range besides. */
static plr_real stand_at_some_distance(const plr_filter *f, plr_real z[3]) {
    const plr_real disparity = z[0] - z[1], farthest = farthest_disparity(f);
    if (f->config.model != PLR_MODEL_BODY || disparity >= farthest)
        return 0;
    z[1] = z[0] - farthest;
    return disparity - farthest;
}

/* S_q with S_q S_q^T = Dq R Dq^T, the pixels' noise in the camera; or the course's constant. */
static void initial_factor(const plr_filter *f, const plr_real Dq[9], plr_real S_q[9]) {
    const plr_real constant = f->par.landmark_variance;
    for (unsigned i = 0; i < 9; i++)
        S_q[i] = constant > 0 ? (i % 4 == 0 ? PLR_SQRT(constant) : PLR_R(0))
                              : Dq[i] * PLR_SQRT(plr_gate_noise(f, i % 3));
}

static bool makes_landmarks(const plr_filter *f) {
    return f->config.mode == PLR_MODE_SLAM || f->config.mode == PLR_MODE_MAPPING;
}

/* A slot is free; z from is_worth_a_landmark. */
static void append_new(plr_filter *f, uint32_t id, plr_real z[3]) {
    plr_real q[3], Dq[9], S_q[9];
    plr_new_landmark landmark;
    const plr_real missing = stand_at_some_distance(f, z);
    plr_stereo_back_project(q, Dq, &f->par.camera, z);
    initial_factor(f, Dq, S_q);
    plr_model_of(f)->initialise(f, q, S_q, &landmark);
    plr_slots_append(f, id, false, &landmark);
    /* inverse range is disparity over focal length and baseline, along the ray */
    f->slots[f->count - 1].beyond =
        missing * q[2] / PLR_SQRT(plr_dot3(q, q)) / (f->par.camera.fx * f->par.camera.baseline);
}

static void initialise_new(plr_filter *f, const plr_frame *frame, unsigned n,
                           plr_frame_events *events, plr_report *report) {
    const bool makes = makes_landmarks(f);
    for (unsigned k = 0; k < n; k++) {
        const plr_observation *o = &frame->observations[f->work.order[k]];
        plr_real z[3];
        if (f->work.slot_of[k] != PLR_NO_SLOT)
            continue;
        if (!makes || !is_worth_a_landmark(f, o, z)) {
            report->poor++;
            continue;
        }
        if (!plr_slots_make_room(f, &report->evicted, &events->sink_failed)) {
            report->no_room++;
            continue;
        }
        append_new(f, o->id, z);
        report->created++;
    }
    if (!makes) /* those that found no slot are counted as such already */
        report->poor = (uint16_t)(report->poor - report->no_room);
}

/* ---------------------------------------------------------------- the frame */

/* Drops the landmarks that the gate rejected in this frame: it has been wrong about them for too
 * long. Their observations count as new ones. */
static void unlock(plr_filter *f, const plr_frame *frame, unsigned n) {
    plr_workspace *w = &f->work;
    for (unsigned k = 0; k < n; k++) {
        const bool was_rejected = w->slot_of[k] != PLR_NO_SLOT && w->gain[k] < 0;
        if (was_rejected)
            plr_slots_remove(f, plr_slots_find(f, frame->observations[w->order[k]].id));
    }
    for (unsigned k = 0; k < n; k++)
        w->slot_of[k] = plr_slots_find(f, frame->observations[w->order[k]].id);
}

/* Where most of a frame agrees, a landmark that does not agree for long is the one that is wrong, and begins
 * anew where it is seen now. */
static void begin_anew(plr_filter *f, const plr_frame *frame, unsigned n,
                       const plr_report *report) {
    plr_workspace *w = &f->work;
    const bool may = f->config.model == PLR_MODEL_BODY && makes_landmarks(f);
    if (!may || 2 * report->gated >= report->matched)
        return;
    for (unsigned k = 0; k < n; k++) {
        const plr_observation *o = &frame->observations[w->order[k]];
        plr_real z[3];
        if (w->slot_of[k] == PLR_NO_SLOT || w->gain[k] >= 0)
            continue;
        const unsigned slot = plr_slots_find(f, o->id); /* one that began anew has moved another */
        const plr_slot before = f->slots[slot];
        if (!plr_track_may_begin_anew(&before) || !is_worth_a_landmark(f, o, z))
            continue;
        plr_predict_settle(f);
        plr_slots_remove(f, slot);
        append_new(f, o->id, z);
        plr_track_begin_anew(&f->slots[f->count - 1], &before);
    }
}

/* Is there anything in this frame that needs landmarks and covariance to stand where the body is? If
 * not, the motion goes on being accumulated, and a dark camera stays out of P. */
static bool is_needed(const plr_filter *f, const plr_frame *frame, unsigned n) {
    plr_real z[3];
    for (unsigned k = 0; k < n; k++) {
        const bool used = f->work.slot_of[k] != PLR_NO_SLOT && f->work.gain[k] >= 0;
        const bool born = f->work.slot_of[k] == PLR_NO_SLOT && makes_landmarks(f) &&
                          is_worth_a_landmark(f, &frame->observations[f->work.order[k]], z);
        if (used || born)
            return true;
    }
    return false;
}

/* Finds the motion, judges the observations by it, and corrects. */
static plr_correction motion_first(plr_filter *f, const plr_frame *frame, unsigned n,
                                   plr_report *report) {
    plr_applied_motion believed;
    plr_motion_first first;
    plr_correction correction = {0};
    plr_real Q[36];
    memcpy(Q, f->motion.Q, sizeof Q);
    plr_consistency_widen(f, &believed);
    plr_motion_find(f, frame, n, &first, &report->nis);
    if (!is_needed(f, frame, n)) { /* the motion goes on: as the twists have it */
        memcpy(f->motion.Q, Q, sizeof Q);
        (void)choose(f, frame, n, report);
        return correction;
    }
    plr_predict_apply(f, &first.motion);
    if (f->diverged)
        return correction;
    correction = plr_correct(f, frame->observations, choose(f, frame, n, report));
    if (correction.moved && !f->diverged)
        plr_consistency_add(f, &believed, &first.motion, correction.nu, correction.Lambda,
                            first.contradicted);
    return correction;
}

/* The motion is given, or the observations have no say in it before the update. */
static plr_correction motion_as_given(plr_filter *f, const plr_frame *frame, unsigned n,
                                      plr_report *report) {
    const plr_correction none = {0};
    if (f->motion.pending) {
        plr_applied_motion motion;
        plr_motion_prior(f, &motion);
        plr_predict_apply(f, &motion);
    }
    if (f->diverged)
        return none;
    gate_each(f, frame, n, report);
    return plr_correct(f, frame->observations, choose(f, frame, n, report));
}

static void process(plr_filter *f, const plr_frame *frame, plr_report *report) {
    plr_frame_events events = {0};
    const plr_observation *seen = frame->observations;
    unsigned n = put_in_order(f, frame, report);
    match(f, seen, n);
    adopt_known(f, seen, n, &events, report);
    count_seen(f, n);
    if (f->config.model == PLR_MODEL_BODY && plr_consistency_is_frozen(f, frame, n))
        n = 0; /* it says nothing of now */
    const bool finds = f->motion.pending && f->motion.noisy && f->config.model == PLR_MODEL_BODY &&
                       f->config.mode == PLR_MODE_SLAM;
    const plr_correction correction =
        finds ? motion_first(f, frame, n, report) : motion_as_given(f, frame, n, report);
    report->used = (uint16_t)correction.applied;
    report->blocks_failed = (uint16_t)correction.failed_blocks;
    report->nis_dof = (uint16_t)(4 * (report->matched - report->gated));
    events.cut = correction.cut;
    if (!f->diverged) {
        events.locked = plr_health_gate_is_locked(f, report);
        if (events.locked) {
            plr_predict_settle(f);
            unlock(f, frame, n);
        } else {
            begin_anew(f, frame, n, report);
        }
        initialise_new(f, frame, n, &events, report);
    }
    if (f->diverged) {
        plr_filter_recover(f);
        events.recovered = true;
        match(f, seen, n);
        initialise_new(f, frame, n, &events, report);
    }
    plr_health_judge(f, &events, report);
}

/* Time and mode: may this frame be taken? */
static plr_status check(const plr_filter *f, const plr_frame *frame) {
    if (frame->count > PLR_MAX_OBSERVATIONS || (frame->count > 0 && !frame->observations))
        return PLR_E_ARGUMENT;
    if (f->config.mode == PLR_MODE_MAPPING)
        return f->clock_started && f->t_ns == frame->t_ns ? PLR_OK : PLR_E_MODE;
    if (!f->clock_started)
        return PLR_OK;
    if (frame->t_ns < f->t_ns)
        return PLR_E_LATE;
    if (frame->t_ns - f->t_ns > f->par.max_gap_ns)
        return PLR_E_GAP;
    return plr_twist_check(f, f->reading, plr_seconds(frame->t_ns - f->t_ns));
}

plr_status plr_filter_update(plr_filter *f, const plr_frame *frame, plr_report *report) {
    plr_report scratch;
    plr_report *r = report ? report : &scratch;
    memset(r, 0, sizeof *r);
    if (!f || !frame)
        return r->status = PLR_E_ARGUMENT;
    r->t_ns = frame->t_ns;
    r->budget = frame->budget;
    r->observations = frame->count;
    r->status = plr_guard_look_whole(f);
    if (r->status == PLR_E_DAMAGED)
        plr_health_damaged(f, r);
    if (r->status != PLR_OK)
        return r->status;
    r->status = check(f, frame);
    if (r->status != PLR_OK) {
        f->totals.frames_refused++;
        (void)plr_filter_refuse(f, r->status);
        plr_health_after_refusal(f, r);
        return r->status;
    }
    plr_predict_to(f, frame->t_ns);
    f->frame_number++;
    f->totals.frames++;
    if (f->config.mode != PLR_MODE_DEAD_RECKONING) {
        process(f, frame, r);
    } else {
        plr_predict_settle(f);
        if (f->diverged)
            plr_filter_recover(f);
    }
    r->active = (uint16_t)f->count;
    plr_health_count(f, r);
    plr_guard_seal_whole(f);
    return r->status;
}
