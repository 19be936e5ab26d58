// SPDX-License-Identifier: MIT
#include "support/specimens.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sensor/stereo.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/polar.h"
#include "supervise/supervise.h"
#include "support/matrices.h"
#include "support/reseal.h"
#include "support/rigid.h"
#include "support/scene.h"

/* Settings of a specimen: default, with that model and bias, and no gate. */
static void default_config(plr_config *config, plr_model_kind model, bool bias) {
    plr_config_default(config);
    config->model = (uint8_t)model;
    config->bias = bias;
    config->slots = PLR_MAX_LANDMARKS;
    config->gate_d2 = 0;
}

double *specimen_zeros(unsigned n, unsigned m) {
    double *A = calloc((size_t)n * m + 1, sizeof *A);
    if (!A)
        abort();
    return A;
}

void specimen_put(double *A, unsigned ld, unsigned row, unsigned column, unsigned rows,
                  unsigned columns, const double *B) {
    for (unsigned i = 0; i < rows; i++)
        for (unsigned j = 0; j < columns; j++)
            A[(row + i) * ld + column + j] = B[i * columns + j];
}

/* A point 2 to 30 m in front of the camera. */
static void random_point(rng *r, double q[3]) {
    q[2] = exp(rng_uniform(r, log(2), log(30)));
    q[0] = q[2] * rng_uniform(r, -0.6, 0.6);
    q[1] = q[2] * rng_uniform(r, -0.4, 0.4);
}

/* A landmark of that camera point: itself, or its place in the world. */
static void put_point(const plr_filter *f, const double q[3], plr_slot *slot) {
    const plr_camera *c = &f->camera.given;
    double s[3] = {0}, m[3];
    memcpy(m, q, sizeof m);
    if (f->config.model == PLR_MODEL_WORLD) {
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                s[i] += (double)c->R_CB[3 * j + i] * (q[j] - (double)c->t_CB[j]);
        for (int i = 0; i < 3; i++) {
            m[i] = f->belief.p_WB[i];
            for (int j = 0; j < 3; j++)
                m[i] += (double)f->belief.R_WB[3 * i + j] * s[j];
        }
    }
    to_reals(slot->x, m, 3);
}

/* Standard deviation of a row of the state: of a filter that knows itself fairly well. */
static double sigma_of(const plr_filter *f, unsigned row) {
    static const double bearing_rad = 2e-3, inverse_range = 2e-3, place_m = 0.1;
    const unsigned first = plr_covariance_row(&f->belief, 0);
    if (row < 6)
        return row < 3 ? 0.05 : 0.005;
    if (row < first)
        return row < 9 ? 0.03 : 0.003;
    if (f->config.model == PLR_MODEL_WORLD)
        return place_m;
    return (row - first) % 3 < 2 ? bearing_rad : inverse_range;
}

static void random_covariance(plr_filter *f, rng *r) {
    const unsigned n = plr_covariance_dim(&f->belief);
    double *A = specimen_zeros(n, n);
    random_spd(r, n, 0.1, A);
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < n; j++)
            A[i * n + j] *= sigma_of(f, i) * sigma_of(f, j);
    pack_lower(f->belief.P, A, n);
    free(A);
}

/* Landmarks and a covariance for a filter that was initialised. */
static void fill(plr_filter *f, rng *r, unsigned landmarks) {
    f->belief.frame_number = 1;
    for (f->belief.count = 0; f->belief.count < landmarks; f->belief.count++) {
        plr_slot *slot = &f->belief.slots[f->belief.count];
        double q[3];
        random_point(r, q);
        memset(slot, 0, sizeof *slot);
        put_point(f, q, slot);
        slot->id = f->belief.count + 1;
        slot->times_seen = 1;
        slot->last_frame = f->belief.frame_number;
        slot->last_seen_ns = f->belief.t_ns;
    }
    random_covariance(f, r);
    reseal(f);
}

