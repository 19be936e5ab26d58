// SPDX-License-Identifier: MIT
#include "session/data.h"

#include <string.h>

#include "session/budget.h"
#include "session/clock.h"
#include "session/held.h"
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

void plr_data_refuse_frame(plr_session *s, const plr_frame *frame, plr_status status) {
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

static void use_frame(plr_session *s, const plr_frame *frame, const plr_frame *moved) {
    uint64_t update_ns;
    plr_report report;
    plr_status status = update(s, moved, &report, &update_ns);
    if (plr_reanchor_follow(s, moved->t_ns, status))
        status = update(s, moved, &report, &update_ns);
    if (status != PLR_OK && status != PLR_E_DIVERGED) {
        if (status == PLR_E_MODE)
            s->totals.without_truth++;
        plr_data_refuse_frame(s, frame, status);
        return;
    }
    if (status == PLR_OK) {
        plr_budget_learn(&s->budget, update_ns, report.used);
        s->totals.over_deadline +=
            s->budget.deadline_ns > 0 && update_ns > s->budget.deadline_ns ? 1 : 0;
    } else {
        s->totals.refused++;
    }
    plr_steps_note_used(s, moved->t_ns);
    s->last = report;
    s->last.t_ns = frame->t_ns; /* by which its sender knows it */
    answer(s, frame, update_ns + s->predict_ns);
    s->predict_ns = 0;
    report_divergence(s);
}

void plr_data_limit_frame(plr_session *s) {
    const uint16_t budget = plr_budget_next(&s->budget);
    if (s->port.now_ns != NULL && budget < s->in.as.stereo.budget)
        s->in.as.stereo.budget = budget;
}

/* The setting camera-offset leads from the camera's clock to that of the steps. (In mapping there
 * are none: a frame has the time of its TRUTH.) False if there is no such time. */
static bool move(const plr_session *s, plr_time_ns t_ns, plr_time_ns *moved_ns) {
    const plr_config *config = plr_filter_config(&s->filter);
    const double offset_ns = config->mode == PLR_MODE_MAPPING ? 0 : config->camera_offset_s * 1e9;
    const bool back = offset_ns < 0;
    const plr_time_ns by_ns = (plr_time_ns)((back ? -offset_ns : offset_ns) + 0.5);
    if (back ? t_ns < by_ns : t_ns > UINT64_MAX - by_ns)
        return false;
    *moved_ns = back ? t_ns - by_ns : t_ns + by_ns;
    return true;
}

/* The frame after the steps up to its time. */
static void use_in_order(plr_session *s, const plr_frame *frame, plr_time_ns moved_ns) {
    plr_frame moved = *frame;
    moved.t_ns = moved_ns;
    plr_steps_apply_held(s, moved_ns);
    if (s->phase == PLR_PHASE_STARTING) /* a START of the frame's own time counts, too */
        plr_start_choose(s, moved_ns > frame->t_ns ? moved_ns : frame->t_ns);
    if (s->phase == PLR_PHASE_STARTING)
        plr_data_refuse_frame(s, frame, PLR_E_NOT_READY);
    else if (is_repeated(s, frame))
        plr_data_refuse_frame(s, frame, PLR_E_TIME);
    else
        use_frame(s, frame, &moved);
}

static void use_held(plr_session *s, const plr_held_frame *held) {
    use_in_order(s, &held->frame, held->moved_ns);
    if (s->held_frames.count == 0)
        plr_steps_apply_due(s);
}

void plr_data_use_waiting(plr_session *s, plr_time_ns until_ns) {
    const plr_held_frame *held;
    while ((held = plr_held_pop_frame(&s->held_frames, until_ns)) != NULL)
        use_held(s, held);
}

/* How long a frame waits for steps: as they do for frames, and as camera-offset moves it ahead. */
static plr_time_ns patience_ns(const plr_session *s, plr_time_ns t_ns, plr_time_ns moved_ns) {
    const plr_config *config = plr_filter_config(&s->filter);
    const plr_time_ns ahead_ns = moved_ns > t_ns ? moved_ns - t_ns : 0;
    if (config->mode == PLR_MODE_MAPPING)
        return 0; /* each frame has its TRUTH, and needs no step */
    return (plr_time_ns)(config->twist_delay_s * 1e9 + 0.5) + ahead_ns;
}

void plr_data_use_stereo(plr_session *s) {
    const plr_frame *frame = &s->in.as.stereo;
    plr_time_ns moved_ns;
    if (!move(s, frame->t_ns, &moved_ns) ||
        plr_held_has_frame(&s->held_frames, frame->t_ns)) { /* doubled by a link */
        plr_data_refuse_frame(s, frame, PLR_E_TIME);
        return;
    }
    const plr_time_ns patience = patience_ns(s, frame->t_ns, moved_ns);
    if (plr_clock_was_set_back(s, plr_held_newest_frame_ns(&s->held_frames), moved_ns))
        plr_data_use_waiting(s, UINT64_MAX);
    else if (moved_ns >= patience)
        plr_data_use_waiting(s, moved_ns - patience);
    if (patience == 0 || moved_ns <= s->order.newest_ns) {
        use_in_order(s, frame, moved_ns);
        return;
    }
    if (s->held_frames.count == PLR_SESSION_HELD_FRAMES) {
        s->totals.held_short++;
        use_held(s, plr_held_pop_frame(&s->held_frames, UINT64_MAX));
    }
    plr_held_insert_frame(&s->held_frames, frame, moved_ns);
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

void plr_data_use_truth(plr_session *s) {
    const plr_truth *truth = &s->in.as.truth;
    if (plr_filter_config(&s->filter)->mode == PLR_MODE_MAPPING) {
        plr_steps_apply_held(s, truth->t_ns);
        move_to(s, truth);
    } else if (s->phase == PLR_PHASE_STARTING && !s->start_pending &&
               (s->options.start == PLR_START_AUTO || s->options.start == PLR_START_TRUTH)) {
        plr_steps_apply_held(s, truth->t_ns);
        plr_start_set_pose(s, PLR_KIND_TRUTH, truth->t_ns, &truth->T_WB, NULL);
    }
}

/* --- START among the data --- */

void plr_data_use_start(plr_session *s) {
    plr_data_use_waiting(s, UINT64_MAX);
    s->start = s->in.as.start;
    plr_steps_apply_held(s, UINT64_MAX);
    plr_start_apply(s);
}
