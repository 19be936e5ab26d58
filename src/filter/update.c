// SPDX-License-Identifier: MIT
/*
 * A stereo frame: predict, match, take up known landmarks, find the motion and gate, apply it, correct, initialise (which evicts where slots
 * are too few), judge, in this order.
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
#include "pelorus/assertions.h"
#include "process/alignment.h"
#include "process/process.h"
#include "process/velocity.h"
#include "sensor/kept.h"
#include "sensor/sensor.h"
#include "sensor/standstill.h"
#include "sensor/stereo.h"
#include "state/blocks.h"
#include "state/calibration.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/motion.h"
#include "state/seconds.h"
#include "state/sightings.h"
#include "supervise/supervise.h"

/* ---------------------------------------------------------------- gate and budget */

/* det S / det R but for a common factor: the larger, the more an observation tells. */
static plr_real tells(const plr_camera_model *camera, const plr_sightings *frame, unsigned k) {
    const plr_sighting *row = &frame->at[k];
    return frame->of_slot[row->slot].det_S * plr_stereo_sharpness(camera, row->seen);
}

/* True if row a tells less than row b; of two that tell the same, the one of the higher id. */
static bool tells_less(const plr_camera_model *camera, const plr_sightings *frame, unsigned a,
                       unsigned b) {
    const plr_real by_a = tells(camera, frame, a), by_b = tells(camera, frame, b);
    return by_a < by_b || (!(by_a > by_b) && a > b);
}

/* Of the rows that are used leaves out the one that tells least. */
static void leave_out_least(const plr_camera_model *camera, plr_sightings *frame) {
    unsigned least = frame->count;
    for (unsigned k = 0; k < frame->count; k++)
        if (frame->at[k].used && (least == frame->count || tells_less(camera, frame, k, least)))
            least = k;
    PLR_ASSERT(least < frame->count);
    frame->at[least].used = 0;
}

/* Chooses the rows that are used: those that pass the gate, at most `budget` of them, that tell most.
 * Counts what the gate has said in the report and in each landmark. */
static void choose(plr_filter *f, plr_sightings *frame, plr_report *report) {
    unsigned accepted = 0;
    for (unsigned k = 0; k < frame->count; k++) {
        plr_sighting *row = &frame->at[k];
        if (!plr_is_matched(row))
            continue;
        report->matched++;
        plr_track_count(plr_slot_of(&f->belief, row), (plr_gate_result)row->verdict);
        row->used = plr_gate_accepted(row);
        report->gated = (uint16_t)(report->gated + !row->used);
        report->nis += row->used ? (float)frame->of_slot[row->slot].d2 : 0;
        report->nis_dof =
            (uint16_t)(report->nis_dof + (row->used ? plr_stereo_numbers(row->seen) : 0));
        accepted += row->used;
    }
    for (; accepted > report->budget; accepted--) {
        leave_out_least(&f->camera, frame);
        report->left_out++;
    }
}

/* Gates each row by its own prediction, when the motion has been applied already, and keeps the
 * measurements. */
static void gate_each(plr_filter *f, plr_sightings *frame, bool opens) {
    const uint64_t left_out = plr_supervise_left_out(&f->supervisor);
    for (unsigned k = 0; k < frame->count; k++) {
        plr_sighting *row = &frame->at[k];
        if (!plr_is_matched(row))
            continue;
        plr_verdict verdict = {.accepted = false};
        plr_measurement m;
        if (plr_stereo_measure(&f->belief, &f->camera, row->slot, row->seen, &m)) {
            verdict = plr_gate_judge(f, opens, &m);
            plr_measurement_keep(&f->belief, &f->work, row->slot, &m);
        }
        row->verdict = (uint8_t)(verdict.accepted ? PLR_GATE_ACCEPTED
                                                  : plr_gate_rejection(left_out, verdict.d2));
        frame->of_slot[row->slot].d2 = verdict.d2;
        frame->of_slot[row->slot].det_S = verdict.det_S;
    }
}

/* ---------------------------------------------------------------- the correction */

/* True if the frame uses or creates a landmark. Otherwise the motion is not applied and goes on
 * accumulating, so that a dark camera does not affect P. */
