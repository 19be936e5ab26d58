// SPDX-License-Identifier: MIT
#include "session/use.h"

#include "pelorus/assertions.h"
#include "pelorus/eyes.h"
#include "session/budget.h"
#include "session/clock.h"
#include "session/line.h"
#include "session/reanchor.h"
#include "session/send.h"
#include "session/start.h"

/* How long after a late step no fault of the IMU is reported. */
#define LATE_NS UINT64_C(1000000000)

static bool is_inertial(const plr_session *s) {
    return plr_filter_config(&s->filter)->process == PLR_PROCESS_IMU;
}

static const char *steps_of(const plr_session *s) {
    return is_inertial(s) ? "IMU readings" : "TWISTs";
}

/* The filter used a frame, or a reading of a small sensor, of this time. */
static void note_used(plr_session *s, plr_time_ns t_ns) {
    plr_step_order *order = &s->order;
    const plr_time_ns newest_ns = s->newest_ns[PLR_EVENT_STEP];
    order->used = true;
    order->used_ns = t_ns;
    order->ahead_ns = order->came && t_ns > newest_ns ? t_ns - newest_ns : 0;
}

/* --- steps --- */

/* True if the filter refused a step because of something later that was used before, but no step. */
static bool is_late(const plr_session *s, plr_time_ns t_ns, plr_status status) {
    const plr_step_order *order = &s->order;
    return status == PLR_E_TIME && order->used && t_ns < order->used_ns &&
           order->used_ns == plr_filter_time(&s->filter) &&
           (!order->stepped || t_ns > order->stepped_ns);
}

/* Reported once, and again when the delay has doubled. */
static void note_late(plr_session *s, plr_time_ns t_ns) {
    plr_step_order *order = &s->order;
    PLR_ASSERT(t_ns < order->used_ns);
    plr_text *line = &s->out.as.text;
    const plr_time_ns behind_ns = order->used_ns - t_ns;
    const plr_time_ns needed_ns = behind_ns > order->ahead_ns ? behind_ns : order->ahead_ns;
    s->totals.late++;
    order->late_ns = order->used_ns;
    if (needed_ns < 2 * order->told_ns || needed_ns > plr_clock_max_gap_ns(s))
        return;
    order->told_ns = needed_ns;
    plr_line_begin(line, PLR_SEVERITY_WARNING, steps_of(s));
    plr_line_text(line, " come late: what was used before them is newer, here by ");
    plr_line_time(line, needed_ns + 999999); /* upwards, for it is to be enough */
    plr_line_text(line, ", and they are refused. Set twist-delay to that or more: then frames and "
                        "readings of other sensors wait for them");
    plr_send_text(s);
}

static void refuse_step(plr_session *s, plr_time_ns t_ns, plr_status status) {
    if (!is_inertial(s)) {
        plr_send_refusal(s, PLR_KIND_TWIST, t_ns, status, NULL);
        return;
    }
    s->totals.imu_refused++;
    if (status != s->imu_status)
        plr_send_refusal(s, PLR_KIND_IMU, t_ns, status, NULL);
    s->imu_status = status;
}

/* Each fault of the IMU is reported once in a drive. */
static void report_fault(plr_session *s) {
    const plr_imu_fault fault = plr_filter_imu_fault(&s->filter);
    const uint32_t bit = UINT32_C(1) << fault;
    const plr_time_ns now = plr_filter_time(&s->filter), late = s->order.late_ns;
    const bool full_of_holes = late != 0 && now >= late && now - late < LATE_NS;
    if (fault == PLR_IMU_FAULT_NONE || (s->imu_faults & bit) != 0 || full_of_holes)
        return;
    s->imu_faults |= bit;
    plr_line_begin(&s->out.as.text, PLR_SEVERITY_WARNING, "the IMU: ");
    plr_line_text(&s->out.as.text, plr_imu_fault_text(fault));
    plr_send_text(s);
}

