// SPDX-License-Identifier: MIT
#include "session/start.h"

#include <string.h>

#include "pelorus/assertions.h"
#include "pelorus/eyes.h"
#include "session/budget.h"
#include "session/known_map.h"
#include "session/layers.h"
#include "session/line.h"
#include "session/phase.h"
#include "session/plausible.h"
#include "session/queue.h"
#include "session/send.h"

void plr_start_clear(plr_session *s) {
    const uint32_t not_sent = s->totals.not_sent;
    memset(&s->totals, 0, sizeof s->totals);
    s->totals.not_sent = not_sent;
    memset(&s->wanted, 0, sizeof s->wanted);
    memset(&s->last, 0, sizeof s->last);
    s->is_log = s->start_pending = false;
    s->start.has_bias = false;
    s->start_resets = 0;
    s->predict_ns = 0;
    s->imu_status = PLR_OK;
    s->imu_faults = 0;
    plr_queue_clear(&s->queue);
    memset(s->newest_ns, 0, sizeof s->newest_ns);
    memset(&s->order, 0, sizeof s->order);
    plr_known_map_init(&s->known, s->options.known, s->options.known_capacity);
    for (unsigned i = 0; i < s->options.map_count; i++)
        (void)plr_known_map_add(&s->known, &s->options.map[i]); /* plr_session_init has checked */
    s->watch.agreeing = s->step_watch.agreeing = 0;
    if (s->options.eyes != NULL)
        s->options.eyes->calls->clear(s->options.eyes);
    plr_budget_init(&s->budget, s->options.deadline_us);
}

/* --- HEADER, CONFIG, START, LANDMARK --- */

/* Everything that an estimate depends on; the name and the image size are not that. From the
 * calibration to the name there are doubles alone. */
static bool same_header(const plr_header *a, const plr_header *b) {
    enum { BEGIN = offsetof(plr_header, calibration), END = offsetof(plr_header, name) };
    return a->body_axes == b->body_axes && a->twist_timing == b->twist_timing &&
           a->process == b->process && memcmp(&a->calibration, &b->calibration, END - BEGIN) == 0;
}

bool plr_start_in_force(const plr_session *s) {
    const plr_eyes *eyes = s->options.eyes;
    if (s->in.kind == PLR_KIND_RIG)
        return eyes == NULL || eyes->calls->same_rig(eyes, &s->in.as.rig);
    return s->in.kind == PLR_KIND_CONFIG
               ? plr_layers_agree(&s->in.as.config, plr_filter_config(&s->filter))
               : same_header(&s->in.as.header, &s->header);
}

void plr_start_begin(plr_session *s) {
    plr_start_clear(s);
    s->header = s->in.as.header;
    plr_phase_change(&s->phase, PLR_TRIGGER_HEADER);
}

static void report_setting(plr_session *s, plr_wire_setting given, const plr_setting *setting) {
    plr_text *line = &s->out.as.text;
    plr_line_begin(line, PLR_SEVERITY_WARNING, "CONFIG: ");
    if (setting == NULL) {
        plr_line_count(line, "setting ", given.id);
        plr_line_text(line, " is not known here, and left out");
    } else {
        plr_line_text(line, setting->name);
        plr_line_text(line, " = ");
        plr_line_number(line, given.value);
        plr_line_text(line, " is not within ");
        plr_line_number(line, setting->minimum);
        plr_line_text(line, " to ");
        plr_line_number(line, setting->maximum);
        plr_line_text(line, ", and left out");
    }
    plr_send_text(s);
}

void plr_start_change_settings(plr_session *s) {
    const plr_config_message *config = &s->in.as.config;
    plr_phase_change(&s->phase, PLR_TRIGGER_SETTINGS);
    for (unsigned i = 0; i < config->count; i++) {
        const plr_setting *setting = plr_setting_by_id(config->settings[i].id);
        if (plr_layers_want(&s->wanted, config->settings[i]) == PLR_OK)
            continue;
        plr_send_refusal(s, PLR_KIND_CONFIG, 0, PLR_E_CONFIG, setting);
        report_setting(s, config->settings[i], setting);
    }
    if (config->build_fingerprint != 0 && config->build_fingerprint != plr_build_fingerprint())
        plr_send_words(
            s, PLR_SEVERITY_INFO,
            "this log comes from another build (precision, capacity or version): the settings are "
            "taken, the bits may differ");
}

