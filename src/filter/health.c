// SPDX-License-Identifier: MIT
#include "filter/health.h"

#include <string.h>

#include "filter/consistency.h"
#include "filter/filter_internal.h"
#include "filter/guard.h"
#include "filter/readings.h"
#include "process/alignment.h"

enum {
    LOCK_FRAMES = 10,    /* successive frames of a gate that rejects nearly all */
    LOCK_MATCHES = 3,    /* with fewer matches the gate is not judged */
    LOST_FRAMES = 10,    /* frames without one used observation */
    FEW_USED = 3,        /* fewer do not fix a pose */
    INERT_MATCHES = 1000 /* a gate that rejects none of so many has no effect */
};

/* After so long without observations the pose counts as lost, s. */
#define LOST_S 1.0
/* A position bounds the pose for so long, s. */
#define POSITION_S 2.0
/* The last twist is too old after this many of the intervals between twists, plus this time in
 * s. */
#define HELD_INTERVALS 3.0
#define HELD_S         0.05

/* Reasons that leave the estimate as good as it should be, and health GOOD: types.h names them. */
#define HARMLESS (PLR_REASON_GATE_INERT | PLR_REASON_NO_ROOM | PLR_REASON_NIS_LOW)
/* Reasons that do not apply in dead reckoning. */
#define OBSERVATION_REASONS (PLR_REASON_FEW_OBSERVATIONS | PLR_REASON_NO_OBSERVATIONS)
/* Reasons that hold now or not at all, whatever the last frame said. */
#define IMU_REASONS (PLR_REASON_NOT_STARTED | PLR_REASON_IMU_FAULT)
/* Reasons by which the pose is lost. */
#define LOST                                                                                       \
    (PLR_REASON_NO_OBSERVATIONS | PLR_REASON_GATE_LOCKED | PLR_REASON_NO_FRAMES |                  \
     PLR_REASON_NOT_STARTED)

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

static double seconds_since(plr_time_ns then, plr_time_ns now) {
    return now < then ? 0 : (double)(now - then) * 1e-9; /* PLR_NEVER_NS is later than any time */
}

static bool readings_are_old(const plr_filter *f, plr_time_ns now) {
    const double held = seconds_since(f->reading_ns, now);
    return f->config.mode != PLR_MODE_MAPPING &&
           (!f->reading_valid || held > HELD_INTERVALS * (double)f->interval_s + HELD_S);
}

bool plr_health_readings_are_old(const plr_filter *f) {
    return readings_are_old(f, f->t_ns);
}

/* True if a twist was refused since the last frame, or if the last one is too old. */
static bool lacks_twists(const plr_filter *f, plr_time_ns now) {
    const bool refused = f->totals.twists_refused != f->refused_before;
    return (refused && f->config.mode != PLR_MODE_MAPPING) || readings_are_old(f, now);
}

/* The same of a frame, and a fault of an IMU has passed if readings come again. */
static uint32_t judge_readings(plr_filter *f) {
    const bool lacking = lacks_twists(f, f->t_ns);
    f->refused_before = f->totals.twists_refused;
    if (lacking)
        return PLR_REASON_NO_TWISTS;
    if (f->inertial.fault >= PLR_IMU_FAULT_SATURATED)
        f->inertial.fault = PLR_IMU_FAULT_NONE;
    return 0;
}

static uint32_t rejected_readings(const plr_filter *f) {
    return plr_readings_are_wrong(f) ? PLR_REASON_READINGS_REJECTED : 0;
}

/* What an IMU has to say. A faulty reading counts while readings are refused, a fault of the start
 * for as long as it stands. */
static uint32_t imu_reasons(const plr_filter *f) {
    uint32_t reasons = 0;
    const plr_imu_fault fault = (plr_imu_fault)f->inertial.fault;
    if (f->config.process != PLR_PROCESS_IMU || f->config.mode == PLR_MODE_MAPPING)
        return 0;
    if (!f->inertial.started)
        reasons |= PLR_REASON_NOT_STARTED;
    if (plr_alignment_is_unsettled(f))
        reasons |= PLR_REASON_POSE_MAY_BE_WRONG;
    if (fault != PLR_IMU_FAULT_NONE && fault != PLR_IMU_FAULT_MOVES)
        reasons |= PLR_REASON_IMU_FAULT;
    return reasons;
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
    if (f->frames_without_use >= LOST_FRAMES ||
        (f->frames_without_use > 0 && seconds_since(f->last_use_ns, f->t_ns) > LOST_S))
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
    if (events->cut)
        reasons |= PLR_REASON_RANGE_LIMITED;
    if (report->left_out)
        reasons |= PLR_REASON_BUDGET;
    if (events->recovered)
        reasons |= PLR_REASON_NOT_POSITIVE | PLR_REASON_RECOVERED;
    if (events->relocated)
        reasons |= PLR_REASON_RELOCATED;
    if (events->map_disagrees)
        reasons |= PLR_REASON_MAP_DISAGREES;
    reasons |= rejected_readings(f) | judge_readings(f);
    return reasons | imu_reasons(f);
}

