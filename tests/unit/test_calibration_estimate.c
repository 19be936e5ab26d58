// SPDX-License-Identifier: MIT
/* The calibration beside P against one filter of both together: a correction's gain over the augmented
 * state, dense and in double (MATH 20). */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "filter/correction.h"
#include "filter/gate.h"
#include "sensor/kept.h"
#include "sensor/stereo.h"
#include "state/calibration.h"
#include "state/covariance.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/specimens.h"
#include "support/wrong_camera.h"

enum { SEEN = PLR_BLOCK_OBSERVATIONS + 3, ROWS = 3 * SEEN, EVERYTHING = 63 };

static const double eps = REAL_EPSILON;
static plr_filter filter;
static rng chance;
static plr_observation seen[SEEN];

void setUp(void) {
    chance = rng_seeded(91);
}

static void take_specimen(plr_model_kind model, unsigned calibrate) {
    specimen_filter(&filter, &chance, model, true, SEEN);
    plr_config config = filter.config;
    config.calibrate = (uint8_t)calibrate;
    config.focal_sigma = 0.004;
    config.baseline_sigma = 0.006;
    config.camera_turn_sigma_rad = 0.005;
    config.centre_sigma_px = 1.5;
    config.camera_place_sigma_m = 0.01;
    config.camera_clock_sigma_s = 0.004;
    plr_calibration_lay_out(&filter.camera.errors, &config);
    filter.belief.layout.errors = filter.camera.errors.count;
    plr_calibration_reset(&filter.camera);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        filter.camera.estimate.twist[i] = (plr_real)(0.3 * rng_normal(&chance));
    filter.camera.estimate.moves = 1;
    for (unsigned k = 0; k < filter.camera.errors.count; k++)
        for (unsigned i = 0; i < plr_covariance_dim(&filter.belief); i++)
            filter.belief.S[k][i] = (plr_real)(0.3 * rng_normal(&chance));
    for (unsigned i = 0; i < SEEN; i++) {
        const float u = (float)rng_normal(&chance), v = (float)rng_normal(&chance);
        const float shift[4] = {u, v, (float)(0.9 * (double)u), v};
        plr_measurement m;
        seen[i] = specimen_observation(&filter, i, shift);
        TEST_ASSERT_TRUE(plr_stereo_measure(&filter.belief, &filter.camera, i, &seen[i], &m));
        plr_measurement_keep(&filter.belief, &filter.work, i, &m);
        filter.work.sightings.at[i] = (plr_sighting){&seen[i], (uint16_t)i, PLR_GATE_ACCEPTED, 1};
    }
    filter.work.sightings.count = SEEN;
}

/* The covariance of (state, errors): [P + S V S^T, S V; V S^T, V], V their variances. */
static void join(const plr_filter *f, const double *V, double *joint) {
    const unsigned n = plr_covariance_dim(&f->belief), m = f->camera.errors.count, all = n + m;
    double *P = specimen_covariance(f), *S = specimen_zeros(all, m);
    for (unsigned k = 0; k < m; k++) {
        for (unsigned i = 0; i < n; i++)
            S[i * m + k] = (double)f->belief.S[k][i];
        S[(n + k) * m + k] = 1;
    }
    oracle_sandwich(all, m, S, V, joint);
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < n; j++)
            joint[i * all + j] += P[i * n + j];
    free(S);
    free(P);
}

/* A gain over state and errors. */
static void dense(double *joint, double *dx) {
    const unsigned n = plr_covariance_dim(&filter.belief), m = filter.camera.errors.count,
                   all = n + m;
    double *H = specimen_zeros(ROWS, all), *HP = specimen_zeros(ROWS, all),
           *K = specimen_zeros(ROWS, all), *S = specimen_zeros(ROWS, ROWS);
    double r[ROWS];
    for (unsigned i = 0; i < SEEN; i++) {
        plr_real H_s[PLR_CALIBRATIONS][PLR_ROWS];
        const plr_measurement measured = specimen_measurement(&filter, i, &seen[i]);
        specimen_put_rows(H + 3 * (size_t)i * all, all, &measured.H);
        to_doubles(r + 3 * i, measured.r, 3);
        plr_stereo_by_calibration(&filter.belief, &filter.camera, i, &seen[i], H_s);
        for (unsigned k = 0; k < m; k++)
            for (unsigned row = 0; row < 3; row++)
                H[(3 * i + row) * all + n + k] = (double)H_s[k][row];
    }
    oracle_sandwich(ROWS, all, H, joint, S);
    for (unsigned i = 0; i < ROWS; i++)
        S[i * ROWS + i] += (i % 3 == 2 ? 0.5 : 1) * (double)filter.camera.pixel_variance;
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, ROWS, all, all, 1, H, joint, 0, HP);
    memcpy(K, HP, (size_t)ROWS * all * sizeof *K);
    TEST_ASSERT_TRUE(oracle_solve_spd(ROWS, all, S, K));
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, all, 1, ROWS, 1, K, r, 0, dx);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, all, all, ROWS, -1, K, HP, 1, joint);
    free(S);
    free(K);
    free(HP);
    free(H);
}

