// SPDX-License-Identifier: MIT
#include "session/steps.h"

#include "session/clock.h"
#include "session/held.h"
#include "session/line.h"
#include "session/plausible.h"
#include "session/reanchor.h"
#include "session/send.h"
#include "session/start.h"

static bool is_inertial(const plr_session *s) {
    return plr_filter_config(&s->filter)->process == PLR_PROCESS_IMU;
}

/* After an IMU message that came late its faults are not told for so long: of readings that have
 * holes nearly everything looks wrong. */
#define LATE_NS UINT64_C(1000000000)

/* --- late ones --- */

void plr_steps_note_used(plr_session *s, plr_time_ns t_ns) {
    plr_step_order *order = &s->order;
    order->used = true;
    order->used_ns = t_ns;
    order->ahead_ns = order->came && t_ns > order->newest_ns ? t_ns - order->newest_ns : 0;
}

/* True if the filter refused a step because of something later that was used before, but no step. */
static bool is_late(const plr_session *s, plr_time_ns t_ns, plr_status status) {
    const plr_step_order *order = &s->order;
    return status == PLR_E_TIME && order->used && t_ns < order->used_ns &&
           order->used_ns == plr_filter_time(&s->filter) &&
           (!order->stepped || t_ns > order->stepped_ns);
}

/* Told once, and again where it has become twice as much. */
static void note_late(plr_session *s, plr_time_ns t_ns) {
    plr_step_order *order = &s->order;
    plr_text *line = &s->out.as.text;
    const plr_time_ns behind_ns = order->used_ns - t_ns;
    const plr_time_ns needed_ns = behind_ns > order->ahead_ns ? behind_ns : order->ahead_ns;
    s->totals.late++;
    order->late_ns = order->used_ns;
    if (needed_ns < 2 * order->told_ns || needed_ns > plr_clock_max_gap_ns(s))
        return;
    order->told_ns = needed_ns;
    plr_line_begin(line, PLR_SEVERITY_WARNING, is_inertial(s) ? "IMU readings" : "TWISTs");
    plr_line_text(line, " come late: what was used before them is newer, here by ");
    plr_line_time(line, needed_ns + 999999); /* upwards, for it is to be enough */
    plr_line_text(line, ", and they are refused. Set twist-delay to that or more: then frames and "
                        "readings of other sensors wait for them");
    plr_send_text(s);
}

/* --- refusing --- */

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

/* The message is of the other process. */
static void refuse_other(plr_session *s, plr_kind kind, plr_time_ns t_ns) {
    if (s->totals.other_process++ > 0)
        return;
    plr_send_refusal(s, kind, t_ns, PLR_E_MODE, plr_setting_by_name("process"));
    plr_send_words(
        s, PLR_SEVERITY_WARNING,
        kind == PLR_KIND_IMU
            ? "IMU readings come, and the setting process is twist: none of them is used. "
              "Set process = imu, or let the HEADER say so"
            : "TWISTs come, and the setting process is imu: none of them is used. Send "
              "measured speeds as READINGs of a wheel, or set process = twist");
}

/* Each fault of the IMU is told once in a drive. */
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

/* --- applying --- */

static void apply_reading(plr_session *s, const plr_reading *reading) {
    const plr_status status = plr_filter_measure(&s->filter, reading, NULL);
    if (status == PLR_OK)
        plr_steps_note_used(s, reading->t_ns);
    else
        plr_send_refusal(s, PLR_KIND_READING, reading->t_ns, status, NULL);
}

/* The readings that wait and are older. */
static void apply_readings_before(plr_session *s, plr_time_ns t_ns) {
    plr_reading reading;
    while (plr_held_pop_older(&s->held_readings, t_ns, &reading))
        apply_reading(s, &reading);
}

static plr_status predict(plr_session *s, const plr_held_step *step) {
    const uint64_t begin = plr_clock_now_ns(s);
    const plr_status status = is_inertial(s)
                                  ? plr_filter_inertial(&s->filter, step->t_ns, &step->by.imu)
                                  : plr_filter_predict(&s->filter, step->t_ns, &step->by.twist);
    s->predict_ns += plr_clock_elapsed_ns(s, begin);
    return status;
}

