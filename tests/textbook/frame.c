// SPDX-License-Identifier: MIT
/* A stereo frame. */
#include <string.h>

#include "textbook/the_filter.h"

enum { LOCK_FRAMES = 10, LOST_FRAMES = 10, LOCK_MATCHES = 5, FEW_USED = 3 };

static bool is_pixel(float x) {
    return x > -1e6F && x < 1e6F;
}

/* The frame's observations without those that are malformed or whose id stands twice, by id. */
static unsigned clean(const plr_frame *frame, plr_observation *good, plr_report *report) {
    unsigned n = 0, kept = 0;
    for (unsigned i = 0; i < frame->count; i++) {
        const plr_observation *o = &frame->observations[i];
        if (!is_pixel(o->uL_px) || !is_pixel(o->vL_px) || !is_pixel(o->uR_px) ||
            !is_pixel(o->vR_px)) {
            report->refused++;
            continue;
        }
        unsigned at = n++;
        for (; at > 0 && good[at - 1].id > o->id; at--)
            good[at] = good[at - 1];
        good[at] = *o;
    }
    for (unsigned i = 0, end; i < n; i = end) {
        for (end = i + 1; end < n && good[end].id == good[i].id;)
            end++;
        if (end == i + 1)
            good[kept++] = good[i];
        else
            report->duplicates = (uint16_t)(report->duplicates + end - i);
    }
    return kept;
}

static void adopt_known(const plr_frame *frame, plr_report *report) {
    const plr_config *c = &the.book.config;
    const bool asks =
        c->mode == PLR_MODE_LOCALIZATION || (c->mode == PLR_MODE_SLAM && c->known_map != 0);
    for (unsigned i = 0; asks && the.map.source && i < frame->count; i++) {
        plr_landmark known;
        const uint32_t id = frame->observations[i].id;
        if (textbook_place(&the.book, id) == the.book.count &&
            the.map.source(the.map.context, id, &known) && textbook_insert_known(&the.book, &known))
            report->created++;
    }
}

/* New landmarks; and, from a gate that has locked, those that it rejected anew (docs/MATH.md 13). */
static void create(const plr_frame *frame, bool locked, plr_report *report) {
    const bool makes =
        the.book.config.mode == PLR_MODE_SLAM || the.book.config.mode == PLR_MODE_MAPPING;
    for (unsigned i = 0; i < frame->count; i++) {
        const plr_observation *o = &frame->observations[i];
        const unsigned at = textbook_place(&the.book, o->id);
        textbook_landmark *held = at < the.book.count ? &the.book.landmarks[at] : NULL;
        if (held)
            held->dropped |= locked && held->rejected && !held->known;
        if (held && !held->dropped)
            continue;
        if (makes && textbook_create(&the.book, at, frame->t_ns, o))
            report->created++;
        else
            report->poor++;
    }
}

static bool is_locked(const plr_report *r) {
    const bool rejects = r->matched >= LOCK_MATCHES && 5 * r->gated >= 4 * r->matched;
    the.frames_mostly_gated = rejects ? the.frames_mostly_gated + 1 : 0;
    the.frames_without_use = r->used > 0 ? 0 : the.frames_without_use + 1;
    the.book.gate_open =
        the.frames_mostly_gated >= LOCK_FRAMES || the.frames_without_use >= LOST_FRAMES;
    const bool locked = rejects && the.frames_mostly_gated % LOCK_FRAMES == 0;
    the.totals.locks += locked;
    return locked;
}

static void judge(plr_report *r, bool locked, bool failed) {
    r->health = PLR_HEALTH_GOOD;
    if (r->used < FEW_USED)
        r->reasons |= PLR_REASON_FEW_OBSERVATIONS;
    if (failed)
        r->reasons |= PLR_REASON_BLOCK_FAILED;
    if (r->refused || r->duplicates)
        r->reasons |= PLR_REASON_REFUSED_INPUT;
    if (r->reasons)
        r->health = PLR_HEALTH_DEGRADED;
    if (locked)
        r->reasons |= PLR_REASON_GATE_LOCKED;
    if (the.frames_without_use >= LOST_FRAMES)
        r->reasons |= PLR_REASON_NO_OBSERVATIONS;
    if (locked || the.frames_without_use >= LOST_FRAMES)
        r->health = PLR_HEALTH_LOST;
}

static void process(const plr_frame *given, plr_report *r) {
    static plr_observation good[PLR_MAX_OBSERVATIONS];
    plr_frame frame = *given;
    frame.observations = good;
    frame.count = (uint16_t)clean(given, good, r);
    adopt_known(&frame, r);
    const textbook_report came = textbook_update(&the.book, frame.t_ns, &frame);
    r->matched = (uint16_t)came.matched;
    r->used = (uint16_t)came.used;
    r->gated = (uint16_t)came.gated;
    r->nis = (float)came.nis;
    r->nis_dof = (uint16_t)(TEXTBOOK_ROWS * (came.matched - came.gated));
    r->innovation_rows = (uint16_t)(3 * came.used);
    r->innovation_d2 = (float)came.d2;
    r->innovation_log_det = (float)came.log_det;
    r->blocks_failed = came.failed;
    const bool locked = is_locked(r);
    if (!the.book.diverged)
        create(&frame, locked, r);
    judge(r, locked, came.failed);
}

static plr_status check(const plr_frame *frame) {
    if (frame->count > PLR_MAX_OBSERVATIONS || frame->count > the.book.most_seen)
        return PLR_E_ARGUMENT;
    if (the.book.config.mode == PLR_MODE_MAPPING)
        return the.clock_started && the.t_ns == frame->t_ns ? PLR_OK : PLR_E_MODE;
    if (the.clock_started && frame->t_ns < the.t_ns)
        return PLR_E_LATE;
    if (the.clock_started && the_filter_finds_a_gap(frame->t_ns))
        return PLR_E_GAP;
    return PLR_OK;
}

static void add_to_totals(const plr_report *r) {
    the.totals.frames++;
    the.totals.blocks_failed += r->blocks_failed;
    the.totals.observations += r->observations;
    the.totals.matched += r->matched;
    the.totals.used += r->used;
    the.totals.gated += r->gated;
    the.totals.created += r->created;
}

plr_status plr_filter_update(plr_filter *f, const plr_frame *frame, plr_report *report) {
    plr_report scratch;
    (void)f;
    if (!report)
        report = &scratch;
    memset(report, 0, sizeof *report);
    report->t_ns = frame->t_ns;
    report->budget = frame->budget;
    report->observations = frame->count;
    if (!the.ready)
        return report->status = PLR_E_NOT_READY;
    report->status = check(frame);
    if (report->status != PLR_OK) {
        report->health = PLR_HEALTH_DEGRADED;
        return the_filter_refuses(report->status);
    }
    the_filter_holds_until(frame->t_ns);
    if (the.book.config.mode != PLR_MODE_DEAD_RECKONING && !the.book.diverged)
        process(frame, report);
    if (the.book.diverged) {
        report->status = PLR_E_DIVERGED;
        report->health = PLR_HEALTH_DIVERGED;
        report->reasons |= PLR_REASON_NOT_POSITIVE;
        if (the.totals.diverged_ns == 0)
            the.totals.diverged_ns = frame->t_ns;
    }
    report->active = (uint16_t)the.book.count;
    add_to_totals(report);
    return report->status;
}
