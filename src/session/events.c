// SPDX-License-Identifier: MIT
#include "session/events.h"

#include "pelorus/assertions.h"
#include "session/plausible.h"
#include "session/queue.h"
#include "session/reanchor.h"
#include "session/send.h"
#include "session/start.h"
#include "session/use.h"

/* --- leaving --- */

/* What does not go after an event of that time and kind. */
static void use_until(plr_session *s, plr_time_ns t_ns, plr_event_kind kind) {
    plr_event event;
    while (plr_queue_pop_until(&s->queue, t_ns, kind, &event))
        plr_use(s, &event);
}

void plr_events_use_all(plr_session *s) {
    use_until(s, UINT64_MAX, PLR_EVENT_READING);
}

/* The events of the kind up to t_ns, and all that goes before them. */
static void use_kind_until(plr_session *s, plr_time_ns t_ns, plr_event_kind kind) {
    plr_time_ns first_ns;
    while (plr_queue_first_ns(&s->queue, kind, &first_ns) && first_ns <= t_ns)
        use_until(s, first_ns, kind);
}

void plr_events_use_frames_before(plr_session *s, plr_time_ns t_ns) {
    if (t_ns > 0)
        use_kind_until(s, t_ns - 1, PLR_EVENT_FRAME);
}

/* --- waiting --- */

/* How long events of a kind wait: twist-delay, and as far as the clock of frames is behind that of
 * the steps or, for frames, ahead of it. */
static plr_time_ns delay_ns(const plr_session *s, plr_event_kind kind) {
    const plr_config *config = plr_filter_config(&s->filter);
    const double moved_s = config->camera_offset_s;
    const double ahead_s = kind == PLR_EVENT_FRAME ? moved_s : -moved_s;
    if (kind == PLR_EVENT_FRAME && config->mode == PLR_MODE_MAPPING)
        return 0; /* each frame has its TRUTH, and needs no step */
    return (plr_time_ns)((config->twist_delay_s + (ahead_s > 0 ? ahead_s : 0)) * 1e9 + 0.5);
}

static bool frames_wait(const plr_session *s) {
    return s->queue.counts[PLR_EVENT_FRAME] > 0;
}

static bool must_wait(const plr_session *s, const plr_event *event) {
    const bool delayed = delay_ns(s, event->kind) > 0;
    return event->kind == PLR_EVENT_FRAME ? delayed && event->t_ns > s->newest_ns[PLR_EVENT_STEP]
                                          : delayed || frames_wait(s);
}

/* A reading that lies beyond the last step by more than max-gap, so that the filter refuses it: others
 * do not wait for it, and it does not for them. */
static bool is_out_of_reach(const plr_session *s, const plr_event *event) {
    return event->kind == PLR_EVENT_READING && s->order.came &&
           plr_clock_was_set_back(s, event->t_ns, s->newest_ns[PLR_EVENT_STEP]);
}

static void wait(plr_session *s, const plr_event *event) {
    plr_event first;
    s->totals.held_short += plr_queue_is_full(&s->queue, event->kind);
    while (plr_queue_is_full(&s->queue, event->kind) &&
           plr_queue_pop_until(&s->queue, UINT64_MAX, PLR_EVENT_READING, &first))
        plr_use(s, &first);
    plr_queue_insert(&s->queue, event);
}

/* Frames to whose time the steps have come; then steps that have waited long enough. */
static void use_ready(plr_session *s) {
    const plr_time_ns newest_ns = s->newest_ns[PLR_EVENT_STEP];
    const plr_time_ns delay = delay_ns(s, PLR_EVENT_STEP);
    use_kind_until(s, newest_ns, PLR_EVENT_FRAME);
    if (!frames_wait(s) && newest_ns >= delay)
        use_kind_until(s, newest_ns - delay, PLR_EVENT_STEP);
}

/* Notes the time of a step or frame that arrived. What waits is used first where another clock
 * begins. */
static void note_arrival(plr_session *s, const plr_event *event) {
    plr_time_ns *newest_ns = &s->newest_ns[event->kind];
    const bool set_back = plr_clock_was_set_back(s, *newest_ns, event->t_ns);
    s->order.came = s->order.came || event->kind == PLR_EVENT_STEP;
    if (set_back || event->t_ns > *newest_ns)
        *newest_ns = event->t_ns;
    if (set_back)
        plr_events_use_all(s);
    PLR_ASSERT(event->t_ns <= *newest_ns);
}