static bool needs_motion_applied(const plr_filter *f, const plr_sightings *frame) {
    for (unsigned k = 0; k < frame->count; k++) {
        const plr_sighting *row = &frame->at[k];
        if (plr_is_matched(row) ? plr_gate_accepted(row)
                                : plr_births_are_allowed(f) &&
                                      plr_stereo_makes_landmark(&f->belief, &f->camera, row->seen))
            return true;
    }
    return false;
}

/* Keeps the measurements of the rows that are used, where the gate has judged without them. One whose
 * landmark the motion has moved behind the camera has no effect. */
static void measure_used(plr_filter *f, const plr_sightings *frame) {
    for (unsigned k = 0; k < frame->count; k++) {
        const plr_sighting *row = &frame->at[k];
        plr_measurement m;
        if (!row->used)
            continue;
        (void)plr_stereo_measure(&f->belief, &f->camera, row->slot, row->seen, &m);
        plr_measurement_keep(&f->belief, &f->work, row->slot, &m);
    }
}

/* The gate's counts, for the supervisor. */
static plr_search_decision ask_after_search(plr_filter *f, const plr_sightings *frame,
                                            bool outright) {
    plr_search_evidence e = {.outright = outright, .now_ns = f->belief.t_ns};
    for (unsigned k = 0; k < frame->count; k++) {
        e.matched += plr_is_matched(&frame->at[k]);
        e.gated += plr_gate_rejected(&frame->at[k]);
    }
    return plr_supervise_search(&f->supervisor, &e);
}

/* Finds the motion, judges the observations by it, and corrects. A frame that needs no motion applied, or
 * that waits for the next one, leaves it accumulating. */
static plr_correction motion_first(plr_filter *f, plr_sightings *frame, plr_decisions *decided,
                                   plr_report *report) {
    plr_search_decision *decision = &decided->search;
    const plr_real weight = decided->picture.weight;
    plr_motion_first first;
    plr_considered_bias before;
    plr_correction correction = {.status = PLR_OK};
    plr_applied_motion stated;
    plr_evidence_pose by_odometry;
    plr_motion_prior(&f->belief, &f->motion, &f->work.noise, 1, &stated);
    plr_evidence_note_pose(f, &by_odometry);
    plr_motion_find(f, frame, &decided->picture, &first);
    *decision = ask_after_search(f, frame, first.outright);
    if (decision->wait)
        return correction;
    if (!needs_motion_applied(f, frame)) {
        choose(f, frame, report);
        return correction;
    }
    plr_bias_consider(f, decision->hold_biases, &before);
    if (first.outright)
        plr_motion_open_velocity(&f->belief, &f->motion);
    else
        plr_motion_widen_velocity(&f->belief, &f->motion, weight);
    correction.status = plr_predict_apply(f, &first.motion);
    if (correction.status != PLR_OK)
        return correction;
    choose(f, frame, report);
    measure_used(f, frame);
    correction = plr_correct(f, frame, NULL, 0);
    if (correction.status != PLR_OK)
        return correction;
    plr_bias_restore(f, &before);
    if (correction.moved)
        plr_evidence_of_motion(f, &by_odometry, &stated, weight, &first, &correction);
    return correction;
}

/* The motion is known exactly, or is not searched for: predict, gate, correct. */
static plr_correction motion_as_given(plr_filter *f, plr_sightings *frame, plr_decisions *decided,
                                      plr_report *report) {
    const plr_correction failed = {.status = plr_predict_apply_pending(f)};
    if (failed.status != PLR_OK)
        return failed;
    gate_each(f, frame, decided->picture.opens_fixed_gate);
    decided->search = ask_after_search(f, frame, false);
    choose(f, frame, report);
    return plr_correct(f, frame, NULL, 0);
}

/* Corrects by the observations, and fills the report with how. */
static plr_status correct(plr_filter *f, plr_sightings *frame, plr_decisions *decided,
                          plr_report *report) {
    const bool finds = f->motion.pending && f->motion.noisy && f->config.model == PLR_MODEL_BODY;
    plr_evidence_pose before;
    const bool sees_map = plr_evidence_before_map(f, frame, &before);
    const plr_correction correction = finds ? motion_first(f, frame, decided, report)
                                            : motion_as_given(f, frame, decided, report);
    report->used = (uint16_t)correction.applied;
    report->blocks_failed = (uint16_t)correction.failed_batches;
    report->innovation_rows = (uint16_t)correction.innovation.rows;
    report->innovation_d2 = (float)correction.innovation.d2;
    report->innovation_log_det = (float)correction.innovation.log_det;
    f->evidence.events.cut = correction.cut;
    if (sees_map && correction.status == PLR_OK)
        plr_evidence_after_map(f, &before);
    return correction.status;
}