/* A step, after the readings that wait and are older than it. */
static void apply_step(plr_session *s, const plr_held_step *step) {
    apply_readings_before(s, step->t_ns);
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
    if (status != PLR_OK) {
        refuse_step(s, step->t_ns, late ? PLR_E_LATE : status);
        return;
    }
    s->order.stepped = true;
    s->order.stepped_ns = step->t_ns;
    s->imu_status = PLR_OK;
    if ((s->options.output & PLR_OUTPUT_TWIST_POSE) != 0)
        (void)plr_send_pose(s, false);
}

static void apply_until(plr_session *s, plr_time_ns until_ns) {
    plr_held_step step;
    while (plr_held_pop(&s->held, until_ns, &step))
        apply_step(s, &step);
}

void plr_steps_apply_held(plr_session *s, plr_time_ns until_ns) {
    apply_until(s, until_ns);
    apply_readings_before(s, until_ns);
}

/* --- now, or later --- */

/* A frame that camera-offset moves back is late by so much more. */
static plr_time_ns delay_ns(const plr_session *s) {
    const plr_config *config = plr_filter_config(&s->filter);
    const double back_s = config->camera_offset_s < 0 ? -config->camera_offset_s : 0;
    return (plr_time_ns)((config->twist_delay_s + back_s) * 1e9 + 0.5);
}

static bool steps_wait(const plr_session *s) {
    return delay_ns(s) > 0 || s->held_frames.count > 0;
}

void plr_steps_apply_due(plr_session *s) {
    const plr_time_ns newest_ns = plr_held_newest_ns(&s->held), delay = delay_ns(s);
    if (newest_ns >= delay)
        apply_until(s, newest_ns - delay);
}

static void delay_step(plr_session *s, const plr_held_step *step) {
    plr_held_step due;
    if (plr_clock_was_set_back(s, plr_held_newest_ns(&s->held), step->t_ns))
        plr_steps_apply_held(s, UINT64_MAX);
    if (s->held.count == PLR_SESSION_HELD_TWISTS && plr_held_pop(&s->held, UINT64_MAX, &due)) {
        s->totals.held_short++;
        apply_step(s, &due);
    }
    if (!plr_held_insert(&s->held, step))
        refuse_step(s, step->t_ns, PLR_E_TIME);
    if (s->held_frames.count == 0)
        plr_steps_apply_due(s);
}

static void use_step(plr_session *s, const plr_held_step *step) {
    s->order.came = true;
    if (step->t_ns > s->order.newest_ns ||
        plr_clock_was_set_back(s, s->order.newest_ns, step->t_ns)) /* which is followed */
        s->order.newest_ns = step->t_ns;
    if (steps_wait(s))
        delay_step(s, step);
    else
        apply_step(s, step);
}

void plr_steps_use_twist(plr_session *s) {
    const plr_twist_message *twist = &s->in.as.twist;
    const plr_held_step step = {.t_ns = twist->t_ns, .by.twist = twist->twist, .leads = true};
    if (is_inertial(s))
        refuse_other(s, PLR_KIND_TWIST, twist->t_ns);
    else
        use_step(s, &step);
}

void plr_steps_use_imu(plr_session *s) {
    const plr_imu_message *imu = &s->in.as.imu;
    if (!is_inertial(s)) {
        refuse_other(s, PLR_KIND_IMU, imu->t_ns);
        return;
    }
    for (unsigned i = 0; i < imu->count; i++) {
        const plr_held_step step = {.t_ns = imu->t_ns + (plr_time_ns)i * imu->period_ns,
                                    .by.imu = imu->readings[i],
                                    .leads = i == 0};
        if (step.t_ns < imu->t_ns) /* beyond the clock's end */
            refuse_step(s, imu->t_ns, PLR_E_TIME);
        else if (!plr_plausible(PLR_GROUP_IMU, &step.by.imu))
            refuse_step(s, step.t_ns, PLR_E_RANGE);
        else
            use_step(s, &step);
    }
}

void plr_steps_use_reading(plr_session *s) {
    const plr_reading *reading = &s->in.as.reading;
    plr_reading oldest;
    if (!steps_wait(s)) {
        apply_reading(s, reading);
        return;
    }
    if (s->held_readings.count == PLR_SESSION_HELD_READINGS &&
        plr_held_pop_older(&s->held_readings, UINT64_MAX, &oldest)) {
        s->totals.held_short++;
        apply_reading(s, &oldest);
    }
    plr_held_insert_reading(&s->held_readings, reading);
}
