// SPDX-License-Identifier: MIT
/*
 * A stereo frame: predict, match, take up known landmarks, find the motion, gate, correct, evict, initialise, in this order.
 * Observations are processed in the order of their ids, so the order in which they arrive changes
 * no bit.
 */
#include <string.h>

#include "filter/births.h"
#include "filter/considered_bias.h"
#include "filter/correction.h"
#include "filter/evidence.h"
#include "filter/filter_internal.h"
#include "filter/gate.h"
#include "filter/guard.h"
#include "filter/inertial.h"
#include "filter/matching.h"
#include "filter/measure.h"
#include "filter/motion_first.h"
#include "filter/predict.h"
#include "filter/relocate.h"
#include "filter/tracks.h"
#include "math/dense.h"
#include "math/order.h"
#include "pelorus/assertions.h"
#include "process/alignment.h"
#include "process/process.h"
#include "process/velocity.h"
#include "sensor/sensor.h"
#include "sensor/stereo.h"
#include "state/blocks.h"
#include "state/calibration.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/motion.h"
#include "state/seconds.h"
#include "state/slots.h"
#include "supervise/supervise.h"

/* ---------------------------------------------------------------- gate and budget */

static bool gain_before(const void *context, uint16_t a, uint16_t b) {
    const plr_workspace *w = context;
    PLR_ASSERT(w->slot_of[a] != PLR_NO_SLOT && w->slot_of[b] != PLR_NO_SLOT);
    const plr_real gain_a = w->gain[w->slot_of[a]], gain_b = w->gain[w->slot_of[b]];
    return gain_a > gain_b || (!(gain_a < gain_b) && a < b);
}

static bool position_before(const void *context, uint16_t a, uint16_t b) {
    (void)context;
    return a < b;
}

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
        plr_track_count(&f->belief.slots[slot], (plr_gate_result)w->verdict[slot]);
        if (!plr_gate_accepted(f, slot)) {
            report->gated++;
            continue;
        }
        w->used[used++] = (uint16_t)k;
    }
    if (used <= frame->budget)
        return used;
    plr_order_sort(w->used, used, gain_before, w);
    report->left_out = (uint16_t)(used - frame->budget);
    plr_order_sort(w->used, frame->budget, position_before, NULL);
    return frame->budget;
}

/* Gates each observation by its own prediction, when the motion has been applied already, and keeps the
 * measurements. */
static void gate_each(plr_filter *f, const plr_frame *frame, unsigned n, plr_report *report) {
    plr_workspace *w = &f->work;
    for (unsigned k = 0; k < n; k++) {
        const uint16_t slot = w->slot_of[k];
        if (slot == PLR_NO_SLOT)
            continue;
        plr_verdict verdict = {.accepted = false};
        plr_measurement m;
        if (plr_stereo_measure(f, slot, &frame->observations[w->order[k]], &m)) {
            verdict = plr_gate_judge(f, &m);
            plr_measurement_keep(f, slot, &m);
        }
        plr_gate_note(f, slot,
                      verdict.accepted ? PLR_GATE_ACCEPTED : plr_gate_rejection(verdict.d2),
                      verdict.gain);
        report->nis += verdict.accepted ? (float)verdict.d2 : 0;
    }
}

/* ---------------------------------------------------------------- the frame */

/* True if the frame uses or creates a landmark. Otherwise the motion is not applied and goes on
 * accumulating, so that a dark camera does not affect P. */
static bool needs_motion_applied(const plr_filter *f, const plr_frame *frame, unsigned n) {
    for (unsigned k = 0; k < n; k++) {
        const uint16_t slot = f->work.slot_of[k];
        const bool used = slot != PLR_NO_SLOT && plr_gate_accepted(f, slot);
        const bool born = slot == PLR_NO_SLOT && plr_births_are_allowed(f) &&
                          plr_stereo_makes_landmark(f, &frame->observations[f->work.order[k]]);
        if (used || born)
            return true;
    }
    return false;
}

/* Keeps the measurements of the first `used` of work.used, where the gate has judged without them.
 * One whose landmark the motion has moved behind the camera has no effect. */
static void measure_used(plr_filter *f, const plr_frame *frame, unsigned used) {
    for (unsigned i = 0; i < used; i++) {
        const uint16_t k = f->work.used[i], slot = f->work.slot_of[k];
        plr_measurement m;
        (void)plr_stereo_measure(f, slot, &frame->observations[f->work.order[k]], &m);
        plr_measurement_keep(f, slot, &m);
    }
}