void plr_start_keep(plr_session *s) {
    const plr_start_choice choice = s->options.start;
    s->start = s->in.as.start;
    s->start_pending =
        choice == PLR_START_SAVED || choice == PLR_START_AUTO || choice == PLR_START_RECORDED;
}

void plr_start_add_landmark(plr_session *s) {
    const plr_landmark *landmark = &s->in.as.landmark.landmark;
    const plr_status status = plr_known_map_add(&s->known, landmark);
    if (status != PLR_OK)
        plr_send_refusal(s, PLR_KIND_LANDMARK, landmark->last_seen_ns, status, NULL);
}

/* --- the filter --- */

/* plr_map.sink: always accepts, or a cut link would fill the state; not_sent counts the lost. */
static int send_evicted(void *context, const plr_landmark *landmark) {
    plr_send_landmark(context, PLR_LANDMARK_EVICTED, landmark);
    return 0;
}

/* plr_map.source; the context of both is the session. */
static bool find_known(void *context, uint32_t id, plr_landmark *landmark) {
    plr_session *s = context;
    return plr_known_map_source(&s->known, id, landmark);
}

static bool asks_for_known(const plr_config *config) {
    return config->mode == PLR_MODE_LOCALIZATION || config->known_map != 0;
}

static void warn_about(plr_session *s, const plr_config *config) {
    if (config->model == PLR_MODEL_WORLD && sizeof(plr_real) == sizeof(float) &&
        config->mode != PLR_MODE_DEAD_RECKONING && config->mode != PLR_MODE_MAPPING)
        plr_send_words(
            s, PLR_SEVERITY_WARNING,
            "model = world breaks down in float32 if points are far (max-depth helps), the "
            "start is uncertain or the drive is long: take the float64 build, or model = body");
    if (asks_for_known(config) && s->known.count == 0)
        plr_send_words(
            s, PLR_SEVERITY_WARNING,
            "known landmarks are asked for, and none was given: LANDMARK (known) must come "
            "before the data");
}

/* Which setting makes no sense, and why: the REPORT that follows has no words for it. */
static void tell_contradiction(plr_session *s, const plr_config *config) {
    const plr_setting *culprit;
    const char *why = plr_config_why(config, &culprit);
    if (why == NULL)
        return;
    plr_line_begin(&s->out.as.text, PLR_SEVERITY_ERROR, culprit->name);
    plr_line_text(&s->out.as.text, ": ");
    plr_line_text(&s->out.as.text, why);
    plr_send_text(s);
}

plr_status plr_session_settings(plr_config *config, const plr_header *header,
                                const plr_config_message *wanted, const plr_setting **culprit) {
    const plr_layers layers = {header, wanted, NULL, 0};
    return plr_layers_compose(config, &layers, culprit);
}

static plr_status init_filter(plr_session *s, plr_config *config, const plr_setting **culprit) {
    const plr_layers layers = {&s->header, &s->wanted, s->options.overrides,
                               s->options.override_count};
    plr_status status = plr_layers_compose(config, &layers, culprit);
    if (status != PLR_OK)
        return status;
    const plr_map map = {s, send_evicted, asks_for_known(config) ? find_known : NULL};
    status = plr_filter_init(&s->filter, &s->header.calibration, config, &map);
    if (status == PLR_OK && s->options.left_out != 0)
        status = plr_filter_leave_out(&s->filter, s->options.left_out);
    return status;
}

double plr_camera_offset_s(const plr_config *config) {
    return config->mode == PLR_MODE_MAPPING ? 0 : config->camera_offset_s;
}