/* The reasons by which the pose is lost at a time. A position that was used not long ago does for
 * the pose what the camera does not. */
static uint32_t lost_by(const plr_filter *f, plr_time_ns now) {
    const bool positioned = f->last_position_ns != PLR_NEVER_NS &&
                            seconds_since(f->last_position_ns, now) <= POSITION_S;
    return positioned ? PLR_REASON_GATE_LOCKED | PLR_REASON_NOT_STARTED : LOST;
}

static plr_health health_of(uint32_t reasons, uint32_t lost) {
    if (reasons & PLR_REASON_STATE_DAMAGED)
        return PLR_HEALTH_DIVERGED;
    if (reasons & lost)
        return PLR_HEALTH_LOST;
    return reasons & ~(uint32_t)HARMLESS ? PLR_HEALTH_DEGRADED : PLR_HEALTH_GOOD;
}

void plr_health_judge(plr_filter *f, const plr_frame_events *events, plr_report *report) {
    report->reasons = find_reasons(f, events, report);
    const uint32_t lost = lost_by(f, f->t_ns);
    report->reasons |= plr_consistency_judge(f, report, (report->reasons & lost) != 0);
    report->health = health_of(report->reasons, lost);
    f->totals.range_limited += events->cut;
    f->last_frame_ns = f->t_ns;
    if (report->used > 0) {
        f->last_use_ns = f->t_ns;
        plr_filter_store_for_recovery(f);
    }
    f->health = (uint8_t)report->health;
    f->reasons = report->reasons;
}

void plr_health_dead_reckons(plr_filter *f) {
    f->reasons = (f->reasons & OBSERVATION_REASONS) | judge_readings(f);
    f->health = (uint8_t)health_of(f->reasons & ~(uint32_t)OBSERVATION_REASONS, LOST);
}

void plr_health_waits(plr_filter *f, plr_report *report) {
    report->reasons = judge_readings(f);
    report->reasons |= imu_reasons(f);
    report->health = PLR_HEALTH_LOST;
    f->last_frame_ns = f->t_ns;
    f->health = (uint8_t)report->health;
    f->reasons = report->reasons;
}

void plr_health_after_refusal(const plr_filter *f, plr_report *report) {
    report->health = f->health == PLR_HEALTH_GOOD ? PLR_HEALTH_DEGRADED : (plr_health)f->health;
    report->reasons = f->reasons;
    report->active = (uint16_t)f->count;
}

void plr_health_damaged(plr_filter *f, plr_report *report) {
    f->totals.damaged++; /* the sums stay wrong */
    report->health = PLR_HEALTH_DIVERGED;
    report->reasons = PLR_REASON_STATE_DAMAGED;
}

static double seconds_if(bool ever, plr_time_ns then, plr_time_ns now) {
    return ever ? seconds_since(then, now) : (double)__builtin_inf();
}

plr_status plr_filter_health(const plr_filter *f, plr_time_ns t_ns, plr_health_state *health) {
    if (!f || !health)
        return PLR_E_ARGUMENT;
    memset(health, 0, sizeof *health);
    const plr_status sound = plr_guard_check(f);
    if (sound != PLR_OK) {
        health->health = PLR_HEALTH_DIVERGED;
        health->reasons = sound == PLR_E_DAMAGED ? PLR_REASON_STATE_DAMAGED : 0;
        return sound;
    }
    const plr_time_ns now = t_ns > f->t_ns ? t_ns : f->t_ns;
    const bool looks = f->config.mode != PLR_MODE_DEAD_RECKONING;
    health->reasons =
        f->reasons & ~(uint32_t)(looks ? IMU_REASONS : OBSERVATION_REASONS | IMU_REASONS);
    health->seconds_without_frame =
        seconds_if(f->last_frame_ns != PLR_NEVER_NS, f->last_frame_ns, now);
    health->seconds_without_use = seconds_if(f->last_use_ns != PLR_NEVER_NS, f->last_use_ns, now);
    health->seconds_without_twist = seconds_if(f->reading_valid, f->reading_ns, now);
    health->resets = f->totals.resets + f->totals.widened;
    if (looks && health->seconds_without_frame > LOST_S)
        health->reasons |= PLR_REASON_NO_FRAMES;
    if (looks && health->seconds_without_use > LOST_S)
        health->reasons |= PLR_REASON_NO_OBSERVATIONS;
    if (lacks_twists(f, now))
        health->reasons |= PLR_REASON_NO_TWISTS;
    health->reasons |= rejected_readings(f) | imu_reasons(f);
    health->health = health_of(health->reasons, lost_by(f, now));
    return PLR_OK;
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