/* The gate's counts, for the supervisor. */
static plr_search_decision ask_after_search(plr_filter *f, unsigned n, bool outright) {
    plr_search_evidence e = {.outright = outright, .now_ns = f->belief.t_ns};
    for (unsigned k = 0; k < n; k++)
        if (f->work.slot_of[k] != PLR_NO_SLOT) {
            e.matched++;
            e.gated += !plr_gate_accepted(f, f->work.slot_of[k]);
        }
    return plr_supervise_search(&f->supervisor, &e);
}

/* Finds the motion, judges the observations by it, and corrects. A frame that needs no motion applied, or
 * that waits for the next one, leaves it accumulating. */
static plr_correction motion_first(plr_filter *f, const plr_frame *frame, unsigned n,
                                   plr_search_decision *decision, plr_report *report) {
    plr_motion_first first;
    plr_considered_bias before;
    plr_correction correction = {0};
    plr_applied_motion stated;
    plr_evidence_pose by_odometry;
    plr_motion_prior(f, 1, &stated);
    plr_evidence_note_pose(f, &by_odometry);
    plr_motion_find(f, frame, n, &first, &report->nis);
    *decision = ask_after_search(f, n, first.outright);
    if (decision->wait || !needs_motion_applied(f, frame, n)) {
        report->nis = decision->wait ? 0 : report->nis;
        if (!decision->wait)
            (void)choose(f, frame, n, report);
        return correction;
    }
    plr_bias_consider(f, decision->hold_biases, &before);
    if (first.outright)
        plr_motion_open_velocity(f);
    plr_predict_apply(f, &first.motion);
    if (f->diverged)
        return correction;
    const unsigned used = choose(f, frame, n, report);
    measure_used(f, frame, used);
    correction = plr_correct(f, used, NULL, 0);
    if (f->diverged)
        return correction;
    plr_bias_restore(f, &before);
    if (correction.moved)
        plr_evidence_of_motion(f, &by_odometry, &stated, &first, &correction);
    return correction;
}

/* The motion is known exactly, or is not searched for: predict, gate, correct. */
static plr_correction motion_as_given(plr_filter *f, const plr_frame *frame, unsigned n,
                                      plr_search_decision *decision, plr_report *report) {
    const plr_correction none = {0};
    plr_predict_apply_pending(f);
    if (f->diverged)
        return none;
    gate_each(f, frame, n, report);
    *decision = ask_after_search(f, n, false);
    return plr_correct(f, choose(f, frame, n, report), NULL, 0);
}

/* Since the last frame the tracks have wandered off their points. */
static void let_tracks_drift(plr_filter *f) {
    if (f->supervisor.last_frame_ns == PLR_NEVER_NS || !(f->camera.track_drift_variance > 0))
        return;
    const plr_real seconds = plr_seconds(f->belief.t_ns - f->supervisor.last_frame_ns);
    plr_model_of(f)->drift(f, PLR_SQRT(f->camera.track_drift_variance * seconds));
}

/* Known landmarks come in, at a pose that is found anew if need be. */
static void take_up_known(plr_filter *f, const plr_frame *frame, unsigned n,
                          plr_frame_events *events, plr_report *report) {
    const plr_observation *seen = frame->observations;
    events->relocated = events->left_out = plr_relocate_when_lost(f, frame, n, events);
    if (events->relocated) {
        report->created = (uint16_t)f->belief.count;
        plr_match_slots(f, seen, n);
        return;
    }
    plr_match_known(f, seen, n, events, report);
    events->left_out = events->unplaced > 0;
    const unsigned came_in = events->adopted;
    const plr_relocation found = plr_relocate_when_uncertain(f, frame, n, events);
    if (came_in > 0 && found != PLR_LEFT_OUT)
        plr_alignment_keep_world(f);
    if (found == PLR_PLACED)
        return;
    report->created = report->no_room = 0; /* they come in again */
    events->unplaced = 0;
    plr_match_slots(f, seen, n);
    if (found == PLR_LEFT_OUT) {
        events->left_out = true;
        events->unplaced = came_in;
    } else if (!f->diverged) {
        plr_match_known(f, seen, n, events, report);
    }
    events->adopted = 0; /* the pose has been held against the map already */
}