/* A FIFO that is read at once gives all that it held one stamp. A link doubles a message, and no more: three of
 * one time are told, once in a drive. */
static void note_shared(plr_session *s, plr_time_ns t_ns, plr_status status) {
    plr_step_order *order = &s->order;
    if (status != PLR_E_TIME)
        return;
    order->shared = order->shared_ns == t_ns ? order->shared + 1 : 1;
    order->shared_ns = t_ns;
    if (order->shared < 2 || order->told_shared || !order->stepped || t_ns != order->stepped_ns)
        return;
    order->told_shared = true;
    plr_line_begin(&s->out.as.text, PLR_SEVERITY_WARNING, steps_of(s));
    plr_line_text(&s->out.as.text,
                  " share a stamp, as of a FIFO that is read at once: of each stamp the first is "
                  "used, and the others are refused. Give each its own time");
    plr_send_text(s);
}

/* Steps of another clock, while frames go on with theirs: three that agree are told, once in a drive. */
static void note_other_clock(plr_session *s, plr_time_ns t_ns, plr_status status) {
    const plr_time_ns now_ns = plr_filter_time(&s->filter);
    plr_text *line = &s->out.as.text;
    if (!plr_clock_watch_note(&s->step_watch, t_ns, status, now_ns, plr_clock_max_gap_ns(s)) ||
        s->order.told_clock)
        return;
    s->order.told_clock = true;
    plr_line_begin(line, PLR_SEVERITY_WARNING, steps_of(s));
    plr_line_text(line, " are of another clock: ");
    plr_line_time(line, t_ns);
    plr_line_text(line, " beside ");
    plr_line_time(line, now_ns);
    plr_line_text(line, " of what was used last, further than max-gap, so they are refused");
    plr_reanchor_tell_counter(line, now_ns, t_ns);
    plr_send_text(s);
}

static plr_status predict(plr_session *s, const plr_event *step) {
    const plr_moved_by *by = &step->as.step;
    const uint64_t begin = plr_clock_now_ns(s);
    const plr_status status = is_inertial(s)
                                  ? plr_filter_inertial(&s->filter, step->t_ns, &by->imu)
                                  : plr_filter_predict(&s->filter, step->t_ns, &by->twist);
    s->predict_ns += plr_clock_elapsed_ns(s, begin);
    return status;
}

/* Eyes look where the body is expected to have moved. */
static void tell_eyes(plr_session *s, plr_time_ns t_ns) {
    plr_eyes *eyes = s->options.eyes;
    plr_twist velocity;
    if (eyes != NULL && plr_filter_velocity(&s->filter, &velocity) == PLR_OK)
        eyes->calls->moved(eyes, t_ns, &velocity);
}

static void use_step(plr_session *s, const plr_event *step) {
    plr_start_apply_until(s, step->t_ns);
    plr_status status = predict(s, step);
    /* of a batch the first speaks for the sender's clock: the others have their times from it */
    if ((step->leads || status == PLR_OK) && plr_reanchor_follow(s, step->t_ns, status))
        status = predict(s, step);
    const bool late = is_late(s, step->t_ns, status);
    if (late)
        note_late(s, step->t_ns);
    if (is_inertial(s))
        report_fault(s);
    if (step->leads || status == PLR_OK)
        note_other_clock(s, step->t_ns, status);
    if (status != PLR_OK) {
        note_shared(s, step->t_ns, status);
        refuse_step(s, step->t_ns, late ? PLR_E_LATE : status);
        return;
    }
    s->order.stepped = true;
    s->order.stepped_ns = step->t_ns;
    s->imu_status = PLR_OK;
    tell_eyes(s, step->t_ns);
    if ((s->options.output & PLR_OUTPUT_TWIST_POSE) != 0)
        (void)plr_send_pose(s, false);
}

/* --- frames --- */

static plr_status update(plr_session *s, const plr_frame *frame, plr_report *report,
                         uint64_t *compute_ns) {
    const uint64_t begin = plr_clock_now_ns(s);
    const plr_status status = plr_filter_update(&s->filter, frame, report);
    *compute_ns = plr_clock_elapsed_ns(s, begin);
    return status;
}

