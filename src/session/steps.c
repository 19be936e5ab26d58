// SPDX-License-Identifier: MIT
#include "session/steps.h"

#include "pelorus/assertions.h"
#include "session/clock.h"
#include "session/line.h"
#include "session/reanchor.h"
#include "session/send.h"
#include "session/start.h"

/* How long after a late step no fault of the IMU is reported. */
#define LATE_NS UINT64_C(1000000000)

bool plr_steps_are_inertial(const plr_session *s) {
    return plr_filter_config(&s->filter)->process == PLR_PROCESS_IMU;
}

/* --- late ones --- */

void plr_steps_note_arrival(plr_session *s, plr_time_ns t_ns) {
    plr_step_order *order = &s->order;
    order->came = true;
    if (t_ns > order->newest_ns || plr_clock_was_set_back(s, order->newest_ns, t_ns))
        order->newest_ns = t_ns;
}

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
    plr_line_begin(line, PLR_SEVERITY_WARNING,
                   plr_steps_are_inertial(s) ? "IMU readings" : "TWISTs");
    plr_line_text(line, " come late: what was used before them is newer, here by ");
    plr_line_time(line, needed_ns + 999999); /* upwards, for it is to be enough */
    plr_line_text(line, ", and they are refused. Set twist-delay to that or more: then frames and "
                        "readings of other sensors wait for them");
    plr_send_text(s);
}

/* --- refusing --- */

void plr_steps_refuse(plr_session *s, plr_time_ns t_ns, plr_status status) {
    if (!plr_steps_are_inertial(s)) {
        plr_send_refusal(s, PLR_KIND_TWIST, t_ns, status, NULL);
        return;
    }
    s->totals.imu_refused++;
    if (status != s->imu_status)
        plr_send_refusal(s, PLR_KIND_IMU, t_ns, status, NULL);
    s->imu_status = status;
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

/* --- using --- */

void plr_steps_use_reading(plr_session *s, const plr_reading *reading) {
    const plr_status status = plr_filter_measure(&s->filter, reading, NULL);
    if (status == PLR_OK)
        plr_steps_note_used(s, reading->t_ns);
    else
        plr_send_refusal(s, PLR_KIND_READING, reading->t_ns, status, NULL);
}

static plr_status predict(plr_session *s, const plr_event *step) {
    const plr_moved_by *by = &step->as.step;
    const uint64_t begin = plr_clock_now_ns(s);
    const plr_status status = plr_steps_are_inertial(s)
                                  ? plr_filter_inertial(&s->filter, step->t_ns, &by->imu)
                                  : plr_filter_predict(&s->filter, step->t_ns, &by->twist);
    s->predict_ns += plr_clock_elapsed_ns(s, begin);
    return status;
}

void plr_steps_use(plr_session *s, const plr_event *step) {
    PLR_ASSERT(step->kind == PLR_EVENT_STEP);
    plr_start_apply_until(s, step->t_ns);
    plr_status status = predict(s, step);
    /* of a batch the first speaks for the sender's clock: the others have their times from it */
    if ((step->leads || status == PLR_OK) && plr_reanchor_follow(s, step->t_ns, status))
        status = predict(s, step);
    const bool late = is_late(s, step->t_ns, status);
    if (late)
        note_late(s, step->t_ns);
    if (plr_steps_are_inertial(s))
        report_fault(s);
    if (status != PLR_OK) {
        plr_steps_refuse(s, step->t_ns, late ? PLR_E_LATE : status);
        return;
    }
    s->order.stepped = true;
    s->order.stepped_ns = step->t_ns;
    s->imu_status = PLR_OK;
    if ((s->options.output & PLR_OUTPUT_TWIST_POSE) != 0)
        (void)plr_send_pose(s, false);
}