/* ---------------------------------------------------------------- the frame */

/* Since the last frame the tracks have wandered off their points. */
static void let_tracks_drift(plr_filter *f) {
    const plr_time_ns last_ns = plr_supervise_last_frame_ns(&f->supervisor);
    if (last_ns == PLR_NEVER_NS || !(f->camera.track_drift_variance > 0))
        return;
    const plr_real seconds = plr_seconds(f->belief.t_ns - last_ns);
    plr_model_of(&f->belief)
        ->drift(&f->belief, &f->camera, PLR_SQRT(f->camera.track_drift_variance * seconds));
}

/* Known landmarks come in, at a pose that is found anew if need be. */
static plr_status take_up_known(plr_filter *f, plr_sightings *frame, plr_picture_decision *decided,
                                plr_report *report) {
    plr_frame_events *events = &f->evidence.events;
    plr_relocation found;
    events->relocated = events->left_out = plr_relocate_when_lost(f, frame, events, decided);
    if (events->relocated) {
        report->created = (uint16_t)f->belief.count;
        plr_match_slots(f, frame);
        return PLR_OK;
    }
    plr_match_known(f, frame, events, report);
    events->left_out = events->unplaced > 0;
    const unsigned came_in = events->adopted;
    const plr_status status = plr_relocate_when_uncertain(f, frame, events, &found);
    if (status != PLR_OK)
        return status;
    if (came_in > 0 && found != PLR_LEFT_OUT)
        plr_alignment_keep_world(&f->source);
    if (found == PLR_PLACED)
        return PLR_OK;
    report->created = report->no_room = 0; /* they come in again */
    events->unplaced = 0;
    plr_match_slots(f, frame);
    if (found == PLR_LEFT_OUT) {
        events->left_out = true;
        events->unplaced = came_in;
    } else {
        plr_match_known(f, frame, events, report);
    }
    events->adopted = 0; /* the pose has been held against the map already */
    return PLR_OK;
}

