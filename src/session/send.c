// SPDX-License-Identifier: MIT
#include "session/send.h"

#include <string.h>

#include "session/layers.h"
#include "session/line.h"

#define CALIBRATION_EVERY_NS UINT64_C(1000000000)

static void put(plr_session *s, uint32_t bit, const plr_message *message) {
    if (s->port.write == NULL || (s->options.output & bit) == 0)
        return;
    if (plr_writer_put(&s->writer, message) != PLR_OK)
        s->totals.not_sent++;
}

void plr_send_echo(plr_session *s) {
    put(s, PLR_OUTPUT_ECHO, &s->in);
}

void plr_send_config(plr_session *s) {
    s->out.kind = PLR_KIND_CONFIG;
    plr_layers_describe(&s->out.as.config, plr_filter_config(&s->filter));
    put(s, PLR_OUTPUT_CONFIG, &s->out);
}

/* The filter's covariance, its lower triangle row by row; where it has diverged and has none,
 * PLR_WIRE_UNKNOWN_VARIANCE. */
static bool describe_covariance(double packed[21], double P[36], plr_status status) {
    if (status == PLR_E_DIVERGED) {
        memset(P, 0, 36 * sizeof *P);
        for (unsigned i = 0; i < 36; i += 7)
            P[i] = PLR_WIRE_UNKNOWN_VARIANCE;
    } else if (status != PLR_OK) {
        return false;
    }
    for (unsigned i = 0, k = 0; i < 6; i++)
        for (unsigned j = 0; j <= i; j++)
            packed[k++] = P[6 * i + j];
    return true;
}

/* Trace and variances of the biases are sent once a frame: they take as long as the rest. */
static bool describe_pose(plr_pose_message *pose, const plr_filter *f, bool after_update) {
    double P[36];
    if (plr_filter_pose(f, &pose->T_WB) != PLR_OK ||
        plr_filter_velocity(f, &pose->velocity) != PLR_OK)
        return false;
    if (!describe_covariance(pose->P_xi, P, plr_filter_pose_covariance(f, P)) ||
        !describe_covariance(pose->P_u, P, plr_filter_velocity_covariance(f, P)))
        return false;
    const bool all = after_update && plr_filter_bias(f, pose->bias, P) == PLR_OK;
    if (!all && plr_filter_bias(f, pose->bias, NULL) != PLR_OK)
        return false;
    pose->trace = all ? plr_filter_trace(f) : -1;
    for (unsigned i = 0; i < 6; i++)
        pose->bias_variance[i] = all ? P[7 * i] : -1;
    return true;
}

/* A controller must not mistake the jump of a reset for motion. */
static uint32_t resets(const plr_filter *f) {
    plr_totals totals;
    return plr_filter_totals(f, &totals) == PLR_OK ? totals.resets + totals.widened : 0;
}

uint32_t plr_send_resets(const plr_session *s) {
    return resets(&s->filter) - s->start_resets;
}

void plr_send_resets_become(plr_session *s, uint32_t number) {
    s->start_resets = resets(&s->filter) - number; /* modulo 2^32 */
}

const plr_pose_message *plr_send_pose(plr_session *s, bool after_update) {
    plr_pose_message *pose = &s->out.as.pose;
    s->out.kind = PLR_KIND_POSE;
    memset(pose, 0, sizeof *pose);
    if (!describe_pose(pose, &s->filter, after_update))
        return NULL;
    pose->t_ns = plr_filter_time(&s->filter);
    pose->real_bytes = (uint8_t)sizeof(plr_real);
    pose->after_update = after_update;
    pose->reset_count = (uint16_t)plr_send_resets(s);
    put(s, after_update ? PLR_OUTPUT_POSE : PLR_OUTPUT_TWIST_POSE, &s->out);
    if (s->options.observer.pose != NULL)
        s->options.observer.pose(s->options.observer.context, pose);
    return pose;
}

static void put_report(plr_session *s, plr_kind subject, const plr_report *report,
                       uint64_t compute_ns, plr_notice notice) {
    const uint64_t us = compute_ns / 1000u;
    s->out.kind = PLR_KIND_REPORT;
    s->out.as.report.subject = (uint8_t)subject;
    s->out.as.report.notice = (uint8_t)notice;
    s->out.as.report.report = *report;
    s->out.as.report.update_us = us < UINT32_MAX ? (uint32_t)us : UINT32_MAX;
    put(s, PLR_OUTPUT_REPORT, &s->out);
}