/* Corrects by the observations, and fills the report with how. */
static void correct(plr_filter *f, const plr_frame *frame, unsigned n,
                    plr_search_decision *decision, plr_report *report) {
    const bool finds = f->motion.pending && f->motion.noisy && f->config.model == PLR_MODEL_BODY;
    plr_evidence_pose before;
    const bool sees_map = plr_evidence_before_map(f, n, &before);
    const plr_correction correction = finds ? motion_first(f, frame, n, decision, report)
                                            : motion_as_given(f, frame, n, decision, report);
    report->used = (uint16_t)correction.applied;
    report->blocks_failed = (uint16_t)correction.failed_batches;
    report->innovation_rows = (uint16_t)correction.innovation.rows;
    report->innovation_d2 = (float)correction.innovation.d2;
    report->innovation_log_det = (float)correction.innovation.log_det;
    report->nis_dof = (uint16_t)(4 * (report->matched - report->gated));
    f->work.evidence.events.cut = correction.cut;
    if (sees_map && !f->diverged)
        plr_evidence_after_map(f, &before);
}

/* After the correction: a lock is undone, and landmarks begin. */
static void renew_landmarks(plr_filter *f, const plr_frame *frame, unsigned n,
                            const plr_search_decision *decision, plr_report *report) {
    plr_frame_events *events = &f->work.evidence.events;
    plr_relocate_watch(f, n, events->unplaced);
    if (decision->drop_rejected) {
        events->locked = true;
        f->totals.locks++;
        plr_predict_apply_prior(f);
        plr_births_drop_rejected(f, frame, n);
    } else if (!decision->wait) {
        plr_births_restart(f, frame, n, report);
    }
    plr_births_from_unmatched(f, frame, n, decision->make_none, events, report);
}

/* Of a covariance of the pose that part which nothing in the filter measures, where an IMU does measure the tilt:
 * C <- A C A^T, A = I but for the rotation's rows, which keep what is about the vertical u alone. */
static void keep_position_and_heading(const plr_filter *f, plr_real C[PLR_POSE_SQUARE]) {
    const plr_real *u = f->belief.R_WB + 6;
    plr_real A[PLR_POSE_SQUARE] = {0}, kept[PLR_POSE_SQUARE];
    for (unsigned i = 0; i < 3; i++) {
        A[(PLR_POSE_DIM + 1) * i] = 1;
        for (unsigned j = 0; j < 3; j++)
            A[PLR_POSE_DIM * (3 + i) + 3 + j] = u[i] * u[j];
    }
    plr_sandwich6(kept, A, C);
    memcpy(C, kept, sizeof kept);
}

/* What the supervisor has decided on the frame. */
static void carry_out(plr_filter *f, plr_report *report) {
    plr_frame_decision decision;
    plr_evidence_complete(f);
    plr_supervise_frame(&f->supervisor, &f->work.evidence, report, &decision);
    report->health = decision.health;
    report->reasons = decision.reasons;
    f->totals.contradictions += decision.contradicted_now;
    f->totals.range_limited += f->work.evidence.events.cut;
    if (report->used > 0)
        plr_filter_store_for_recovery(f);
    if (!decision.covers)
        return;
    if (plr_has_block(f, PLR_BLOCK_VELOCITY))
        keep_position_and_heading(f, decision.cover);
    plr_covariance_add(f, PLR_BLOCK_POSE, decision.cover);
    plr_relocate_let_go(f, decision.cover);
    f->totals.widened++;
}

static void process(plr_filter *f, const plr_frame *frame, plr_report *report) {
    plr_frame_events *events = &f->work.evidence.events;
    plr_search_decision decision = {false, false, false, false};
    unsigned n = plr_match_in_order(f, frame, report);
    plr_match_slots(f, frame->observations, n);
    plr_evidence_of_picture(f, frame, n);
    const bool frozen = f->config.model == PLR_MODEL_BODY &&
                        !plr_supervise_picture(&f->supervisor, &f->work.evidence.picture);
    if (!frozen)
        take_up_known(f, frame, n, events, report);
    const unsigned matched = n;
    let_tracks_drift(f);
    if (frozen)
        n = 0; /* it does not show the present */
    plr_reading still;
    plr_reading_result unused = {0};
    const bool stands = f->source.reading_valid && plr_standstill_is_seen(f, frame, n, &still);
    const bool is_state = plr_process_of(f)->measure != NULL;
    if (stands && !is_state)
        (void)plr_measure_twist(f, &still, &unused);
    correct(f, frame, n, &decision, report);
    plr_match_count(f, matched);
    if (!f->diverged)
        renew_landmarks(f, frame, n, &decision, report);
    if (f->diverged) {
        plr_filter_recover(f);
        events->recovered = true;
        plr_match_slots(f, frame->observations, n);
        plr_births_from_unmatched(f, frame, n, false, events, report);
    } else if (stands && is_state) {
        (void)plr_measure_twist(f, &still, &unused);
    }
    plr_filter_follow_start(f, report);
    carry_out(f, report);
}