/* After the correction: a lock is undone, and landmarks begin. */
static plr_status renew_landmarks(plr_filter *f, plr_sightings *frame,
                                  const plr_search_decision *decision, plr_report *report) {
    plr_frame_events *events = &f->evidence.events;
    plr_status status = PLR_OK;
    plr_relocate_watch(f, frame, events->unplaced);
    if (decision->drop_rejected) {
        events->locked = true;
        f->totals.locks++;
        status = plr_predict_apply_prior(f);
        plr_births_drop_rejected(f, frame);
    } else if (!decision->wait) {
        status = plr_births_restart(f, frame, report);
    }
    if (status == PLR_OK)
        plr_births_from_unmatched(f, frame, decision->make_none, events, report);
    return status;
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
static void carry_out(plr_filter *f, plr_sightings *frame, plr_report *report) {
    plr_frame_decision decision;
    plr_evidence_complete(f, frame);
    plr_supervise_frame(&f->supervisor, &f->evidence, report, &decision);
    report->health = decision.health;
    report->reasons = decision.reasons;
    f->totals.contradictions += decision.contradicted_now;
    f->totals.range_limited += f->evidence.events.cut;
    if (report->used > 0)
        plr_filter_store_for_recovery(f);
    if (!decision.covers)
        return;
    if (plr_has_block(&f->belief, PLR_BLOCK_VELOCITY))
        keep_position_and_heading(f, decision.cover);
    plr_covariance_add(&f->belief, PLR_BLOCK_POSE, decision.cover);
    plr_relocate_let_go(f, decision.cover);
    f->totals.widened++;
}

/* Recovers, and makes landmarks of what is seen. */
static void recover(plr_filter *f, plr_sightings *frame, plr_report *report) {
    plr_frame_events *events = &f->evidence.events;
    plr_filter_recover(f);
    events->recovered = true;
    plr_match_slots(f, frame);
    plr_births_from_unmatched(f, frame, false, events, report);
}

/* The stages up to the births; the first that fails ends them. */
static plr_status estimate(plr_filter *f, plr_sightings *frame, plr_report *report) {
    plr_decisions decided = {.picture =
                                 plr_supervise_picture(&f->supervisor, &f->evidence.picture)};
    plr_status status = PLR_OK;
    if (decided.picture.use)
        status = take_up_known(f, frame, &decided.picture, report);
    if (status != PLR_OK)
        return status;
    let_tracks_drift(f);
    if (!decided.picture.use) {
        plr_match_count(f, frame);
        frame->count = 0;
    }
    plr_reading still;
    plr_reading_result unused = {0};
    const bool stands =
        f->source.reading_valid && plr_standstill_is_seen(&f->belief, &f->camera, frame,
                                                          f->config.standstill_sigma_mps, &still);
    const bool is_state = plr_process_of(&f->source)->measure != NULL;
    if (stands && !is_state)
        (void)plr_measure_twist(f, &still, &unused);
    status = correct(f, frame, &decided, report);
    if (status != PLR_OK)
        return status;
    plr_match_count(f, frame);
    status = renew_landmarks(f, frame, &decided.search, report);
    if (status == PLR_OK && stands && is_state)
        (void)plr_measure_twist(f, &still, &unused);
    return status;
}

static void process(plr_filter *f, const plr_frame *given, plr_report *report) {
    plr_sightings *frame = &f->work.sightings;
    plr_match_in_order(given, frame, report);
    plr_match_slots(f, frame);
    plr_evidence_of_picture(f, frame);
    if (estimate(f, frame, report) != PLR_OK)
        recover(f, frame, report);
    plr_filter_follow_start(f, report);
    carry_out(f, frame, report);
}

/* Before an IMU's start nothing moves; the pictures only say whether the body stands. */
static void wait_for_start(plr_filter *f, const plr_frame *given, plr_report *report) {
    plr_match_in_order(given, &f->work.sightings, report);
    plr_filter_watch_start(f, &f->work.sightings);
    const plr_readings_evidence now = plr_filter_readings_at(f, f->belief.t_ns);
    plr_supervise_waits(&f->supervisor, &now, report);
}

/* Checks the frame's time and the mode. */
static plr_status check_frame(const plr_filter *f, const plr_frame *frame) {
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
    return plr_process_of(&f->source)
        ->check(&f->belief, &f->source, f->source.reading,
                plr_seconds(frame->t_ns - f->belief.t_ns));
}

/* A frame of dead reckoning: applies the motion, and the velocities' information about the
 * biases. */
static void dead_reckon(plr_filter *f) {
    plr_status status;
    if (f->motion.pending && plr_velocity_informs_bias(&f->source)) {
        status = plr_predict_apply_pending(f);
        if (status == PLR_OK)
            status = plr_correct(f, NULL, NULL, 0).status;
    } else {
        status = plr_predict_apply_prior(f);
    }
    if (status != PLR_OK)
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
    if (!plr_calibration_needs_twist(&f->camera))
        return;
    plr_process_of(&f->source)->now(&f->belief, &f->motion, &f->source, twist, P_u);
    if (plr_process_of(&f->source)->changes)
        plr_process_of(&f->source)->changes(&f->belief, &f->source, twist, change);
    plr_calibration_at_frame(&f->belief, &f->camera, &f->source, twist, change, P_u);
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
    r->status = check_frame(f, frame);
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
    memset(&f->evidence, 0, sizeof f->evidence);
    note_twist(f);
    if (!plr_process_has_started(&f->source)) {
        wait_for_start(f, frame, r);
    } else if (f->config.mode != PLR_MODE_DEAD_RECKONING) {
        process(f, frame, r);
    } else {
        dead_reckon(f);
        const plr_readings_evidence now = plr_filter_readings_at(f, f->belief.t_ns);
        plr_supervise_dead_reckons(&f->supervisor, &now);
    }
    if (plr_supervise_has_readings(&f->supervisor) &&
        f->source.inertial.fault >= PLR_IMU_FAULT_SATURATED)
        f->source.inertial.fault = PLR_IMU_FAULT_NONE; /* readings come again */
    r->active = (uint16_t)f->belief.count;
    count(f, r);
    plr_guard_seal_whole(f);
    return r->status;
}