static void report_divergence(plr_session *s) {
    if (!(s->last.reasons & PLR_REASON_RECOVERED))
        return;
    plr_line_begin(&s->out.as.text, PLR_SEVERITY_ERROR, "the filter diverged at ");
    plr_line_time(&s->out.as.text, s->last.t_ns);
    plr_line_text(&s->out.as.text, ": a variance was not positive; it goes on from its pose, "
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

/* A frame that a link has doubled: used twice, its pixels would count for more than they know. */
static bool is_repeated(const plr_session *s, const plr_frame *frame) {
    plr_totals totals;
    return plr_filter_totals(&s->filter, &totals) == PLR_OK && totals.frames > 0 &&
           s->last.t_ns == frame->t_ns;
}

static void update_by(plr_session *s, const plr_frame *frame, plr_time_ns moved_ns) {
    uint64_t update_ns;
    plr_report report;
    plr_frame moved = *frame;
    moved.t_ns = moved_ns;
    plr_status status = update(s, &moved, &report, &update_ns);
    if (plr_reanchor_follow(s, moved_ns, status))
        status = update(s, &moved, &report, &update_ns);
    if (status != PLR_OK && status != PLR_E_DIVERGED) {
        if (status == PLR_E_MODE)
            s->totals.without_truth++;
        plr_send_frame_refusal(s, frame, status);
        return;
    }
    if (status == PLR_OK) {
        plr_budget_learn(&s->budget, update_ns, report.used);
        s->totals.over_deadline +=
            s->budget.deadline_ns > 0 && update_ns > s->budget.deadline_ns ? 1 : 0;
    } else {
        s->totals.refused++;
    }
    note_used(s, moved_ns);
    s->last = report;
    s->last.t_ns = frame->t_ns; /* by which its sender knows it */
    answer(s, frame, update_ns + s->predict_ns);
    s->predict_ns = 0;
    report_divergence(s);
}

static void use_frame(plr_session *s, const plr_event *event) {
    const plr_frame *frame = &event->as.frame;
    if (s->phase == PLR_PHASE_STARTING) /* a START of the frame's own time counts, too */
        plr_start_choose(s, event->t_ns > frame->t_ns ? event->t_ns : frame->t_ns);
    if (s->phase == PLR_PHASE_STARTING)
        plr_send_frame_refusal(s, frame, PLR_E_NOT_READY);
    else if (is_repeated(s, frame))
        plr_send_frame_refusal(s, frame, PLR_E_TIME);
    else
        update_by(s, frame, event->t_ns);
}

void plr_use_limit(const plr_session *s, plr_frame *frame) {
    const uint16_t budget = plr_budget_next(&s->budget);
    if (s->port.now_ns != NULL && budget < frame->budget)
        frame->budget = budget;
}

/* --- each --- */

static void use_reading(plr_session *s, const plr_reading *reading) {
    const plr_status status = plr_filter_measure(&s->filter, reading, NULL);
    if (status == PLR_OK)
        note_used(s, reading->t_ns);
    else
        plr_send_refusal(s, PLR_KIND_READING, reading->t_ns, status, NULL);
}

void plr_use(plr_session *s, const plr_event *event) {
    if (event->kind == PLR_EVENT_STEP)
        use_step(s, event);
    else if (event->kind == PLR_EVENT_FRAME)
        use_frame(s, event);
    else
        use_reading(s, &event->as.reading);
}

void plr_use_refuse(plr_session *s, const plr_event *event, plr_status status) {
    if (event->kind == PLR_EVENT_STEP)
        refuse_step(s, event->t_ns, status);
    else if (event->kind == PLR_EVENT_FRAME)
        plr_send_frame_refusal(s, &event->as.frame, status);
    else
        plr_send_refusal(s, PLR_KIND_READING, event->t_ns, status, NULL);
}