/* Before an IMU's start nothing moves; the pictures only say whether the body stands. */
static void wait_for_start(plr_filter *f, const plr_frame *frame, plr_report *report) {
    const unsigned n = plr_match_in_order(f, frame, report);
    plr_filter_watch_start(f, frame, n);
    const plr_readings_evidence now = plr_filter_readings_at(f, f->belief.t_ns);
    plr_supervise_waits(&f->supervisor, &now, report);
}

/* Checks the frame's time and the mode. */
static plr_status check(const plr_filter *f, const plr_frame *frame) {
    if (frame->count > PLR_MAX_OBSERVATIONS || (frame->count > 0 && !frame->observations))
        return PLR_E_ARGUMENT;
    if (f->config.mode == PLR_MODE_MAPPING)
        return f->clock_started && f->belief.t_ns == frame->t_ns ? PLR_OK : PLR_E_MODE;
    if (!f->clock_started)
        return PLR_OK;
    if (frame->t_ns < f->belief.t_ns)
        return PLR_E_LATE;
    if (frame->t_ns - f->belief.t_ns > f->par.max_gap_ns)
        return PLR_E_GAP;
    return plr_process_of(f)->check(f, f->source.reading,
                                    plr_seconds(frame->t_ns - f->belief.t_ns));
}

/* A frame of dead reckoning: applies the motion, and the velocities' information about the
 * biases. */
static void dead_reckon(plr_filter *f) {
    if (f->motion.pending && plr_velocity_informs_bias(f)) {
        plr_predict_apply_pending(f);
        if (!f->diverged)
            (void)plr_correct(f, 0, NULL, 0);
    } else {
        plr_predict_apply_prior(f);
    }
    if (f->diverged)
        plr_filter_recover(f);
}

static void count(plr_filter *f, const plr_report *report) {
    plr_totals *t = &f->totals;
    t->blocks_failed += report->blocks_failed;
    t->observations += report->observations;
    t->matched += report->matched;
    t->used += report->used;
    t->gated += report->gated;
    t->created += report->created;
    t->evicted += report->evicted;
}

/* How the camera moves, should its clock be off. */
static void note_twist(plr_filter *f) {
    plr_real twist[PLR_POSE_DIM], change[3] = {0}, P_u[PLR_POSE_SQUARE];
    if (!plr_calibration_needs_twist(f))
        return;
    plr_process_of(f)->now(f, twist, P_u);
    if (plr_process_of(f)->changes)
        plr_process_of(f)->changes(f, twist, change);
    plr_calibration_at_frame(f, twist, change, P_u);
}

static plr_status refuse_damaged(plr_filter *f, plr_report *report) {
    if (report->status == PLR_E_DAMAGED) {
        f->totals.damaged++; /* the sums stay wrong */
        report->health = PLR_HEALTH_DIVERGED;
        report->reasons = PLR_REASON_STATE_DAMAGED;
    }
    return report->status;
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
    r->status = plr_guard_check_whole(f);
    if (r->status != PLR_OK)
        return refuse_damaged(f, r);
    r->status = check(f, frame);
    if (r->status != PLR_OK) {
        f->totals.frames_refused++;
        (void)plr_filter_refuse(f, r->status);
        plr_supervise_refused(&f->supervisor, r);
        r->active = (uint16_t)f->belief.count;
        return r->status;
    }
    plr_predict_to(f, frame->t_ns);
    f->belief.frame_number++;
    f->totals.frames++;
    memset(&f->work.evidence, 0, sizeof f->work.evidence);
    note_twist(f);
    if (!plr_process_has_started(f)) {
        wait_for_start(f, frame, r);
    } else if (f->config.mode != PLR_MODE_DEAD_RECKONING) {
        process(f, frame, r);
    } else {
        dead_reckon(f);
        const plr_readings_evidence now = plr_filter_readings_at(f, f->belief.t_ns);
        plr_supervise_dead_reckons(&f->supervisor, &now);
    }
    if (!(f->supervisor.reasons & PLR_REASON_NO_TWISTS) &&
        f->source.inertial.fault >= PLR_IMU_FAULT_SATURATED)
        f->source.inertial.fault = PLR_IMU_FAULT_NONE; /* readings come again */
    r->active = (uint16_t)f->belief.count;
    count(f, r);
    plr_guard_seal_whole(f);
    return r->status;
}
