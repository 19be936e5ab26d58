// SPDX-License-Identifier: MIT
/* The textbook's landmarks: new ones from pixels, known ones from a map, and out again. */
#include <math.h>
#include <string.h>

#include "support/oracle.h"
#include "support/rigid.h"
#include "textbook/body.h"
#include "textbook/observe.h"
#include "textbook/textbook.h"

/* In `body` a landmark may stand at any distance; its noise may leave it a disparity below zero: one
 * point at infinity in 700 lies below this many sigmas. From this disparity on it is put where it is,
 * below it there, and what is missing is kept beside it (docs/MATH.md 9). */
static const double least_sigmas = -4.25, least_disparity = 0.05, least_share = 1.5;

static double farthest_disparity(const plr_config *config, const plr_calibration *camera) {
    const double by_range = least_share * camera->fx_px * camera->baseline_m / config->max_range_m;
    return fmax(by_range, least_disparity);
}

bool textbook_is_worth_a_landmark(const plr_config *config, const plr_calibration *camera,
                                  const plr_observation *seen) {
    const bool body = config->model == PLR_MODEL_BODY;
    const double disparity = (double)seen->uL_px - (double)seen->uR_px;
    const double row_gap = fabs((double)seen->vL_px - (double)seen->vR_px);
    double least = config->min_disparity_px;
    if (body && !(least > 0))
        least = least_sigmas * config->pixel_sigma_px;
    if (!(disparity >= least) || (config->max_row_gap_px > 0 && row_gap > config->max_row_gap_px))
        return false;
    if (body && config->max_depth_m <= 0 && disparity < farthest_disparity(config, camera))
        return true;
    const double depth = camera->fx_px * camera->baseline_m / disparity;
    return disparity > 0 && depth >= config->min_depth_m && depth < config->max_range_m &&
           (config->max_depth_m <= 0 || depth <= config->max_depth_m);
}

/* Puts a landmark in its place: error = J xi + N(0, P_x). J is 3x6, NULL: independent of the pose. */
static void enter(textbook *t, unsigned at, const double x[3], const double *J,
                  const double P_x[9]) {
    const unsigned row = textbook_row(t, at), n = textbook_dim(t);
    double own[9], blank[18] = {0};
    if (!J)
        J = blank;
    memcpy(t->landmarks[at].x, x, sizeof t->landmarks[at].x);
    memcpy(own, P_x, sizeof own);
    if (at == t->count)
        t->count++;
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++)
            for (unsigned a = 0; a < 6; a++)
                for (unsigned b = 0; b < 6; b++)
                    own[3 * i + j] += J[6 * i + a] * textbook_covariance(t, a, b) * J[6 * j + b];
    const unsigned grown = textbook_dim(t) > n ? textbook_dim(t) : n;
    for (unsigned j = 0; j < grown; j++) {
        if (j >= row && j < row + 3)
            continue;
        for (unsigned i = 0; i < 3; i++) {
            double sum = 0;
            for (unsigned a = 0; a < 6; a++)
                sum += J[6 * i + a] * textbook_covariance(t, a, j);
            t->P[j < row ? (row + i) * t->ld + j : j * t->ld + row + i] = sum;
        }
    }
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j <= i; j++)
            t->P[(row + i) * t->ld + row + j] = own[3 * i + j];
    if (textbook_is_body(t))
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 6, 1, J, t->C, 0, t->C + 6 * (size_t)row);
}

/* In `body`: pixels whose disparity is too small to stand at. Returns what is missing of it, px. */
static double limit_disparity(const textbook *t, plr_observation *seen) {
    const double disparity = (double)seen->uL_px - (double)seen->uR_px;
    const double farthest = farthest_disparity(&t->config, &t->camera);
    if (!textbook_is_body(t) || disparity >= farthest)
        return 0;
    seen->uR_px = (float)((double)seen->uL_px - farthest);
    return disparity - farthest;
}

/* A factor S of a new landmark's covariance in the camera, and its place q. */
static void back_project(const textbook *t, const plr_observation *seen, double q[3], double S[9]) {
    const double sigma = t->config.landmark_sigma_m;
    observe_back_project(t, seen, q, S);
    for (int i = 0; sigma > 0 && i < 9; i++)
        S[i] = i % 4 == 0 ? sigma : 0;
}

static void create_in_camera(textbook *t, unsigned at, const plr_observation *seen) {
    plr_observation stands = *seen;
    double q[3], S[9], P_q[9];
    if (t->pending)
        body_settle(t);
    const double missing = limit_disparity(t, &stands);
    back_project(t, &stands, q, S);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, 3, 3, 3, 1, S, S, 0, P_q);
    enter(t, at, q, NULL, P_q);
    /* inverse range is disparity over focal length and baseline, along the ray */
    t->landmarks[at].beyond = missing * q[2] / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]) /
                              (t->camera.fx_px * t->camera.baseline_m);
}