plr_status plr_start_filter(plr_session *s) {
    PLR_ASSERT(s->phase == PLR_PHASE_READY);
    const plr_setting *culprit = NULL;
    plr_config config;
    const plr_status status = init_filter(s, &config, &culprit);
    if (status == PLR_OK && s->options.eyes != NULL)
        s->options.eyes->calls->begin(s->options.eyes, &s->header, plr_camera_offset_s(&config));
    if (status != PLR_OK) {
        plr_phase_change(&s->phase, PLR_TRIGGER_REJECTED);
        tell_contradiction(s, &config);
        plr_send_refusal(s, status == PLR_E_CONFIG ? PLR_KIND_CONFIG : PLR_KIND_HEADER, 0, status,
                         culprit);
    }
    return status;
}

void plr_start_announce(plr_session *s) {
    plr_send_config(s);
    for (unsigned i = 0; i < s->options.map_count; i++)
        plr_send_landmark(s, PLR_LANDMARK_KNOWN, &s->options.map[i]);
    if (s->options.observer.started != NULL)
        s->options.observer.started(s->options.observer.context);
    warn_about(s, plr_filter_config(&s->filter));
}

/* --- the start pose --- */

void plr_start_set_bias(plr_session *s) {
    if (!s->start.has_bias || plr_filter_config(&s->filter)->bias == 0)
        return;
    const plr_status status =
        plr_plausible(PLR_GROUP_BIAS, &s->start)
            ? plr_filter_set_bias(&s->filter, s->start.bias, s->start.bias_variance)
            : PLR_E_RANGE;
    if (status != PLR_OK)
        plr_send_refusal(s, PLR_KIND_START, s->start.t_ns, status, NULL);
}

plr_status plr_start_set_pose(plr_session *s, plr_kind subject, plr_time_ns t_ns,
                              const plr_pose *T_WB, const double *P_xi) {
    const plr_status status = plr_plausible(PLR_GROUP_POSE, T_WB)
                                  ? plr_filter_set_pose(&s->filter, t_ns, T_WB, P_xi)
                                  : PLR_E_RANGE;
    if (status != PLR_OK) {
        plr_send_refusal(s, subject, t_ns, status, NULL);
        return status;
    }
    s->watch.agreeing = 0;
    if (s->phase == PLR_PHASE_STARTING)
        plr_send_resets_become(s, 0);
    plr_phase_change(&s->phase, PLR_TRIGGER_POSE);
    return PLR_OK;
}

/* The velocity of a START, with an IMU and where it is given. */
static void set_velocity(plr_session *s) {
    const double *variance = s->start.velocity_variance;
    if (plr_filter_config(&s->filter)->process != PLR_PROCESS_IMU ||
        !(variance[0] > 0 && variance[1] > 0 && variance[2] > 0))
        return;
    plr_status status = PLR_E_RANGE;
    if (plr_plausible(PLR_GROUP_VELOCITY, &s->start))
        status = plr_filter_set_velocity(&s->filter, s->start.velocity, variance);
    if (status != PLR_OK)
        plr_send_refusal(s, PLR_KIND_START, s->start.t_ns, status, NULL);
}

void plr_start_apply(plr_session *s) {
    double P[36];
    for (unsigned i = 0, k = 0; i < 6; i++)
        for (unsigned j = 0; j <= i; j++, k++)
            P[6 * i + j] = P[6 * j + i] = s->start.P_xi[k];
    s->start_pending = false;
    if (plr_start_set_pose(s, PLR_KIND_START, s->start.t_ns, &s->start.T_WB,
                           s->start.has_covariance ? P : NULL) == PLR_OK)
        set_velocity(s);
}

void plr_start_apply_until(plr_session *s, plr_time_ns t_ns) {
    if (s->start_pending && t_ns >= s->start.t_ns)
        plr_start_apply(s);
}

void plr_start_choose(plr_session *s, plr_time_ns t_ns) {
    plr_start_apply_until(s, t_ns);
    if (s->start_pending) { /* it lies behind the first frame */
        s->start_pending = false;
        plr_send_refusal(s, PLR_KIND_START, s->start.t_ns, PLR_E_TIME, NULL);
    }
    if (s->options.start == PLR_START_AUTO || s->options.start == PLR_START_IDENTITY)
        plr_phase_change(&s->phase, PLR_TRIGGER_POSE);
}
