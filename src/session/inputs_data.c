// SPDX-License-Identifier: MIT
/* TWIST, STEREO, TRUTH: what the filter lives on. */
#include <string.h>

#include "session/begin.h"
#include "session/budget.h"
#include "session/held.h"
#include "session/inputs.h"
#include "session/line.h"
#include "session/plausible.h"
#include "session/reanchor.h"
#include "session/send.h"

static uint64_t now_ns(const plr_session *s) {
    return s->port.now_ns != NULL ? s->port.now_ns(s->port.context) : 0;
}

/* Since then; 0 if the clock went back. */
static uint64_t elapsed_ns(const plr_session *s, uint64_t since) {
    const uint64_t now = now_ns(s);
    return now > since ? now - since : 0;
}

static plr_time_ns to_ns(double seconds) {
    return (plr_time_ns)(seconds * 1e9 + 0.5);
}

/* What the filter said to data of time t_ns. True if the clock's jump was followed, so that the
 * same data will be taken now. */
static bool follow_jump(plr_session *s, plr_time_ns t_ns, plr_status status) {
    const plr_time_ns max_gap_ns = to_ns(plr_filter_config(&s->filter)->max_gap_s);
    return plr_clock_watch_note(&s->watch, t_ns, status, plr_filter_time(&s->filter), max_gap_ns) &&
           plr_reanchor(s, t_ns) == PLR_OK;
}

/* --- TWIST --- */

static plr_status predict(plr_session *s, const plr_twist_message *twist) {
    const uint64_t begin = now_ns(s);
    const plr_status status = plr_filter_predict(&s->filter, twist->t_ns, &twist->twist);
    s->predict_ns += elapsed_ns(s, begin);
    return status;
}

static void apply_twist(plr_session *s, const plr_twist_message *twist) {
    plr_begin_at(s, twist->t_ns);
    plr_status status = predict(s, twist);
    if (follow_jump(s, twist->t_ns, status))
        status = predict(s, twist);
    if (status != PLR_OK)
        plr_send_refusal(s, PLR_KIND_TWIST, twist->t_ns, status, NULL);
    else if ((s->options.output & PLR_OUTPUT_TWIST_POSE) != 0)
        (void)plr_send_pose(s, false);
}

static void take_held_until(plr_session *s, plr_time_ns t_ns) {
    plr_twist_message twist;
    while (plr_held_pop_until(&s->held, t_ns, &twist))
        apply_twist(s, &twist);
}

void plr_take_all_held(plr_session *s) {
    plr_twist_message twist;
    while (plr_held_pop(&s->held, &twist))
        apply_twist(s, &twist);
}

static void hold(plr_session *s, const plr_twist_message *twist, plr_time_ns delay_ns) {
    plr_twist_message due;
    if (plr_held_contradicts(&s->held, twist->t_ns))
        plr_take_all_held(s);
    if (plr_held_full(&s->held) && plr_held_pop(&s->held, &due)) {
        s->totals.held_short++;
        apply_twist(s, &due);
    }
    plr_held_push(&s->held, twist);
    while (plr_held_pop_due(&s->held, delay_ns, &due))
        apply_twist(s, &due);
}

void plr_take_twist(plr_session *s) {
    const plr_twist_message *twist = &s->in.as.twist;
    const bool running = plr_begin_running(s);
    plr_send_echo(s);
    if (!running) {
        plr_send_refusal(s, PLR_KIND_TWIST, twist->t_ns, PLR_E_NOT_READY, NULL);
        return;
    }
    if (!plr_plausible_twist(&twist->twist)) {
        plr_send_refusal(s, PLR_KIND_TWIST, twist->t_ns, PLR_E_RANGE, NULL);
        return;
    }
    const plr_time_ns delay_ns = to_ns(plr_filter_config(&s->filter)->twist_delay_s);
    if (delay_ns > 0)
        hold(s, twist, delay_ns);
    else
        apply_twist(s, twist);
}

/* --- STEREO --- */

static plr_status update(plr_session *s, const plr_frame *frame, plr_report *report,
                         uint64_t *compute_ns) {
    const uint64_t begin = now_ns(s);
    const plr_status status = plr_filter_update(&s->filter, frame, report);
    *compute_ns = elapsed_ns(s, begin);
    return status;
}

static void refuse_frame(plr_session *s, const plr_frame *frame, plr_status status) {
    plr_report report;
    memset(&report, 0, sizeof report);
    report.t_ns = frame->t_ns;
    report.status = status;
    report.observations = frame->count;
    const plr_frame_result result = {frame, &report, NULL, 0};
    plr_send_refusal(s, PLR_KIND_STEREO, frame->t_ns, status, NULL);
    if (s->options.observer.frame != NULL)
        s->options.observer.frame(s->options.observer.context, &result);
}