static void create_in_world(textbook *t, unsigned at, const plr_observation *seen) {
    double q[3], S[9], RS[9], T_BC[16], s[3], m[3], J[18], R_WC[9], P_m[9];
    back_project(t, seen, q, S);
    rigid_inverse(T_BC, t->T_CB);
    rigid_apply(s, T_BC, q);
    rigid_apply(m, t->T_WB, s);
    observe_camera_to_world(t, R_WC);
    square_multiply(3, R_WC, S, RS);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, 3, 3, 3, 1, RS, RS, 0, P_m);
    observe_world_by_pose(t, s, J);
    enter(t, at, m, t->config.landmark_prior == PLR_PRIOR_CORRELATED ? J : NULL, P_m);
}

bool textbook_create(textbook *t, unsigned at, plr_time_ns t_ns, const plr_observation *seen) {
    if (at >= t->most || !textbook_is_worth_a_landmark(&t->config, &t->camera, seen))
        return false;
    t->landmarks[at] = (textbook_landmark){.id = seen->id, .times_seen = 1, .last_seen_ns = t_ns};
    if (textbook_is_body(t))
        create_in_camera(t, at, seen);
    else
        create_in_world(t, at, seen);
    return true;
}

bool textbook_insert_known(textbook *t, const plr_landmark *known) {
    double T_WB[16], T_BW[16], q[3], K[18], R_WC[9], R_CW[9], P_q[9];
    if (t->count >= t->most)
        return false;
    t->landmarks[t->count] =
        (textbook_landmark){.id = known->id, .last_seen_ns = known->last_seen_ns, .known = true};
    if (!textbook_is_body(t)) {
        enter(t, t->count, known->p_W_m, NULL, known->P_W_m2);
        return true;
    }
    textbook_reference(t, T_WB);
    rigid_inverse(T_BW, T_WB);
    rigid_apply(q, T_BW, known->p_W_m);
    rigid_apply(q, t->T_CB, q);
    observe_camera_by_pose(t, q, K);
    observe_camera_to_world(t, R_WC);
    for (int i = 0; i < 9; i++)
        R_CW[i] = R_WC[3 * (i % 3) + i / 3];
    oracle_sandwich(3, 3, R_CW, known->P_W_m2, P_q);
    enter(t, t->count, q, K, P_q);
    return true;
}

void textbook_remove(textbook *t, unsigned landmark) {
    const unsigned n = textbook_dim(t), row = textbook_row(t, landmark);
    for (unsigned i = row + 3; i < n; i++) { /* up by three, and their columns to the left */
        double *to = t->P + (i - 3) * t->ld;
        const double *from = t->P + i * t->ld;
        memcpy(to, from, row * sizeof *to);
        memcpy(to + row, from + row + 3, (i - row - 2) * sizeof *to);
    }
    if (textbook_is_body(t))
        memmove(t->C + 6 * (size_t)row, t->C + 6 * (size_t)(row + 3),
                6 * (size_t)(n - row - 3) * sizeof *t->C);
    t->count--;
    memmove(t->landmarks + landmark, t->landmarks + landmark + 1,
            (t->count - landmark) * sizeof *t->landmarks);
}

/* The point in the world and its covariance, J P J^T over the pose and the landmark of `body`. */
static void in_world(const textbook *t, unsigned landmark, double p_W[3], double P_W[9]) {
    const unsigned row = textbook_row(t, landmark);
    double T_WB[16], T_BC[16], s[3], J_pose[18], R_WC[9], J[27], P[81];
    textbook_reference(t, T_WB);
    rigid_inverse(T_BC, t->T_CB);
    rigid_apply(s, T_BC, t->landmarks[landmark].x);
    rigid_apply(p_W, T_WB, s);
    observe_world_by_pose(t, s, J_pose);
    observe_camera_to_world(t, R_WC);
    for (unsigned i = 0; i < 3; i++) {
        memcpy(J + 9 * i, J_pose + 6 * i, 6 * sizeof *J);
        memcpy(J + 9 * i + 6, R_WC + 3 * i, 3 * sizeof *J);
    }
    for (unsigned i = 0; i < 9; i++)
        for (unsigned j = 0; j < 9; j++)
            P[9 * i + j] = textbook_covariance(t, i < 6 ? i : row + i - 6, j < 6 ? j : row + j - 6);
    oracle_sandwich(3, 9, J, P, P_W);
}

void textbook_landmark_of(const textbook *t, unsigned landmark, plr_landmark *out) {
    const textbook_landmark *l = &t->landmarks[landmark];
    const unsigned row = textbook_row(t, landmark);
    *out = (plr_landmark){.id = l->id,
                          .times_seen = l->times_seen,
                          .times_gated = l->times_gated,
                          .last_seen_ns = l->last_seen_ns,
                          .known = l->known};
    memcpy(out->p_W_m, l->x, sizeof out->p_W_m);
    for (unsigned i = 0; i < 9; i++)
        out->P_W_m2[i] = textbook_covariance(t, row + i / 3, row + i % 3);
    if (textbook_is_body(t))
        in_world(t, landmark, out->p_W_m, out->P_W_m2);
}
