// SPDX-License-Identifier: MIT
#include "session/data.h"

#include <string.h>

#include "session/budget.h"
#include "session/clock.h"
#include "session/line.h"
#include "session/plausible.h"
#include "session/reanchor.h"
#include "session/send.h"
#include "session/start.h"
#include "session/steps.h"

/* --- STEREO --- */

static plr_status update(plr_session *s, const plr_frame *frame, plr_report *report,
                         uint64_t *compute_ns) {
    const uint64_t begin = plr_clock_now_ns(s);
    const plr_status status = plr_filter_update(&s->filter, frame, report);
    *compute_ns = plr_clock_elapsed_ns(s, begin);
    return status;
}

void plr_data_refuse_frame(plr_session *s, plr_status status) {
    const plr_frame *frame = &s->in.as.stereo;
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
    plr_line_begin(&s->out.as.text, PLR_SEVERITY_ERROR);
    plr_line_text(&s->out.as.text, "the filter diverged at ");
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

static void use_frame(plr_session *s, const plr_frame *frame, const plr_frame *moved) {
    uint64_t update_ns;
    plr_report report;
    plr_status status = update(s, moved, &report, &update_ns);
    if (plr_reanchor_follow(s, moved->t_ns, status))
        status = update(s, moved, &report, &update_ns);
    if (status != PLR_OK && status != PLR_E_DIVERGED) {
        if (status == PLR_E_MODE)
            s->totals.without_truth++;
        plr_data_refuse_frame(s, status);
        return;
    }
    if (status != PLR_OK)
        s->totals.refused++;
    s->last = report;
    s->last.t_ns = frame->t_ns; /* by which its sender knows it */
    learn(s, update_ns);
    answer(s, frame, update_ns + s->predict_ns);
    s->predict_ns = 0;
    report_divergence(s);
}

void plr_data_limit_frame(plr_session *s) {
    const uint16_t budget = plr_budget_next(&s->budget);
    if (s->port.now_ns != NULL && budget < s->in.as.stereo.budget)
        s->in.as.stereo.budget = budget;
}

/* The setting camera-offset leads from the camera's clock to that of the steps. (In mapping there are
 * none: a frame has the time of its TRUTH.) False if there is no such time. */
static bool move_frame(const plr_session *s, plr_frame *frame) {
    const plr_config *config = plr_filter_config(&s->filter);
    const double offset_ns = config->mode == PLR_MODE_MAPPING ? 0 : config->camera_offset_s * 1e9;
    const bool back = offset_ns < 0;
    const plr_time_ns by_ns = (plr_time_ns)((back ? -offset_ns : offset_ns) + 0.5);
    if (back ? frame->t_ns < by_ns : frame->t_ns > UINT64_MAX - by_ns)
        return false;
    frame->t_ns = back ? frame->t_ns - by_ns : frame->t_ns + by_ns;
    return true;
}

void plr_data_use_stereo(plr_session *s) {
    const plr_frame *frame = &s->in.as.stereo;
    plr_frame moved = *frame;
    if (!move_frame(s, &moved)) {
        plr_data_refuse_frame(s, PLR_E_TIME);
        return;
    }
    plr_steps_apply_held(s, moved.t_ns);
    if (s->phase == PLR_PHASE_STARTING) /* a START of the frame's own time counts, too */
        plr_start_choose(s, moved.t_ns > frame->t_ns ? moved.t_ns : frame->t_ns);
    if (s->phase == PLR_PHASE_STARTING)
        plr_data_refuse_frame(s, PLR_E_NOT_READY);
    else if (is_repeated(s, frame))
        plr_data_refuse_frame(s, PLR_E_TIME);
    else
        use_frame(s, frame, &moved);
}

/* --- TRUTH --- */

/* mapping: the pose is used as it is. */
static void move_to(plr_session *s, const plr_truth *truth) {
    plr_status status = PLR_E_RANGE;
    if (plr_plausible(PLR_GROUP_POSE, &truth->T_WB))
        status = plr_filter_move_to(&s->filter, truth->t_ns, &truth->T_WB);
    if (plr_reanchor_follow(s, truth->t_ns, status))
        status = plr_filter_move_to(&s->filter, truth->t_ns, &truth->T_WB);
    if (status != PLR_OK)
        plr_send_refusal(s, PLR_KIND_TRUTH, truth->t_ns, status, NULL);
}

/* True if the pose starts from the first TRUTH, and this is it. */
static bool starts_here(const plr_session *s) {
    return s->phase == PLR_PHASE_STARTING && !s->start_pending &&
           (s->options.start == PLR_START_AUTO || s->options.start == PLR_START_TRUTH);
}

void plr_data_use_truth(plr_session *s) {
    const plr_truth *truth = &s->in.as.truth;
    if (plr_filter_config(&s->filter)->mode == PLR_MODE_MAPPING) {
        plr_steps_apply_held(s, truth->t_ns);
        move_to(s, truth);
    } else if (starts_here(s)) {
        plr_steps_apply_held(s, truth->t_ns);
        plr_start_set_pose(s, PLR_KIND_TRUTH, truth->t_ns, &truth->T_WB, NULL);
    }
}

/* --- START among the data --- */

void plr_data_use_start(plr_session *s) {
    s->start = s->in.as.start;
    plr_steps_apply_held(s, UINT64_MAX);
    plr_start_apply(s);
}