void plr_send_calibration(plr_session *s) {
    plr_calibration_result *told = &s->out.as.calibration;
    s->out.kind = PLR_KIND_CALIBRATION;
    if (plr_filter_calibration(&s->filter, told) == PLR_OK && told->estimated != 0) {
        s->calibration_ns = told->t_ns;
        put(s, PLR_OUTPUT_REPORT, &s->out);
    }
}

void plr_send_report(plr_session *s, const plr_report *report, uint64_t compute_ns) {
    put_report(s, PLR_KIND_STEREO, report, compute_ns, PLR_NOTICE_NONE);
    if (report->t_ns - s->calibration_ns >= CALIBRATION_EVERY_NS)
        plr_send_calibration(s);
    if ((s->options.output & PLR_OUTPUT_EVIDENCE) == 0 || report->status != PLR_OK)
        return;
    s->out.kind = PLR_KIND_EVIDENCE;
    if (plr_filter_supervision(&s->filter, &s->out.as.evidence) != PLR_OK)
        return;
    s->out.as.evidence.t_ns = report->t_ns; /* by which the frame's sender knows it */
    put(s, PLR_OUTPUT_EVIDENCE, &s->out);
}

void plr_send_answer(plr_session *s, plr_kind subject, plr_time_ns t_ns, plr_status status,
                     plr_notice notice) {
    plr_report report;
    plr_health_state now; /* at the filter's own time: that of what is refused may be any */
    memset(&report, 0, sizeof report);
    report.t_ns = t_ns;
    report.status = status;
    const bool known = plr_filter_health(&s->filter, 0, &now) == PLR_OK;
    report.health = known ? now.health : s->last.health;
    report.reasons = known ? now.reasons : s->last.reasons;
    report.budget = PLR_NO_BUDGET;
    report.active = s->last.active;
    put_report(s, subject, &report, 0, notice);
}

void plr_send_refusal(plr_session *s, plr_kind subject, plr_time_ns t_ns, plr_status status,
                      const plr_setting *culprit) {
    s->totals.refused++;
    plr_send_answer(s, subject, t_ns, status, PLR_NOTICE_NONE);
    if (s->options.observer.refused != NULL)
        s->options.observer.refused(s->options.observer.context, subject, t_ns, status, culprit);
}

void plr_send_frame_refusal(plr_session *s, const plr_frame *frame, plr_status status) {
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

void plr_send_landmark(plr_session *s, plr_landmark_role role, const plr_landmark *landmark) {
    const bool computed = role != PLR_LANDMARK_KNOWN;
    s->out.kind = PLR_KIND_LANDMARK;
    s->out.as.landmark.role = (uint8_t)role;
    s->out.as.landmark.landmark = *landmark;
    put(s, computed ? PLR_OUTPUT_LANDMARK : PLR_OUTPUT_ECHO, &s->out);
    if (computed && s->options.observer.landmark != NULL)
        s->options.observer.landmark(s->options.observer.context, &s->out.as.landmark);
}

void plr_send_text(plr_session *s) {
    s->out.kind = PLR_KIND_TEXT;
    put(s, PLR_OUTPUT_TEXT, &s->out);
    if (s->options.observer.text != NULL)
        s->options.observer.text(s->options.observer.context, &s->out.as.text);
}

void plr_send_words(plr_session *s, plr_severity severity, const char *words) {
    plr_line_begin(&s->out.as.text, severity, words);
    plr_send_text(s);
}

void plr_send_describe_end(const plr_session *s, plr_end *end) {
    const plr_session_totals *got = &s->totals;
    const uint32_t *sent = s->in.as.end.sent;
    const uint32_t arrived[PLR_COUNTED] = {got->twists,    got->stereos,  got->truths,
                                           got->landmarks, got->readings, got->imus};
    memset(end, 0, sizeof *end);
    for (unsigned i = 0; i < PLR_COUNTED && s->in.kind == PLR_KIND_END; i++)
        if (arrived[i] != sent[i]) {
            end->differs |= (uint8_t)(1U << i);
            end->arrived[i] = arrived[i];
        }
}

void plr_send_end(plr_session *s) {
    s->out.kind = PLR_KIND_END;
    plr_send_describe_end(s, &s->out.as.end);
    put(s, PLR_OUTPUT_END, &s->out);
}
