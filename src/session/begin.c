// SPDX-License-Identifier: MIT
#include "session/begin.h"

#include <string.h>

#include "session/budget.h"
#include "session/held.h"
#include "session/known_map.h"
#include "session/layers.h"
#include "session/line.h"
#include "session/plausible.h"
#include "session/reanchor.h"
#include "session/saving.h"
#include "session/send.h"

void plr_begin_anew(plr_session *s) {
    const uint32_t not_sent = s->totals.not_sent;
    memset(&s->totals, 0, sizeof s->totals);
    s->totals.not_sent = not_sent;
    memset(&s->wanted, 0, sizeof s->wanted);
    memset(&s->last, 0, sizeof s->last);
    s->is_log = s->start_known = s->started = s->restored = s->init_failed = false;
    s->start.has_bias = false;
    s->start_resets = 0;
    s->predict_ns = 0;
    plr_held_init(&s->held);
    plr_known_map_init(&s->known, s->options.known, s->options.known_capacity);
    for (unsigned i = 0; i < s->options.map_count; i++)
        (void)plr_known_map_add(&s->known, &s->options.map[i]); /* plr_session_init has checked */
    plr_clock_watch_init(&s->watch);
    plr_budget_init(&s->budget, s->options.deadline_us);
}

/* plr_map.sink: always takes. A cut link must not fill the state with landmarks that nobody wants;
 * what the port does not take is counted in totals.not_sent. */
static int take_evicted(void *context, const plr_landmark *landmark) {
    plr_send_landmark(context, PLR_LANDMARK_EVICTED, landmark);
    return 0;
}

/* plr_map.source; the context of both is the session. */
static bool ask_known(void *context, uint32_t id, plr_landmark *landmark) {
    plr_session *s = context;
    return plr_known_map_source(&s->known, id, landmark);
}

static void warn(plr_session *s, const char *words) {
    plr_line_begin(&s->out.as.text, PLR_SEVERITY_WARNING);
    plr_line_words(&s->out.as.text, words);
    plr_send_text(s);
}

static void warn_about(plr_session *s, const plr_config *config) {
    const bool asks = config->mode == PLR_MODE_LOCALIZATION || config->known_map != 0;
    if (config->model == PLR_MODEL_WORLD && sizeof(plr_real) == sizeof(float) &&
        config->mode != PLR_MODE_DEAD_RECKONING && config->mode != PLR_MODE_MAPPING)
        warn(s, "model = world breaks down in float32 if points are far (max-depth helps), the "
                "start is uncertain or the drive is long: take the float64 build, or model = body");
    if (asks && s->known.count == 0)
        warn(s, "known landmarks are asked for, and none was given: LANDMARK (known) must come "
                "before the data");
}

static plr_status start_filter(plr_session *s, const plr_setting **culprit) {
    const plr_layers layers = {&s->header, &s->wanted, s->options.overrides,
                               s->options.override_count};
    plr_config config;
    plr_status status = plr_layers_compose(&config, &layers, culprit);
    if (status != PLR_OK)
        return status;
    const bool asks = config.mode == PLR_MODE_LOCALIZATION || config.known_map != 0;
    const plr_map map = {s, take_evicted, asks ? ask_known : NULL};
    return plr_filter_init(&s->filter, &s->header.calibration, &config, &map);
}

/* What a START said about the bias counts whatever the pose starts from. */
static void apply_bias_prior(plr_session *s) {
    if (!s->start.has_bias || plr_filter_config(&s->filter)->bias == 0)
        return;
    plr_status status = PLR_E_RANGE;
    if (plr_plausible_bias(&s->start))
        status = plr_filter_set_bias(&s->filter, s->start.bias, s->start.bias_variance);
    if (status != PLR_OK)
        plr_send_refusal(s, PLR_KIND_START, s->start.t_ns, status, NULL);
}

bool plr_begin_filter(plr_session *s) {
    if (s->phase == PLR_PHASE_WAITING || s->init_failed)
        return false;
    const plr_setting *culprit = NULL;
    const plr_status status = start_filter(s, &culprit);
    if (status != PLR_OK) {
        s->init_failed = true;
        plr_send_refusal(s, status == PLR_E_CONFIG ? PLR_KIND_CONFIG : PLR_KIND_HEADER, 0, status,
                         culprit);
        return false;
    }
    return true;
}

void plr_begin_announce(plr_session *s) {
    s->phase = PLR_PHASE_RUNNING;
    plr_send_config(s);
    for (unsigned i = 0; i < s->options.map_count; i++)
        plr_send_known(s, &s->options.map[i]);
    if (s->options.observer.started != NULL)
        s->options.observer.started(s->options.observer.context);
    warn_about(s, plr_filter_config(&s->filter));
}

/* Of the data that just came in. */
static plr_time_ns time_of(const plr_message *in) {
    if (in->kind == PLR_KIND_TWIST)
        return in->as.twist.t_ns;
    return in->kind == PLR_KIND_STEREO ? in->as.stereo.t_ns : in->as.truth.t_ns;
}

bool plr_begin_running(plr_session *s) {
    if (s->phase == PLR_PHASE_RUNNING) {
        s->restored = false; /* data has come: a START sets the pose anew */
        return true;
    }
    if (!plr_begin_filter(s))
        return false;
    plr_begin_announce(s);
    apply_bias_prior(s);
    if (s->options.start == PLR_START_SAVED)
        plr_saving_load(s, time_of(&s->in));
    if (plr_filter_config(&s->filter)->mode == PLR_MODE_MAPPING) {
        s->start_known = false; /* every pose is given there */
        s->started = true;
    }
    return true;
}

void plr_begin_set_pose(plr_session *s, plr_kind subject, plr_time_ns t_ns, const plr_pose *T_WB,
                        const double *P_xi) {
    plr_status status = PLR_E_RANGE;
    if (plr_plausible_pose(T_WB))
        status = plr_filter_set_pose(&s->filter, t_ns, T_WB, P_xi);
    if (status != PLR_OK) {
        plr_send_refusal(s, subject, t_ns, status, NULL);
        return;
    }
    plr_clock_watch_init(&s->watch);
    plr_totals totals;
    if (!s->started && plr_filter_totals(&s->filter, &totals) == PLR_OK)
        s->start_resets = plr_send_resets(&totals);
    s->started = true;
}

void plr_begin_apply_start(plr_session *s) {
    double P[36];
    for (unsigned i = 0, k = 0; i < 6; i++)
        for (unsigned j = 0; j <= i; j++, k++)
            P[6 * i + j] = P[6 * j + i] = s->start.P_xi[k];
    s->start_known = false;
    plr_begin_set_pose(s, PLR_KIND_START, s->start.t_ns, &s->start.T_WB,
                       s->start.has_covariance ? P : NULL);
}

void plr_begin_at(plr_session *s, plr_time_ns t_ns) {
    if (s->start_known && t_ns >= s->start.t_ns)
        plr_begin_apply_start(s);
}

bool plr_begin_frame(plr_session *s, plr_time_ns t_ns) {
    if (s->started)
        return true;
    plr_begin_at(s, t_ns);
    if (s->start_known) { /* it lies behind the first frame */
        s->start_known = false;
        plr_send_refusal(s, PLR_KIND_START, s->start.t_ns, PLR_E_TIME, NULL);
    }
    if (s->options.start == PLR_START_AUTO || s->options.start == PLR_START_IDENTITY)
        s->started = true;
    return s->started;
}