static void tell_divergence(plr_session *s) {
    if (!(s->last.reasons & PLR_REASON_RECOVERED))
        return;
    plr_line_begin(&s->out.as.text, PLR_SEVERITY_ERROR);
    plr_line_words(&s->out.as.text, "the filter diverged at ");
    plr_line_time(&s->out.as.text, s->last.t_ns);
    plr_line_words(&s->out.as.text, ": a variance was not positive; it goes on from its pose, "
                                    "and the landmarks were dropped");
    plr_send_text(s);
}

/* An answered frame: POSE where there is an estimate for its time, and REPORT. */
static void answer(plr_session *s, const plr_frame *frame, uint64_t compute_ns) {
    const plr_report *report = &s->last;
    const bool estimated = report->status == PLR_OK || report->status == PLR_E_DIVERGED;
    const plr_pose_message *pose = estimated ? plr_send_pose(s, true) : NULL;
    const plr_frame_result result = {frame, report, pose, compute_ns};
    if (s->options.observer.frame != NULL)
        s->options.observer.frame(s->options.observer.context, &result);
    plr_send_report(s, report, compute_ns);
}

static void learn(plr_session *s, uint64_t update_ns) {
    if (s->last.status != PLR_OK)
        return;
    plr_budget_learn(&s->budget, update_ns, s->last.used);
    if (s->budget.deadline_ns > 0 && update_ns > s->budget.deadline_ns)
        s->totals.over_deadline++;
}

/* A frame that a link has doubled: used twice, its pixels would count for more than they know. */
static bool is_repeated(const plr_session *s, const plr_frame *frame) {
    plr_totals totals;
    return plr_filter_totals(&s->filter, &totals) == PLR_OK && totals.frames > 0 &&
           s->last.t_ns == frame->t_ns;
}

static void process(plr_session *s, const plr_frame *frame) {
    if (is_repeated(s, frame)) {
        refuse_frame(s, frame, PLR_E_TIME);
        return;
    }
    uint64_t update_ns;
    plr_report report;
    plr_status status = update(s, frame, &report, &update_ns);
    if (follow_jump(s, frame->t_ns, status))
        status = update(s, frame, &report, &update_ns);
    if (status != PLR_OK && status != PLR_E_DIVERGED) {
        if (status == PLR_E_MODE)
            s->totals.without_truth++;
        refuse_frame(s, frame, status);
        return;
    }
    if (status != PLR_OK)
        s->totals.refused++;
    s->last = report;
    learn(s, update_ns);
    answer(s, frame, update_ns + s->predict_ns);
    s->predict_ns = 0;
    tell_divergence(s);
}

void plr_take_stereo(plr_session *s) {
    plr_frame *frame = &s->in.as.stereo;
    const uint16_t budget = plr_budget_next(&s->budget);
    const bool running = plr_begin_running(s);
    if (s->port.now_ns != NULL && budget < frame->budget)
        frame->budget = budget;
    plr_send_echo(s);
    if (running)
        take_held_until(s, frame->t_ns);
    if (running && plr_begin_frame(s, frame->t_ns))
        process(s, frame);
    else
        refuse_frame(s, frame, PLR_E_NOT_READY);
}

/* --- TRUTH --- */

/* mapping: the pose is taken as it is. */
static void move_to(plr_session *s, const plr_truth *truth) {
    plr_status status = PLR_E_RANGE;
    if (plr_plausible_pose(&truth->T_WB))
        status = plr_filter_move_to(&s->filter, truth->t_ns, &truth->T_WB);
    if (follow_jump(s, truth->t_ns, status))
        status = plr_filter_move_to(&s->filter, truth->t_ns, &truth->T_WB);
    if (status != PLR_OK)
        plr_send_refusal(s, PLR_KIND_TRUTH, truth->t_ns, status, NULL);
}

/* True if the pose starts from the first TRUTH, and this is it. */
static bool starts_here(const plr_session *s) {
    return !s->started && !s->start_known &&
           (s->options.start == PLR_START_AUTO || s->options.start == PLR_START_TRUTH);
}

void plr_take_truth(plr_session *s) {
    const plr_truth *truth = &s->in.as.truth;
    const bool running = plr_begin_running(s);
    plr_send_echo(s);
    if (s->options.observer.truth != NULL)
        s->options.observer.truth(s->options.observer.context, truth);
    if (!running)
        return; /* a reference needs no filter: it is not refused */
    if (plr_filter_config(&s->filter)->mode == PLR_MODE_MAPPING) {
        take_held_until(s, truth->t_ns);
        move_to(s, truth);
    } else if (starts_here(s)) {
        take_held_until(s, truth->t_ns);
        plr_begin_set_pose(s, PLR_KIND_TRUTH, truth->t_ns, &truth->T_WB, NULL);
    }
}
