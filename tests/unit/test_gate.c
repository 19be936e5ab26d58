// SPDX-License-Identifier: MIT
/* The gate against the dense Mahalanobis distance, and its limits (MATH 8). */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "filter/gate.h"
#include "math/packed.h"
#include "sensor/stereo.h"
#include "state/covariance.h"
#include "state/model.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/specimens.h"

enum { RUNS = 20, LANDMARKS = 5 };

static const double eps = REAL_EPSILON;
static plr_filter filter;
static rng chance;

void setUp(void) {
    chance = rng_seeded(49);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, true, LANDMARKS);
}

static void test_innovation_is_seen_minus_predicted(void) {
    const float shift[4] = {3.5F, 1.0F, -1.75F, 4.0F};
    const plr_observation seen = specimen_observation(&filter, 2, shift);
    const plr_measurement m = specimen_measurement(&filter, 2, &seen);
    const double px = 2e-4; /* specimen_observation holds pixels in float32 */
    TEST_ASSERT_DOUBLE_WITHIN(px, 3.5, (double)m.r[0]);
    TEST_ASSERT_DOUBLE_WITHIN(px, -1.75, (double)m.r[1]);
    TEST_ASSERT_DOUBLE_WITHIN(px, 2.5, (double)m.r[2]);
}

static void test_the_vertical_row_is_a_mean_of_two(void) {
    filter.camera.pixel_variance = PLR_R(9);
    TEST_ASSERT_EQUAL_DOUBLE(9, (double)plr_stereo_variance(&filter.camera, 0));
    TEST_ASSERT_EQUAL_DOUBLE(9, (double)plr_stereo_variance(&filter.camera, 1));
    TEST_ASSERT_EQUAL_DOUBLE(4.5, (double)plr_stereo_variance(&filter.camera, 2));
}

/* S = H P H^T + R of a slot, 3x3, and r, in double. */
static void dense_innovation(unsigned slot, const plr_observation *seen, double S[9], double r[3]) {
    const unsigned n = plr_covariance_dim(&filter.belief);
    const plr_measurement m = specimen_measurement(&filter, slot, seen);
    double *H = specimen_zeros(3, n), *P = specimen_covariance(&filter);
    specimen_put_rows(H, n, &m.H);
    oracle_sandwich(3, n, H, P, S);
    for (unsigned i = 0; i < 3; i++)
        S[4 * i] += (double)m.R[i];
    to_doubles(r, m.r, 3);
    free(P);
    free(H);
}

static double determinant(const double S[9]) {
    return S[0] * (S[4] * S[8] - S[5] * S[7]) - S[1] * (S[3] * S[8] - S[5] * S[6]) +
           S[2] * (S[3] * S[7] - S[4] * S[6]);
}

static void check_model(plr_model_kind model) {
    for (int run = 0; run < RUNS; run++) {
        specimen_filter(&filter, &chance, model, run % 2, LANDMARKS);
        for (unsigned slot = 0; slot < LANDMARKS; slot++) {
            const float shift[4] = {(float)rng_normal(&chance), (float)rng_normal(&chance),
                                    (float)rng_normal(&chance), (float)rng_normal(&chance)};
            const plr_observation seen = specimen_observation(&filter, slot, shift);
            double S[9], r[3], y[3];
            dense_innovation(slot, &seen, S, r);
            const double gain = determinant(S);
            memcpy(y, r, sizeof y);
            TEST_ASSERT_TRUE(oracle_solve_spd(3, 1, S, y));
            const double gap = (double)seen.vL_px - (double)seen.vR_px;
            const double d2 = r[0] * y[0] + r[1] * y[1] + r[2] * y[2] +
                              gap * gap / (2 * (double)filter.camera.pixel_variance);
            const plr_verdict verdict = specimen_judge(&filter, slot, &seen);
            /* S holds variances of up to 1000 px^2 beside 2: a thousand roundings */
            TEST_ASSERT_DOUBLE_WITHIN(d2 * 3000 * eps, d2, (double)verdict.d2);
            TEST_ASSERT_DOUBLE_WITHIN(gain * 3000 * eps, gain, (double)verdict.det_S);
            TEST_ASSERT_TRUE(verdict.accepted); /* the specimen's gate is off */
        }
    }
}

static void test_distance_and_gain_agree_with_the_dense_ones(void) {
    check_model(PLR_MODEL_BODY);
    check_model(PLR_MODEL_WORLD);
}

static void test_the_threshold_itself_is_accepted(void) {
    const float shift[4] = {1, 2, 3, 4};
    const plr_observation seen = specimen_observation(&filter, 2, shift);
    const plr_real d2 = specimen_judge(&filter, 2, &seen).d2;
    filter.par.gate_d2 = d2;
    TEST_ASSERT_TRUE(specimen_judge(&filter, 2, &seen).accepted);
    filter.par.gate_d2 = d2 * PLR_R(0.999);
    TEST_ASSERT_FALSE(specimen_judge(&filter, 2, &seen).accepted);
}