/* Initialised, at a random pose. */
static void place(plr_filter *f, rng *r, const plr_config *config) {
    plr_calibration calibration;
    plr_pose T_WB;
    scene_calibration(&calibration);
    random_rotation(r, T_WB.R);
    rng_normals(r, 5, T_WB.p, 3);
    if (plr_filter_init(f, &calibration, config, NULL) != PLR_OK ||
        plr_filter_set_pose(f, UINT64_C(1000000000), &T_WB, NULL) != PLR_OK)
        abort();
    f->totals.resets = 0;
}

void specimen_filter(plr_filter *f, rng *r, plr_model_kind model, bool bias, unsigned landmarks) {
    plr_config config;
    default_config(&config, model, bias);
    place(f, r, &config);
    for (int i = 0; bias && i < 6; i++)
        f->belief.bias[i] = (plr_real)(0.01 * rng_normal(r));
    fill(f, r, landmarks);
}

void specimen_imu(plr_filter *f, rng *r, unsigned landmarks) {
    static const double variance[3] = {1, 1, 1};
    double v[3];
    plr_config config;
    default_config(&config, PLR_MODEL_BODY, true);
    config.process = PLR_PROCESS_IMU;
    place(f, r, &config);
    rng_normals(r, 2, v, 3);
    if (plr_filter_set_velocity(f, v, variance) != PLR_OK)
        abort();
    for (int i = 0; i < 6; i++)
        f->belief.bias[i] = (plr_real)((i < 3 ? 0.1 : 0.01) * rng_normal(r));
    fill(f, r, landmarks);
}

double *specimen_covariance(const plr_filter *f) {
    const unsigned n = plr_covariance_dim(&f->belief);
    double *P = specimen_zeros(n, n);
    unpack_symmetric(P, f->belief.P, n);
    return P;
}

void specimen_motion(const plr_filter *f, rng *r, plr_motion *motion) {
    double xi[6], D[16], Q[36];
    memset(motion, 0, sizeof *motion);
    rng_normals(r, 0.2, xi, 3);
    rng_normals(r, 0.05, xi + 3, 3);
    rigid_exp(D, xi);
    for (int i = 0; i < 3; i++) {
        motion->p[i] = (plr_real)D[4 * i + 3];
        for (int j = 0; j < 3; j++)
            motion->E[3 * i + j] = (plr_real)(D[4 * i + j] - (i == j));
    }
    random_spd(r, 6, 0.1, Q);
    for (int i = 0; i < 36; i++)
        motion->Q[i] = (plr_real)(Q[i] * 1e-4);
    for (int i = 0; f->config.bias && i < 36; i++)
        motion->B[PLR_DRIVERS * (i / 6) + i % 6] = (plr_real)(0.05 * rng_normal(r));
    motion->seconds = PLR_R(0.1);
    motion->pending = motion->noisy = 1;
}

void specimen_bias_derivative(const plr_motion *motion, double B[36]) {
    for (int i = 0; i < 6; i++)
        to_doubles(B + 6 * i, motion->B + PLR_DRIVERS * i, 6);
}

plr_measurement specimen_measurement(const plr_filter *f, unsigned slot,
                                     const plr_observation *seen) {
    plr_measurement m;
    if (!plr_stereo_measure(&f->belief, &f->camera, slot, seen, &m))
        abort();
    return m;
}

void specimen_prediction(const plr_filter *f, unsigned slot, plr_real z[3]) {
    const plr_observation corner = {0}; /* r = 0 - z */
    const plr_measurement m = specimen_measurement(f, slot, &corner);
    for (int i = 0; i < 3; i++)
        z[i] = -m.r[i];
}

void specimen_put_rows(double *H, unsigned n, const plr_rows *rows) {
    for (unsigned t = 0; t < rows->terms; t++) {
        const plr_term *term = &rows->term[t];
        double block[PLR_ROWS * PLR_WIDEST_BLOCK];
        to_doubles(block, term->H, PLR_ROWS * term->columns);
        specimen_put(H, n, 0, term->row, PLR_ROWS, term->columns, block);
    }
}