static void take(plr_session *s, const plr_event *event) {
    const plr_event_kind kind = event->kind;
    const plr_time_ns t_ns = event->t_ns, delay = delay_ns(s, kind);
    PLR_ASSERT(s->phase >= PLR_PHASE_STARTING);
    if (kind != PLR_EVENT_READING && plr_queue_holds(&s->queue, kind, t_ns)) {
        plr_use_refuse(s, event, PLR_E_TIME); /* doubled by a link */
        return;
    }
    if (kind != PLR_EVENT_READING)
        note_arrival(s, event);
    if (kind == PLR_EVENT_FRAME && t_ns >= delay)
        use_kind_until(s, t_ns - delay, kind);
    if (is_out_of_reach(s, event)) {
        plr_use(s, event);
    } else if (must_wait(s, event)) {
        wait(s, event);
    } else {
        use_until(s, t_ns, kind);
        plr_use(s, event);
    }
    use_ready(s);
}

/* --- steps --- */

/* True if the message is of that process, which is in force; another one is refused. */
static bool is_of_process(plr_session *s, plr_process_kind process, plr_time_ns t_ns) {
    if (plr_filter_config(&s->filter)->process == process)
        return true;
    if (s->totals.other_process++ > 0)
        return false;
    plr_send_refusal(s, s->in.kind, t_ns, PLR_E_MODE, plr_setting_by_name("process"));
    plr_send_words(
        s, PLR_SEVERITY_WARNING,
        process == PLR_PROCESS_IMU
            ? "IMU readings come, and the setting process is twist: none of them is used. "
              "Set process = imu, or let the HEADER say so"
            : "TWISTs come, and the setting process is imu: none of them is used. Send "
              "measured speeds as READINGs of a wheel, or set process = twist");
    return false;
}

void plr_events_take_twist(plr_session *s) {
    const plr_twist_message *twist = &s->in.as.twist;
    const plr_event event = {
        .t_ns = twist->t_ns, .kind = PLR_EVENT_STEP, .leads = true, .as.step.twist = twist->twist};
    if (is_of_process(s, PLR_PROCESS_TWIST, twist->t_ns))
        take(s, &event);
}

void plr_events_take_imu(plr_session *s) {
    const plr_imu_message *imu = &s->in.as.imu;
    if (!is_of_process(s, PLR_PROCESS_IMU, imu->t_ns))
        return;
    for (unsigned i = 0; i < imu->count; i++) {
        const plr_event event = {.t_ns = imu->t_ns + (plr_time_ns)i * imu->period_ns,
                                 .kind = PLR_EVENT_STEP,
                                 .leads = i == 0,
                                 .as.step.imu = imu->readings[i]};
        if (event.t_ns < imu->t_ns) /* beyond the clock's end */
            plr_use_refuse(s, &event, PLR_E_TIME);
        else if (!plr_plausible(PLR_GROUP_IMU, &event.as.step.imu))
            plr_use_refuse(s, &event, PLR_E_RANGE);
        else
            take(s, &event);
    }
}

/* --- STEREO, READING --- */

/* To the clock of the steps. False if there is no such time. */
static bool move(const plr_session *s, plr_time_ns t_ns, plr_time_ns *moved_ns) {
    const double offset_ns = plr_camera_offset_s(plr_filter_config(&s->filter)) * 1e9;
    const bool back = offset_ns < 0;
    const plr_time_ns by_ns = (plr_time_ns)((back ? -offset_ns : offset_ns) + 0.5);
    if (back ? t_ns < by_ns : t_ns > UINT64_MAX - by_ns)
        return false;
    *moved_ns = back ? t_ns - by_ns : t_ns + by_ns;
    return true;
}

void plr_events_take_stereo(plr_session *s) {
    plr_event event = {.kind = PLR_EVENT_FRAME, .as.frame = s->in.as.stereo};
    if (move(s, s->in.as.stereo.t_ns, &event.t_ns))
        take(s, &event);
    else
        plr_use_refuse(s, &event, PLR_E_TIME);
}

void plr_events_take_reading(plr_session *s) {
    const plr_reading *reading = &s->in.as.reading;
    const plr_event event = {
        .t_ns = reading->t_ns, .kind = PLR_EVENT_READING, .as.reading = *reading};
    take(s, &event);
}

/* --- TRUTH, START --- */

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

void plr_events_take_truth(plr_session *s) {
    const plr_truth *truth = &s->in.as.truth;
    const bool mapping = plr_filter_config(&s->filter)->mode == PLR_MODE_MAPPING;
    const bool starts = s->phase == PLR_PHASE_STARTING && !s->start_pending &&
                        (s->options.start == PLR_START_AUTO || s->options.start == PLR_START_TRUTH);
    if (!mapping && !starts)
        return;
    use_until(s, truth->t_ns, PLR_EVENT_STEP);
    if (mapping)
        move_to(s, truth);
    else
        (void)plr_start_set_pose(s, PLR_KIND_TRUTH, truth->t_ns, &truth->T_WB, NULL);
}

void plr_events_take_start(plr_session *s) {
    plr_events_use_all(s);
    s->start = s->in.as.start;
    plr_start_apply(s);
}