static void test_a_row_gap_counts_even_where_the_three_rows_fit(void) {
    const float shift[4] = {0, 20, 0, -20};
    const plr_observation seen = specimen_observation(&filter, 0, shift);
    const plr_verdict verdict = specimen_judge(&filter, 0, &seen);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 40 * 40 / (2 * 4.0), (double)verdict.d2);
    filter.par.gate_d2 = PLR_R(13.3);
    TEST_ASSERT_FALSE(specimen_judge(&filter, 0, &seen).accepted);
}

static void test_the_course_gate_looks_at_the_norm_of_four_residuals(void) {
    const float shift[4] = {8, 8, 8, 8}; /* norm 16, whatever the covariance says */
    const plr_observation seen = specimen_observation(&filter, 1, shift);
    filter.par.gate_residual2 = PLR_R(16.01 * 16.01);
    filter.par.gate_d2 = PLR_R(1e-6); /* not looked at */
    TEST_ASSERT_TRUE(specimen_judge(&filter, 1, &seen).accepted);
    filter.par.gate_residual2 = PLR_R(15.99 * 15.99);
    TEST_ASSERT_FALSE(specimen_judge(&filter, 1, &seen).accepted);
}

static void test_the_course_gate_when_open_looks_at_the_covariance_too(void) {
    const float near[4] = {1, 1, 1, 1}, far[4] = {8, 8, 8, 8};
    const plr_observation seen = specimen_observation(&filter, 1, near);
    const plr_observation wild = specimen_observation(&filter, 1, far);
    filter.par.gate_residual2 = PLR_R(0.25);
    filter.par.gate_d2 = specimen_judge(&filter, 1, &seen).d2 + 1;
    TEST_ASSERT_FALSE(specimen_judge(&filter, 1, &seen).accepted);
    filter.supervisor.frames_mostly_gated = 10; /* locked */
    TEST_ASSERT_TRUE(specimen_judge(&filter, 1, &seen).accepted);
    TEST_ASSERT_FALSE(specimen_judge(&filter, 1, &wild).accepted);
    filter.par.gate_residual2 = PLR_R(16.01 * 16.01); /* what passes the pixels passes */
    TEST_ASSERT_TRUE(specimen_judge(&filter, 1, &wild).accepted);
}

static void test_a_point_too_near_is_rejected_even_by_an_open_gate(void) {
    const float shift[4] = {0};
    const plr_observation seen = specimen_observation(&filter, 3, shift);
    filter.belief.slots[3].x[2] = PLR_R(0.2);
    const plr_verdict verdict = specimen_judge(&filter, 3, &seen);
    TEST_ASSERT_FALSE(verdict.accepted);
    TEST_ASSERT_TRUE(isfinite((double)verdict.d2) && isfinite((double)verdict.det_S));
}

/* A sigma of more than a focal length in the image is no basis for a linearisation, unless the place
 * is known and it is the pose that is not. */
static void test_a_prediction_off_by_a_radian_is_rejected_but_for_known_landmarks(void) {
    const float shift[4] = {0};
    const plr_observation seen = specimen_observation(&filter, 3, shift);
    const unsigned row = plr_covariance_row(&filter.belief, 3);
    for (unsigned i = row; i < row + 2; i++)
        filter.belief.P[plr_packed_at(i, i)] = PLR_R(9); /* 3 rad of bearing */
    TEST_ASSERT_FALSE(specimen_judge(&filter, 3, &seen).accepted);
    filter.belief.slots[3].known = 1;
    TEST_ASSERT_TRUE(specimen_judge(&filter, 3, &seen).accepted);
}

static void test_an_innovation_covariance_that_is_not_positive_is_rejected(void) {
    const float shift[4] = {0};
    const plr_observation seen = specimen_observation(&filter, 3, shift);
    const unsigned row = plr_covariance_row(&filter.belief, 3);
    for (unsigned i = row; i < row + 3; i++)
        filter.belief.P[plr_packed_at(i, i)] = PLR_R(-1);
    TEST_ASSERT_FALSE(specimen_judge(&filter, 3, &seen).accepted);
    filter.belief.P[plr_packed_at(row, row)] = (plr_real)NAN;
    TEST_ASSERT_FALSE(specimen_judge(&filter, 3, &seen).accepted);
}

static void test_judging_changes_nothing_but_workspace(void) {
    const float shift[4] = {1, 0, 0, 0};
    const plr_observation seen = specimen_observation(&filter, 3, shift);
    static plr_filter before;
    before = filter;
    (void)specimen_judge(&filter, 3, &seen);
    TEST_ASSERT_EQUAL_MEMORY(&before, &filter, sizeof filter);
}