plr_verdict specimen_judge(const plr_filter *f, unsigned slot, const plr_observation *seen) {
    plr_supervisor asked = f->supervisor;
    const plr_picture_evidence nothing = {0};
    const bool opens = plr_supervise_picture(&asked, &nothing).opens_fixed_gate;
    plr_measurement m;
    plr_verdict none = {.accepted = false};
    return plr_stereo_measure(&f->belief, &f->camera, slot, seen, &m) ? plr_gate_judge(f, opens, &m)
                                                                      : none;
}

plr_observation specimen_observation(const plr_filter *f, unsigned slot, const float shift_px[4]) {
    plr_real z[3];
    specimen_prediction(f, slot, z);
    return (plr_observation){f->belief.slots[slot].id,  (float)z[0] + shift_px[0],
                             (float)z[2] + shift_px[1], (float)z[1] + shift_px[2],
                             (float)z[2] + shift_px[3], 0};
}

void specimen_chart(const plr_real x[3], double Jw[9], double Ji[9]) {
    plr_polar chart;
    plr_real J[9];
    plr_polar_at(&chart, x);
    plr_polar_from_point(J, &chart);
    to_doubles(Jw, J, 9);
    plr_polar_to_point(J, &chart);
    to_doubles(Ji, J, 9);
}

bool specimen_same_state(const plr_filter *a, const plr_filter *b) {
    static plr_filter copy;
    memcpy(&copy, a, sizeof copy);
    memcpy(&copy.work, &b->work, sizeof copy.work);
    memcpy(&copy.totals, &b->totals, sizeof copy.totals);
    memcpy(&copy.evidence, &b->evidence, sizeof copy.evidence); /* of one frame */
    memcpy(&copy.guard, &b->guard, sizeof copy.guard);
    copy.source.unused = b->source.unused; /* a count, as those of the totals */
    return memcmp(&copy, b, sizeof copy) == 0 && a->totals.diverged_ns == b->totals.diverged_ns;
}

/* A result that was given is finite; one that was not says why. */
static bool given(plr_status status, const double *x, unsigned n) {
    return status == PLR_OK && all_finite(x, n);
}

bool specimen_gives_finite_numbers(plr_filter *f) {
    plr_pose pose;
    plr_twist velocity;
    plr_landmark landmark;
    double P[36], b[6];
    bool good =
        plr_filter_pose(f, &pose) == PLR_OK && all_finite(pose.R, 9) && all_finite(pose.p, 3);
    good &= given(plr_filter_pose_covariance(f, P), P, 36);
    good &= plr_filter_velocity(f, &velocity) == PLR_OK && all_finite(velocity.v_B_mps, 3) &&
            all_finite(velocity.w_B_radps, 3);
    good &= given(plr_filter_velocity_covariance(f, P), P, 36);
    good &= plr_filter_bias(f, b, NULL) == PLR_OK && all_finite(b, 6);
    good &= given(plr_filter_bias(f, b, P), P, 36);
    const double trace = plr_filter_trace(f);
    good &= isfinite(trace);
    for (unsigned slot = 0; slot < plr_filter_landmark_count(f); slot++) {
        const plr_status status = plr_filter_landmark(f, slot, &landmark);
        good &= given(status, landmark.p_W_m, 3) && given(status, landmark.P_W_m2, 9);
    }
    return good;
}

double specimen_gap(unsigned n, const double *A, const double *B) {
    double most = 0;
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < n; j++) {
            const double gap = fabs(A[i * n + j] - B[i * n + j]) /
                               sqrt(fabs(A[i * n + i] * A[j * n + j]) + 1e-300);
            if (!(gap <= most))
                most = gap;
            if (isnan(most))
                return most;
        }
    return most;
}
