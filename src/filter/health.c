// SPDX-License-Identifier: MIT
#include "filter/health.h"

enum {
    LOCK_FRAMES = 10,     /* successive frames of a gate that rejects nearly all */
    LOCK_MATCHES = 5,     /* fewer matches say nothing about the gate */
    LOST_FRAMES = 10,     /* frames without one used observation */
    FEW_USED = 3,         /* fewer do not fix a pose */
    INERT_MATCHES = 1000, /* a gate that rejects none of so many does nothing */
    NIS_DOF = 20,         /* fewer degrees of freedom say little of the mean */
    NIS_LIMIT = 2         /* mean of d^2 per degree of freedom that the noise does not explain */
};

/* Reasons that leave the estimate as good as it should be. */
#define HARMLESS (PLR_REASON_GATE_INERT | PLR_REASON_NO_ROOM)

bool plr_health_gate_is_locked(plr_filter *f, const plr_report *report) {
    const bool rejects =
        report->matched >= LOCK_MATCHES && 5 * report->gated >= 4 * report->matched;
    f->frames_mostly_gated = rejects ? (uint16_t)(f->frames_mostly_gated + 1) : 0;
    if (f->frames_mostly_gated >= 2 * LOCK_FRAMES) /* locked again */
        f->frames_mostly_gated = LOCK_FRAMES;
    if (f->frames_mostly_gated != LOCK_FRAMES)
        return false;
    f->totals.locks++;
    return true;
}

bool plr_health_fixed_gate_is_open(const plr_filter *f) {
    return f->frames_mostly_gated >= LOCK_FRAMES || f->frames_without_use >= LOST_FRAMES;
}

static void count_up(uint16_t *count, bool more) {
    if (!more)
        *count = 0;
    else if (*count < UINT16_MAX)
        (*count)++;
}

static uint32_t find_reasons(plr_filter *f, const plr_frame_events *events,
                             const plr_report *report) {
    uint32_t reasons = 0;
    count_up(&f->frames_without_use, report->used == 0);
    f->matches_since_gated = report->gated ? 0 : f->matches_since_gated + report->matched;
    if (f->matches_since_gated > INERT_MATCHES)
        f->matches_since_gated = INERT_MATCHES;

    if (report->used < FEW_USED)
        reasons |= PLR_REASON_FEW_OBSERVATIONS;
    if (f->frames_without_use >= LOST_FRAMES)
        reasons |= PLR_REASON_NO_OBSERVATIONS;
    if (events->locked)
        reasons |= PLR_REASON_GATE_LOCKED;
    if (f->matches_since_gated >= INERT_MATCHES &&
        (f->par.gate_d2 > 0 || f->par.gate_residual2 > 0))
        reasons |= PLR_REASON_GATE_INERT;
    if (report->blocks_failed)
        reasons |= PLR_REASON_BLOCK_FAILED;
    if (events->sink_failed)
        reasons |= PLR_REASON_SINK_FAILED;
    if (report->no_room)
        reasons |= PLR_REASON_NO_ROOM;
    if (report->refused || report->duplicates)
        reasons |= PLR_REASON_REFUSED_INPUT;
    if (report->nis_dof >= NIS_DOF && report->nis > (float)(NIS_LIMIT * report->nis_dof))
        reasons |= PLR_REASON_NIS_HIGH;
    if (events->cut)
        reasons |= PLR_REASON_RANGE_LIMITED;
    if (report->left_out)
        reasons |= PLR_REASON_BUDGET;
    return reasons;
}

void plr_health_judge(plr_filter *f, const plr_frame_events *events, plr_report *report) {
    report->reasons = find_reasons(f, events, report);
    f->totals.range_limited += events->cut;
    if (report->reasons & (PLR_REASON_NO_OBSERVATIONS | PLR_REASON_GATE_LOCKED))
        report->health = PLR_HEALTH_LOST;
    else if (report->reasons & ~(unsigned)HARMLESS)
        report->health = PLR_HEALTH_DEGRADED;
    else
        report->health = PLR_HEALTH_GOOD;
}

void plr_health_after_refusal(const plr_filter *f, plr_report *report) {
    report->health = f->diverged ? PLR_HEALTH_DIVERGED : PLR_HEALTH_DEGRADED;
    report->reasons = f->diverged ? PLR_REASON_NOT_POSITIVE : 0;
    report->active = (uint16_t)f->count;
}

void plr_health_damaged(plr_filter *f, plr_report *report) {
    f->totals.damaged++; /* the sums stay wrong */
    report->health = PLR_HEALTH_DIVERGED;
    report->reasons = PLR_REASON_STATE_DAMAGED;
}

void plr_health_count(plr_filter *f, const plr_report *report) {
    plr_totals *t = &f->totals;
    t->blocks_failed += report->blocks_failed;
    t->observations += report->observations;
    t->matched += report->matched;
    t->used += report->used;
    t->gated += report->gated;
    t->created += report->created;
    t->evicted += report->evicted;
}
