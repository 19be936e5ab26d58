// SPDX-License-Identifier: MIT
#include "session/frames.h"

#include <string.h>

#include "pelorus/assertions.h"
#include "session/budget.h"
#include "session/clock.h"
#include "session/line.h"
#include "session/reanchor.h"
#include "session/send.h"
#include "session/start.h"
#include "session/steps.h"

static plr_status update(plr_session *s, const plr_frame *frame, plr_report *report,
                         uint64_t *compute_ns) {
    const uint64_t begin = plr_clock_now_ns(s);
    const plr_status status = plr_filter_update(&s->filter, frame, report);
    *compute_ns = plr_clock_elapsed_ns(s, begin);
    return status;
}

void plr_frames_refuse(plr_session *s, const plr_frame *frame, plr_status status) {
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

static void use(plr_session *s, const plr_frame *frame, plr_time_ns moved_ns) {
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
        plr_frames_refuse(s, frame, status);
        return;
    }
    if (status == PLR_OK) {
        plr_budget_learn(&s->budget, update_ns, report.used);
        s->totals.over_deadline +=
            s->budget.deadline_ns > 0 && update_ns > s->budget.deadline_ns ? 1 : 0;
    } else {
        s->totals.refused++;
    }
    plr_steps_note_used(s, moved_ns);
    s->last = report;
    s->last.t_ns = frame->t_ns; /* by which its sender knows it */
    answer(s, frame, update_ns + s->predict_ns);
    s->predict_ns = 0;
    report_divergence(s);
}

void plr_frames_use(plr_session *s, const plr_event *event) {
    PLR_ASSERT(event->kind == PLR_EVENT_FRAME);
    const plr_frame *frame = &event->as.frame;
    if (s->phase == PLR_PHASE_STARTING) /* a START of the frame's own time counts, too */
        plr_start_choose(s, event->t_ns > frame->t_ns ? event->t_ns : frame->t_ns);
    if (s->phase == PLR_PHASE_STARTING)
        plr_frames_refuse(s, frame, PLR_E_NOT_READY);
    else if (is_repeated(s, frame))
        plr_frames_refuse(s, frame, PLR_E_TIME);
    else
        use(s, frame, event->t_ns);
}

void plr_frames_limit(plr_session *s) {
    const uint16_t budget = plr_budget_next(&s->budget);
    if (s->port.now_ns != NULL && budget < s->in.as.stereo.budget)
        s->in.as.stereo.budget = budget;
}
