// SPDX-License-Identifier: MIT
/* HEADER, CONFIG, START, LANDMARK (known), TEXT: what comes before the data, and what is done with
 * those that come among it. */
#include <string.h>

#include "session/begin.h"
#include "session/inputs.h"
#include "session/known_map.h"
#include "session/layers.h"
#include "session/line.h"
#include "session/plausible.h"
#include "session/send.h"

static bool same_axes(const double a[3], const double b[3]) {
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* Everything that an estimate depends on; the name and the image size are not that. */
static bool same_header(const plr_header *a, const plr_header *b) {
    return memcmp(&a->calibration, &b->calibration, sizeof a->calibration) == 0 &&
           a->body_axes == b->body_axes && a->twist_timing == b->twist_timing &&
           a->pixel_sigma_px == b->pixel_sigma_px &&
           a->velocity_sigma_mps == b->velocity_sigma_mps &&
           a->gyro_sigma_radps == b->gyro_sigma_radps &&
           same_axes(a->velocity_sigma_axes_mps, b->velocity_sigma_axes_mps) &&
           same_axes(a->gyro_sigma_axes_radps, b->gyro_sigma_axes_radps) &&
           a->bias_velocity_sigma_mps == b->bias_velocity_sigma_mps &&
           a->bias_gyro_sigma_radps == b->bias_gyro_sigma_radps &&
           a->bias_velocity_walk == b->bias_velocity_walk && a->bias_gyro_walk == b->bias_gyro_walk;
}

void plr_take_header(plr_session *s) {
    const plr_header *header = &s->in.as.header;
    plr_send_echo(s);
    if (s->phase != PLR_PHASE_WAITING && same_header(header, &s->header))
        return; /* the same HEADER again changes nothing */
    if (s->phase == PLR_PHASE_RUNNING) {
        plr_send_refusal(s, PLR_KIND_HEADER, 0, PLR_E_MODE, NULL);
        return;
    }
    plr_begin_anew(s);
    s->header = *header;
    s->phase = PLR_PHASE_READY;
}

static void tell_setting(plr_session *s, plr_wire_setting given, const plr_setting *setting) {
    plr_text *line = &s->out.as.text;
    plr_line_begin(line, PLR_SEVERITY_WARNING);
    plr_line_words(line, "CONFIG: ");
    if (setting == NULL) {
        plr_line_words(line, "setting ");
        plr_line_count(line, given.id);
        plr_line_words(line, " is not known here, and left out");
    } else {
        plr_line_words(line, setting->name);
        plr_line_words(line, " = ");
        plr_line_number(line, given.value);
        plr_line_words(line, " is not within ");
        plr_line_number(line, setting->minimum);
        plr_line_words(line, " to ");
        plr_line_number(line, setting->maximum);
        plr_line_words(line, ", and left out");
    }
    plr_send_text(s);
}

static void tell_foreign_build(plr_session *s) {
    plr_line_begin(&s->out.as.text, PLR_SEVERITY_INFO);
    plr_line_words(&s->out.as.text, "this log comes from another build (precision, capacity or "
                                    "version): the settings are taken, the bits may differ");
    plr_send_text(s);
}

void plr_take_config(plr_session *s) {
    const plr_config_message *config = &s->in.as.config;
    const bool in_force = config->build_fingerprint != 0;
    if (in_force)
        s->is_log = true;
    else
        plr_send_echo(s);
    if (s->phase == PLR_PHASE_WAITING) {
        plr_send_refusal(s, PLR_KIND_CONFIG, 0, PLR_E_NOT_READY, NULL);
        return;
    }
    if (s->phase == PLR_PHASE_RUNNING) {
        if (!plr_layers_agree(config, plr_filter_config(&s->filter)))
            plr_send_refusal(s, PLR_KIND_CONFIG, 0, PLR_E_MODE, NULL);
        return;
    }
    s->init_failed = false;
    for (unsigned i = 0; i < config->count; i++) {
        const plr_setting *setting = plr_setting_by_id(config->settings[i].id);
        if (plr_layers_want(&s->wanted, config->settings[i]) == PLR_OK)
            continue;
        plr_send_refusal(s, PLR_KIND_CONFIG, 0, PLR_E_CONFIG, setting);
        tell_setting(s, config->settings[i], setting);
    }
    if (in_force && config->build_fingerprint != plr_build_fingerprint())
        tell_foreign_build(s);
}

void plr_take_start(plr_session *s) {
    const plr_start *start = &s->in.as.start;
    plr_send_echo(s);
    if (s->phase == PLR_PHASE_WAITING) {
        plr_send_refusal(s, PLR_KIND_START, start->t_ns, PLR_E_NOT_READY, NULL);
        return;
    }
    if (!plr_plausible_start(start)) {
        plr_send_refusal(s, PLR_KIND_START, start->t_ns, PLR_E_RANGE, NULL);
        return;
    }
    if (s->restored)
        return; /* the state that was brought back is the start */
    const bool wanted = s->started || s->options.start == PLR_START_SAVED ||
                        s->options.start == PLR_START_AUTO ||
                        s->options.start == PLR_START_RECORDED;
    s->start = *start;
    if (s->phase == PLR_PHASE_RUNNING && s->started) {
        plr_take_all_held(s);
        plr_begin_apply_start(s); /* set the pose anew */
    } else {
        s->start_known = wanted;
    }
}

void plr_take_landmark(plr_session *s) {
    const plr_landmark_message *message = &s->in.as.landmark;
    if (message->role != PLR_LANDMARK_KNOWN)
        return; /* what another filter computed */
    plr_send_echo(s);
    plr_status status = PLR_E_NOT_READY;
    if (!plr_plausible_landmark(&message->landmark))
        status = PLR_E_RANGE;
    else if (s->phase != PLR_PHASE_WAITING)
        status = plr_known_map_add(&s->known, &message->landmark);
    if (status != PLR_OK)
        plr_send_refusal(s, PLR_KIND_LANDMARK, message->landmark.last_seen_ns, status, NULL);
}

void plr_take_text(plr_session *s) {
    if (!s->is_log) /* in a log they are outputs of a filter, and this session makes its own */
        plr_send_echo(s);
}