static void hold_against_dense(plr_model_kind model, unsigned calibrate) {
    take_specimen(model, calibrate);
    const unsigned n = plr_covariance_dim(&filter.belief), m = filter.camera.errors.count,
                   all = n + m;
    TEST_ASSERT_EQUAL_UINT(m, filter.camera.errors.estimated);
    double V[PLR_CALIBRATIONS * PLR_CALIBRATIONS] = {0}, before[PLR_CALIBRATIONS];
    double *joint = specimen_zeros(all, all), *dx = specimen_zeros(all, 1);
    for (unsigned k = 0; k < m; k++)
        V[(m + 1) * k] = before[k] = (double)filter.camera.errors.variance[k];
    join(&filter, V, joint);
    dense(joint, dx);
    TEST_ASSERT_EQUAL_UINT(SEEN, plr_correct(&filter, &filter.work.sightings, NULL, 0).applied);
    for (unsigned i = 0; i < n; i++) /* dx stays in the workspace */
        TEST_ASSERT_DOUBLE_WITHIN((1e-9 + 4e4 * eps) * (1 + fabs(dx[i])), dx[i],
                                  (double)filter.work.dx[i]);
    wrong_camera_covariance(&filter, V);
    for (unsigned k = 0; k < m; k++) {
        const double moved = (double)filter.camera.estimate.moved[k];
        TEST_ASSERT_DOUBLE_WITHIN((1e-9 + 4e4 * eps) * sqrt(before[k]), dx[n + k], moved);
        for (unsigned l = 0; l < m; l++)
            TEST_ASSERT_DOUBLE_WITHIN((1e-9 + 4e4 * eps) * sqrt(before[k] * before[l]),
                                      joint[(n + k) * all + n + l], V[m * k + l]);
    }
    free(dx);
    free(joint);
}

static void test_one_filter_of_state_and_calibration_gives_the_same(void) {
    hold_against_dense(PLR_MODEL_BODY, EVERYTHING);
    hold_against_dense(PLR_MODEL_WORLD, EVERYTHING);
}

/* What is considered keeps its variance, and misleads what is estimated as it is told: the estimate's
 * error by it is -J^-1 times the information that both share. */
static void test_what_is_considered_widens_what_is_estimated(void) {
    double V[PLR_CALIBRATIONS * PLR_CALIBRATIONS], alone[PLR_CALIBRATIONS];
    take_specimen(PLR_MODEL_BODY, PLR_CALIBRATE_FOCAL | PLR_CALIBRATE_TURN);
    const unsigned m = filter.camera.errors.count, estimated = filter.camera.errors.estimated;
    TEST_ASSERT_EQUAL_UINT(4, estimated);
    TEST_ASSERT_EQUAL_UINT(PLR_WHEEL_SCALE, m); /* those of the camera */
    (void)plr_correct(&filter, &filter.work.sightings, NULL, 0);
    wrong_camera_covariance(&filter, V);
    for (unsigned k = estimated; k < m; k++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-6 * V[(m + 1) * k], (double)filter.camera.errors.variance[k],
                                  V[(m + 1) * k]);
    for (unsigned k = 0; k < estimated; k++) {
        alone[k] = 0; /* without what is considered */
        for (unsigned j = k; j < estimated; j++) {
            const plr_real G = filter.camera.estimate.factor[PLR_CALIBRATIONS * j + k];
            alone[k] +=
                (double)(G * G * filter.camera.errors.variance[j] * filter.camera.estimate.told[j]);
        }
        TEST_ASSERT_TRUE(V[(m + 1) * k] > alone[k]);
        TEST_ASSERT_TRUE(alone[k] < 0.9 * (double)filter.camera.errors.variance[k]);
        TEST_ASSERT_TRUE((double)filter.camera.estimate.moved[k] != 0);
    }
    for (unsigned k = estimated; k < m; k++)
        TEST_ASSERT_TRUE((double)filter.camera.estimate.moved[k] == 0);
}
