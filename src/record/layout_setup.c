// SPDX-License-Identifier: MIT
/* HEADER, CONFIG, START, STATE: what a drive begins with, or goes on with. */
#include "record/layout.h"

enum { UNITS_SI = 0, LAST_TWIST_TIMING = 2 };

/* The first two bytes of a HEADER mean the same in every version. */
static void pass_version(plr_pass *p, plr_header *m) {
    if (!plr_pass_reads(p)) {
        uint8_t major = PLR_WIRE_VERSION_MAJOR, minor = PLR_WIRE_VERSION_MINOR;
        plr_pass_u8(p, &major);
        plr_pass_u8(p, &minor);
        return;
    }
    plr_pass_u8(p, &m->version_major);
    plr_pass_u8(p, &m->version_minor);
    if (m->version_major > PLR_WIRE_VERSION_MAJOR)
        plr_pass_fail(p, PLR_FAULT_FUTURE);
    plr_pass_require(p, m->version_major == PLR_WIRE_VERSION_MAJOR);
}

static void pass_calibration(plr_pass *p, plr_calibration *c) {
    plr_pass_f64s(p, &c->fx_px, 1);
    plr_pass_f64s(p, &c->fy_px, 1);
    plr_pass_f64s(p, &c->cx_px, 1);
    plr_pass_f64s(p, &c->cy_px, 1);
    plr_pass_f64s(p, &c->baseline_m, 1);
    plr_pass_f64s(p, c->T_CB.R, 9);
    plr_pass_f64s(p, c->T_CB.p, 3);
}

/* Behind the name, since version 1.2; a payload of 1.1 ends before. */
static void pass_axes(plr_pass *p, plr_header *m) {
    if (plr_pass_reads(p) && p->left == 0) {
        for (unsigned i = 0; i < 3; i++)
            m->velocity_sigma_axes_mps[i] = m->gyro_sigma_axes_radps[i] = -1;
        return;
    }
    plr_pass_f64s(p, m->velocity_sigma_axes_mps, 3);
    plr_pass_f64s(p, m->gyro_sigma_axes_radps, 3);
}

void plr_layout_header(plr_pass *p, plr_header *m) {
    uint8_t units = UNITS_SI;
    uint8_t name_bytes = 0;
    if (!plr_pass_reads(p))
        name_bytes = (uint8_t)plr_pass_text_length(m->name, sizeof m->name);
    pass_version(p, m);
    plr_pass_choice(p, &m->body_axes, PLR_AXES_OTHER);
    plr_pass_choice(p, &m->twist_timing, LAST_TWIST_TIMING);
    plr_pass_choice(p, &units, UNITS_SI);
    plr_pass_choice(p, &name_bytes, PLR_WIRE_NAME_SIZE - 1);
    plr_pass_u16(p, &m->image_width_px);
    plr_pass_u16(p, &m->image_height_px);
    pass_calibration(p, &m->calibration);
    plr_pass_f64s(p, &m->pixel_sigma_px, 1);
    plr_pass_f64s(p, &m->velocity_sigma_mps, 1);
    plr_pass_f64s(p, &m->gyro_sigma_radps, 1);
    plr_pass_f64s(p, &m->bias_velocity_sigma_mps, 1);
    plr_pass_f64s(p, &m->bias_gyro_sigma_radps, 1);
    plr_pass_f64s(p, &m->bias_velocity_walk, 1);
    plr_pass_f64s(p, &m->bias_gyro_walk, 1);
    if (p->fault == PLR_FAULT_NONE)
        plr_pass_text(p, m->name, name_bytes);
    pass_axes(p, m);
}

void plr_layout_config(plr_pass *p, plr_config_message *m) {
    plr_pass_u32(p, &m->build_fingerprint);
    plr_pass_u16(p, &m->max_landmarks);
    plr_pass_u16(p, &m->max_observations);
    plr_pass_u8(p, &m->block_observations);
    plr_pass_u8(p, &m->real_bytes);
    plr_pass_choice(p, &m->count, PLR_WIRE_MAX_SETTINGS);
    for (unsigned i = 0; i < m->count && p->fault == PLR_FAULT_NONE; i++) {
        plr_pass_u8(p, &m->settings[i].id);
        plr_pass_f64s(p, &m->settings[i].value, 1);
    }
}

void plr_layout_start(plr_pass *p, plr_start *m) {
    plr_pass_u64(p, &m->t_ns);
    plr_pass_f64s(p, m->T_WB.R, 9);
    plr_pass_f64s(p, m->T_WB.p, 3);
    plr_pass_flags(p, &m->has_covariance, &m->has_bias);
    plr_pass_f64s(p, m->P_xi, 21);
    plr_pass_f64s(p, m->bias, 6);
    plr_pass_f64s(p, m->bias_variance, 6);
}

void plr_layout_state(plr_pass *p, plr_state_message *m) {
    plr_pass_u64(p, &m->t_ns);
    plr_pass_choice(p, &m->action, PLR_STATE_RESTORE);
    plr_pass_require(p, m->action >= PLR_STATE_SAVE);
    plr_pass_f64s(p, m->moved_variance, 6);
}
