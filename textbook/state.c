// SPDX-License-Identifier: MIT
/* The textbook's state: memory, start, what it holds. */
#include <stdlib.h>
#include <string.h>

#include "textbook/se3.h"
#include "textbook/textbook.h"

enum { POSE_ROWS = 6 };

unsigned textbook_row(const textbook *t, unsigned landmark) {
    return (t->config.bias ? 12U : 6U) + 3 * landmark;
}

unsigned textbook_dim(const textbook *t) {
    return textbook_row(t, t->count);
}

double textbook_covariance(const textbook *t, unsigned i, unsigned j) {
    return i >= j ? t->P[i * t->ld + j] : t->P[j * t->ld + i];
}

double textbook_trace(const textbook *t) {
    double trace = 0;
    for (unsigned i = 0; i < textbook_dim(t); i++)
        trace += t->P[i * t->ld + i];
    return trace;
}

unsigned textbook_place(const textbook *t, uint32_t id) {
    unsigned i = 0;
    while (i < t->count && t->landmarks[i].id != id)
        i++;
    return i;
}

unsigned textbook_find(const textbook *t, uint32_t id) {
    const unsigned i = textbook_place(t, id);
    return i < t->count && t->landmarks[i].dropped ? t->count : i;
}

void textbook_landmark_of(const textbook *t, unsigned landmark, plr_landmark *out) {
    const textbook_landmark *l = &t->landmarks[landmark];
    const unsigned row = textbook_row(t, landmark);
    *out = (plr_landmark){.id = l->id,
                          .times_seen = l->times_seen,
                          .times_gated = l->times_gated,
                          .last_seen_ns = l->last_seen_ns,
                          .known = l->known};
    memcpy(out->p_W_m, l->m, sizeof out->p_W_m);
    for (unsigned i = 0; i < 9; i++)
        out->P_W_m2[i] = textbook_covariance(t, row + i / 3, row + i % 3);
}

/* ---------------------------------------------------------------- memory */

static size_t dimension(const plr_config *config, unsigned most) {
    return (config->bias ? 12U : 6U) + 3 * (size_t)most;
}

/* Numbers besides P that depend on the sizes. */
static size_t work_numbers(size_t n, size_t rows) {
    return (rows + POSE_ROWS + 3 + 1) * n + rows * rows + rows;
}

size_t textbook_bytes(const plr_config *config, unsigned most, unsigned most_seen) {
    const size_t n = dimension(config, most), rows = TEXTBOOK_ROWS * (size_t)most_seen;
    return (n * n + work_numbers(n, rows)) * sizeof(double) + most * sizeof(textbook_landmark) +
           most_seen * sizeof(unsigned);
}

/* n numbers; one at least, so that NULL means that there is no memory. */
static double *numbers(size_t n) {
    return calloc(n + 1, sizeof(double));
}

bool textbook_init(textbook *t, const plr_calibration *calibration, const plr_config *config,
                   unsigned most, unsigned most_seen) {
    const size_t n = dimension(config, most), rows = TEXTBOOK_ROWS * (size_t)most_seen;
    memset(t, 0, sizeof *t);
    t->config = *config;
    t->camera = *calibration;
    t->most = most;
    t->most_seen = most_seen;
    t->ld = n;
    t->landmarks = calloc(most + 1U, sizeof *t->landmarks);
    t->matched = calloc(most_seen + 1U, sizeof *t->matched);
    t->P = numbers(n * n);
    t->rows = numbers(rows * n);
    t->pose = numbers(POSE_ROWS * n);
    t->own = numbers(3 * n);
    t->S = numbers(rows * rows);
    t->innovation = numbers(rows);
    t->correction = numbers(n);
    if (!t->landmarks || !t->matched || !t->P || !t->rows || !t->pose || !t->own || !t->S ||
        !t->innovation || !t->correction) {
        textbook_free(t);
        return false;
    }
    se3_from_pose(&calibration->T_CB, t->T_CB);
    textbook_reset(t);
    return true;
}

void textbook_free(textbook *t) {
    free(t->landmarks);
    free(t->matched);
    free(t->P);
    free(t->rows);
    free(t->pose);
    free(t->own);
    free(t->S);
    free(t->innovation);
    free(t->correction);
    memset(t, 0, sizeof *t);
}

/* ---------------------------------------------------------------- start */

void textbook_reset(textbook *t) {
    static const plr_pose identity = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    static const double none[6] = {0};
    const plr_config *c = &t->config;
    const bool given = c->mode == PLR_MODE_MAPPING; /* every pose is, and exactly */
    double P_xi[36] = {0}, variance[6];
    for (int i = 0; i < 6; i++) {
        const double sigma = i < 3 ? c->bias_velocity_sigma_mps : c->bias_gyro_sigma_radps;
        P_xi[7 * i] = given ? 0 : c->start_sigma * c->start_sigma;
        variance[i] = given ? 0 : sigma * sigma;
    }
    t->gate_open = t->diverged = false;
    textbook_set_pose(t, &identity, P_xi);
    textbook_set_bias(t, none, variance);
}

void textbook_set_pose(textbook *t, const plr_pose *T_WB, const double P_xi[36]) {
    t->count = 0;
    se3_from_pose(T_WB, t->T_WB);
    for (unsigned i = 0; i < textbook_dim(t); i++)
        for (unsigned j = 0; j <= i && j < POSE_ROWS; j++)
            t->P[i * t->ld + j] = i < POSE_ROWS ? P_xi[6 * i + j] : 0;
}

void textbook_set_bias(textbook *t, const double mean[6], const double variance[6]) {
    memcpy(t->bias, mean, sizeof t->bias);
    for (unsigned i = POSE_ROWS; i < textbook_row(t, 0); i++)
        for (unsigned j = 0; j <= i; j++)
            t->P[i * t->ld + j] = i == j ? variance[i - POSE_ROWS] : 0;
}
