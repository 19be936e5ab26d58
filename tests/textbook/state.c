// SPDX-License-Identifier: MIT
/* The textbook's state: memory, start, what it holds. */
#include <stdlib.h>
#include <string.h>

#include "support/rigid.h"
#include "textbook/body.h"
#include "textbook/search.h"
#include "textbook/textbook.h"

enum { POSE_ROWS = 6 };

bool textbook_is_body(const textbook *t) {
    return t->config.model == PLR_MODEL_BODY;
}

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
    double trace = 0, P_xi[36];
    textbook_pose_covariance(t, P_xi);
    for (unsigned i = 0; i < textbook_dim(t); i++)
        trace += i < POSE_ROWS ? P_xi[7 * i] : t->P[i * t->ld + i];
    return trace;
}

void textbook_reference(const textbook *t, double T_WB[16]) {
    double back[16];
    rigid_inverse(back, t->D);
    square_multiply(4, t->T_WB, back, T_WB);
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

/* ---------------------------------------------------------------- memory */

static size_t dimension(const plr_config *config, unsigned most) {
    return (config->bias ? 12U : 6U) + 3 * (size_t)most;
}

/* Rows as long as the state besides P: H P, pose, own, correction; and in `body` C, noise, shared and
 * the blocks, which are as large as three rows. */
static size_t long_rows(const plr_config *config, size_t rows) {
    return rows + POSE_ROWS + 3 + 1 + (config->model == PLR_MODEL_BODY ? 3 * 6 + 3 : 0);
}

size_t textbook_bytes(const plr_config *config, unsigned most, unsigned most_seen) {
    const size_t n = dimension(config, most), rows = TEXTBOOK_ROWS * (size_t)most_seen;
    return (n * n + long_rows(config, rows) * n + rows * rows + rows) * sizeof(double) +
           most * sizeof(textbook_landmark) +
           most_seen * (sizeof(unsigned) + sizeof(textbook_sighting));
}

/* n numbers; one at least, so that NULL means that there is no memory. */
static double *numbers(size_t n) {
    return calloc(n + 1, sizeof(double));
}

static bool reserve(textbook *t, size_t n, size_t rows) {
    const bool body = textbook_is_body(t);
    t->landmarks = calloc(t->most + 1U, sizeof *t->landmarks);
    t->matched = calloc(t->most_seen + 1U, sizeof *t->matched);
    t->sightings = calloc(t->most_seen + 1U, sizeof *t->sightings);
    t->P = numbers(n * n);
    t->rows = numbers(rows * n);
    t->pose = numbers(POSE_ROWS * n);
    t->own = numbers(3 * n);
    t->S = numbers(rows * rows);
    t->innovation = numbers(rows);
    t->correction = numbers(n);
    t->C = numbers(body ? 6 * n : 0);
    t->noise = numbers(body ? 6 * n : 0);
    t->shared = numbers(body ? 6 * n : 0);
    t->blocks = numbers(body ? 3 * n : 0);
    return t->landmarks && t->matched && t->sightings && t->P && t->rows && t->pose && t->own &&
           t->S && t->innovation && t->correction && t->C && t->noise && t->shared && t->blocks;
}

bool textbook_init(textbook *t, const plr_calibration *calibration, const plr_config *config,
                   unsigned most, unsigned most_seen) {
    const size_t n = dimension(config, most), rows = TEXTBOOK_ROWS * (size_t)most_seen;
    textbook_stand(t, calibration, config);
    t->most = most;
    t->most_seen = most_seen;
    t->ld = n;
    if (!reserve(t, n, rows)) {
        textbook_free(t);
        return false;
    }
    textbook_reset(t);
    return true;
}

void textbook_free(textbook *t) {
    free(t->landmarks);
    free(t->matched);
    free(t->sightings);
    free(t->P);
    free(t->rows);
    free(t->pose);
    free(t->own);
    free(t->S);
    free(t->innovation);
    free(t->correction);
    free(t->C);
    free(t->noise);
    free(t->shared);
    free(t->blocks);
    memset(t, 0, sizeof *t);
}

/* ---------------------------------------------------------------- start */

static const plr_pose identity = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};

void textbook_stand(textbook *t, const plr_calibration *calibration, const plr_config *config) {
    memset(t, 0, sizeof *t);
    t->config = *config;
    t->camera = *calibration;
    rigid_from_pose(t->T_CB, &calibration->T_CB);
    rigid_adjoint(t->Ad_CB, t->T_CB);
    rigid_from_pose(t->T_WB, &identity);
    rigid_from_pose(t->D, &identity);
}

void textbook_reset(textbook *t) {
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
    t->walked_s = 0;
    textbook_set_pose(t, &identity, P_xi);
    textbook_set_bias(t, none, variance);
}

void textbook_set_pose(textbook *t, const plr_pose *T_WB, const double P_xi[36]) {
    t->count = 0;
    rigid_from_pose(t->T_WB, T_WB);
    body_forget_motion(t);
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
