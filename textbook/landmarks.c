// SPDX-License-Identifier: MIT
/* The textbook's landmarks: new ones from pixels, known ones from a map. */
#include <math.h>
#include <string.h>

#include "textbook/observe.h"
#include "textbook/se3.h"
#include "textbook/textbook.h"

bool textbook_is_worth_a_landmark(const plr_config *config, const plr_calibration *camera,
                                  const plr_observation *seen) {
    const double disparity = (double)seen->uL_px - (double)seen->uR_px;
    const double depth = camera->fx_px * camera->baseline_m / disparity;
    const double row_gap = fabs((double)seen->vL_px - (double)seen->vR_px);
    return disparity > 0 && disparity >= config->min_disparity_px && depth >= config->min_depth_m &&
           depth < config->max_range_m &&
           (config->max_depth_m <= 0 || depth <= config->max_depth_m) &&
           (config->max_row_gap_px <= 0 || row_gap <= config->max_row_gap_px);
}

/* Puts a landmark in its place: error = J xi + N(0, P_m). J is 3x6, NULL: independent of the pose. */
static void enter(textbook *t, unsigned at, const double m[3], const double *J,
                  const double P_m[9]) {
    const unsigned row = textbook_row(t, at), n = textbook_dim(t);
    double own[9], blank[18] = {0};
    if (!J)
        J = blank;
    memcpy(t->landmarks[at].m, m, sizeof t->landmarks[at].m);
    memcpy(own, P_m, sizeof own);
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
}

bool textbook_create(textbook *t, unsigned at, plr_time_ns t_ns, const plr_observation *seen) {
    const double sigma = t->config.landmark_sigma_m;
    double q[3], S[9], RS[9], T_BC[16], s[3], m[3], J[18], R_WC[9], P_m[9] = {0};
    if (at >= t->most || !textbook_is_worth_a_landmark(&t->config, &t->camera, seen))
        return false;
    observe_back_project(t, seen, q, S);
    for (int i = 0; sigma > 0 && i < 9; i++)
        S[i] = i % 4 == 0 ? sigma : 0;
    se3_inverse(t->T_CB, T_BC);
    se3_apply(T_BC, q, s);
    se3_apply(t->T_WB, s, m);
    observe_camera_to_world(t, R_WC);
    for (int i = 0; i < 9; i++)
        RS[i] = R_WC[3 * (i / 3)] * S[i % 3] + R_WC[3 * (i / 3) + 1] * S[3 + i % 3] +
                R_WC[3 * (i / 3) + 2] * S[6 + i % 3];
    for (int i = 0; i < 9; i++)
        for (int k = 0; k < 3; k++)
            P_m[i] += RS[3 * (i / 3) + k] * RS[3 * (i % 3) + k];
    observe_world_by_pose(t, s, J);
    t->landmarks[at] = (textbook_landmark){.id = seen->id, .times_seen = 1, .last_seen_ns = t_ns};
    enter(t, at, m, t->config.landmark_prior == PLR_PRIOR_CORRELATED ? J : NULL, P_m);
    return true;
}

bool textbook_insert_known(textbook *t, const plr_landmark *known) {
    if (t->count >= t->most)
        return false;
    t->landmarks[t->count] =
        (textbook_landmark){.id = known->id, .last_seen_ns = known->last_seen_ns, .known = true};
    enter(t, t->count, known->p_W_m, NULL, known->P_W_m2);
    return true;
}
