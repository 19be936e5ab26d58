// SPDX-License-Identifier: MIT
/* What the filter believes, and what it cannot do. */
#include <string.h>

#include "support/rigid.h"
#include "textbook/the_filter.h"

/* The biases' covariance of now, 6x6: with the walk that waits for the next frame. */
static void bias_covariance(double P_b[36]) {
    const plr_config *c = &the.book.config;
    for (unsigned i = 0; i < 36; i++)
        P_b[i] = textbook_covariance(&the.book, 6 + i / 6, 6 + i % 6);
    for (unsigned i = 0; i < 6; i++)
        P_b[7 * i] += the.book.walked_s * (i < 3 ? c->bias_velocity_walk : c->bias_gyro_walk);
}

plr_time_ns plr_filter_time(const plr_filter *f) {
    (void)f;
    return the.t_ns;
}

plr_status plr_filter_pose(const plr_filter *f, plr_pose *T_WB) {
    (void)f;
    if (!the.ready)
        return PLR_E_NOT_READY;
    rigid_to_pose(T_WB, the.book.T_WB);
    return PLR_OK;
}

/* A covariance can be told: of a filter that runs and has not diverged. */
static plr_status is_sound(void) {
    if (!the.ready)
        return PLR_E_NOT_READY;
    return the.book.diverged ? PLR_E_DIVERGED : PLR_OK;
}

plr_status plr_filter_pose_covariance(const plr_filter *f, double *P_xi) {
    (void)f;
    const plr_status status = is_sound();
    if (status == PLR_OK)
        textbook_pose_covariance(&the.book, P_xi);
    return status;
}

plr_status plr_filter_velocity(const plr_filter *f, plr_twist *velocity) {
    (void)f;
    if (!the.ready)
        return PLR_E_NOT_READY;
    for (int i = 0; i < 3; i++) {
        velocity->v_B_mps[i] = the.reading.v_B_mps[i] - the.book.bias[i];
        velocity->w_B_radps[i] = the.reading.w_B_radps[i] - the.book.bias[3 + i];
    }
    return PLR_OK;
}

plr_status plr_filter_velocity_covariance(const plr_filter *f, double *P_u) {
    const plr_config *c = &the.book.config;
    /* with noise = step the sigmas are of a displacement: divide by the step */
    const double scale = c->noise == PLR_NOISE_STEP && the.interval_s > 0
                             ? 1 / (the.interval_s * the.interval_s)
                             : 1;
    double b[6];
    const plr_status status = plr_filter_bias(f, b, P_u);
    if (status == PLR_OK)
        for (int i = 0; i < 3; i++) {
            P_u[7 * i] += scale * c->velocity_sigma[i] * c->velocity_sigma[i];
            P_u[7 * (3 + i)] += scale * c->gyro_sigma[i] * c->gyro_sigma[i];
        }
    return status;
}

plr_status plr_filter_bias(const plr_filter *f, double *b, double *P_b) {
    (void)f;
    const plr_status status = is_sound();
    if (status == PLR_E_NOT_READY || (status != PLR_OK && P_b))
        return status;
    memcpy(b, the.book.bias, sizeof the.book.bias);
    if (!P_b)
        return PLR_OK;
    memset(P_b, 0, 36 * sizeof *P_b);
    if (the.book.config.bias)
        bias_covariance(P_b);
    return PLR_OK;
}

double plr_filter_trace(const plr_filter *f) {
    (void)f;
    return is_sound() == PLR_OK ? textbook_trace(&the.book) : 0;
}

unsigned plr_filter_landmark_count(const plr_filter *f) {
    (void)f;
    return the.ready ? the.book.count : 0;
}

plr_status plr_filter_landmark(plr_filter *f, unsigned slot, plr_landmark *landmark) {
    (void)f;
    const plr_status status = is_sound();
    if (status == PLR_OK && (slot >= the.book.count || the.book.landmarks[slot].dropped))
        return PLR_E_ARGUMENT;
    if (status == PLR_OK)
        textbook_landmark_of(&the.book, slot, landmark);
    return status;
}

plr_status plr_filter_totals(const plr_filter *f, plr_totals *totals) {
    (void)f;
    if (!the.ready)
        return PLR_E_NOT_READY;
    *totals = the.totals;
    return PLR_OK;
}

/* It judges frames alone. */
plr_status plr_filter_health(const plr_filter *f, plr_time_ns t_ns, plr_health_state *health) {
    (void)f;
    (void)t_ns;
    (void)health;
    return PLR_E_MODE;
}

const plr_config *plr_filter_config(const plr_filter *f) {
    (void)f;
    return the.ready ? &the.book.config : NULL;
}

/* Hands every landmark to the map sink: the session begins a new map after a jump of the clock. */
plr_status plr_filter_flush_map(plr_filter *f) {
    (void)f;
    if (is_sound() != PLR_OK)
        return is_sound();
    if (!the.map.sink)
        return PLR_E_MODE;
    for (unsigned i = 0; i < the.book.count; i++) {
        plr_landmark landmark;
        textbook_landmark_of(&the.book, i, &landmark);
        (void)the.map.sink(the.map.context, &landmark);
    }
    the.book.count = 0;
    return PLR_OK;
}

/* ---------------------------------------------------------------- no saved states */

plr_status plr_filter_save(const plr_filter *f, plr_state_sink sink, void *context) {
    (void)f;
    (void)sink;
    (void)context;
    return PLR_E_MODE;
}

uint32_t plr_filter_saved_size(const plr_filter *f, unsigned landmarks) {
    (void)f;
    (void)landmarks;
    return 0;
}

plr_status plr_filter_restore(plr_filter *f, uint32_t length, plr_state_source source,
                              void *context) {
    (void)f;
    (void)length;
    (void)source;
    (void)context;
    return PLR_E_MODE;
}

plr_status plr_filter_resume(plr_filter *f, plr_time_ns t_ns, const double *P_moved) {
    (void)f;
    (void)t_ns;
    (void)P_moved;
    return PLR_E_MODE;
}
