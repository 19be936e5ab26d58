// SPDX-License-Identifier: MIT
/* The correction by a frame, in blocks, against one dense gain (MATH 10); a block is all or
 * nothing. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "filter/correction.h"
#include "filter/gate.h"
#include "math/packed.h"
#include "sensor/stereo.h"
#include "state/covariance.h"
#include "state/model.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/specimens.h"

/* `MANY` is two whole blocks and a part of one. */
enum { MANY = 2 * PLR_BLOCK_OBSERVATIONS + 3, BIAS = 6 };

static const double eps = REAL_EPSILON;
static plr_filter filter, before;
static rng chance;
static plr_observation seen[MANY];

/* By observation i of slot i, i = 0 .. count-1. */
static plr_correction correct(unsigned count) {
    static plr_measurement m[MANY];
    for (unsigned i = 0; i < count; i++)
        TEST_ASSERT_TRUE(plr_stereo_measure(&filter.belief, &filter.camera, i, &seen[i], &m[i]));
    return plr_correct(&filter, NULL, m, count);
}

void setUp(void) {
    chance = rng_seeded(52);
}

/* A specimen whose every landmark is seen, a pixel or so beside the prediction. */
static void take_specimen(plr_model_kind model, bool bias) {
    specimen_filter(&filter, &chance, model, bias, MANY);
    for (unsigned slot = 0; slot < MANY; slot++) {
        const float u = (float)rng_normal(&chance), v = (float)rng_normal(&chance);
        const float shift[4] = {u, v, (float)(0.9 * (double)u), v};
        seen[slot] = specimen_observation(&filter, slot, shift);
    }
}

/* dx = K r and P - K S K^T of the first `count` observations, by one gain in double. */
static void dense_correction(unsigned count, double *dx, double *P) {
    const unsigned n = plr_covariance_dim(&filter.belief), m = 3 * count;
    double *H = specimen_zeros(m, n), *r = specimen_zeros(m, 1), *S = specimen_zeros(m, m);
    double *HP = specimen_zeros(m, n), *K = specimen_zeros(m, n),
           *prior = specimen_covariance(&filter);
    for (unsigned a = 0; a < count; a++) {
        const plr_measurement measured = specimen_measurement(&filter, a, &seen[a]);
        specimen_put_rows(H + 3 * (size_t)a * n, n, &measured.H);
        to_doubles(r + 3 * a, measured.r, 3);
    }
    oracle_sandwich(m, n, H, prior, S);
    for (unsigned i = 0; i < m; i++)
        S[i * m + i] += (double)plr_stereo_variance(&filter.camera, i % 3);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, m, n, n, 1, H, prior, 0, HP);
    memcpy(K, HP, (size_t)m * n * sizeof *K);
    TEST_ASSERT_TRUE(oracle_solve_spd(m, n, S, K)); /* K^T = S^-1 H P */
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, n, 1, m, 1, K, r, 0, dx);
    memcpy(P, prior, (size_t)n * n * sizeof *P);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, n, n, m, -1, K, HP, 1, P);
    free(prior);
    free(K);
    free(HP);
    free(S);
    free(r);
    free(H);
}

static void check_against_dense(plr_model_kind model, bool bias, unsigned count) {
    take_specimen(model, bias);
    const unsigned n = plr_covariance_dim(&filter.belief),
                   first = plr_covariance_row(&filter.belief, 0);
    double *dx = specimen_zeros(n, 1), *P = specimen_zeros(n, n),
           *prior = specimen_covariance(&filter);
    dense_correction(count, dx, P);
    double bias_before[6];
    to_doubles(bias_before, filter.belief.bias, 6);
    const plr_correction correction = correct(count);
    TEST_ASSERT_EQUAL_UINT(count, correction.applied);
    TEST_ASSERT_EQUAL_UINT(0, correction.failed_batches);
    TEST_ASSERT_EQUAL_UINT(0, correction.cut);
    TEST_ASSERT_EQUAL_INT(PLR_OK, correction.status);

    /* dx stays in the workspace: against each row's standard deviation before */
    for (unsigned i = 0; i < n; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-9 + 2e4 * eps, 0,
                                  (dx[i] - (double)filter.work.dx[i]) / sqrt(prior[i * n + i]));
    for (unsigned i = BIAS; i < first; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-9 + 1e3 * eps, bias_before[i - BIAS] + dx[i],
                                  (double)filter.belief.bias[i - BIAS]);
    /* the block of the biases is what no retraction transports */
    double *after = specimen_covariance(&filter);
    for (unsigned i = BIAS; i < first; i++)
        for (unsigned j = BIAS; j < first; j++)
            TEST_ASSERT_DOUBLE_WITHIN((1e-9 + 2e4 * eps) *
                                          sqrt(prior[i * n + i] * prior[j * n + j]),
                                      P[i * n + j], after[i * n + j]);
    free(after);
    free(prior);
    free(P);
    free(dx);
}

static void test_blocks_give_the_correction_of_one_gain(void) {
    for (int bias = 0; bias < 2; bias++)
        for (unsigned count = 1; count <= MANY; count += count < 3 ? 1 : 4) {
            check_against_dense(PLR_MODEL_BODY, bias, count);
            check_against_dense(PLR_MODEL_WORLD, bias, count);
        }
}

static void test_no_observations_change_nothing(void) {
    take_specimen(PLR_MODEL_BODY, true);
    before = filter;
    const plr_correction correction = correct(0);
    TEST_ASSERT_EQUAL_UINT(0, correction.applied);
    TEST_ASSERT_EQUAL_MEMORY(filter.belief.P, before.belief.P, sizeof filter.belief.P);
    TEST_ASSERT_EQUAL_MEMORY(filter.belief.slots, before.belief.slots, sizeof filter.belief.slots);
    TEST_ASSERT_EQUAL_MEMORY(filter.belief.R_WB, before.belief.R_WB, sizeof filter.belief.R_WB);
    TEST_ASSERT_EQUAL_MEMORY(filter.belief.p_WB, before.belief.p_WB, sizeof filter.belief.p_WB);
}

/* Correlates two errors of a landmark beyond 1: its variances look healthy, S cannot be factorised.
 * Nothing else is tied to it, so that other blocks cannot notice. */
static void spoil(unsigned slot) {
    const unsigned row = plr_covariance_row(&filter.belief, slot);
    for (unsigned i = 0; i < plr_covariance_dim(&filter.belief); i++)
        for (unsigned k = row; k < row + 3; k++)
            if (i != k)
                filter.belief.P[plr_packed_at(i, k)] = 0;
    filter.belief.P[plr_packed_at(row, row)] = filter.belief.P[plr_packed_at(row + 1, row + 1)] =
        PLR_R(1e-3);
    filter.belief.P[plr_packed_at(row, row + 1)] = PLR_R(0.1);
}

static bool estimate_is_as_before(void) {
    return memcmp(filter.belief.R_WB, before.belief.R_WB, sizeof filter.belief.R_WB) == 0 &&
           memcmp(filter.belief.p_WB, before.belief.p_WB, sizeof filter.belief.p_WB) == 0 &&
           memcmp(filter.belief.bias, before.belief.bias, sizeof filter.belief.bias) == 0 &&
           memcmp(filter.belief.slots, before.belief.slots, sizeof filter.belief.slots) == 0 &&
           memcmp(filter.belief.P, before.belief.P, sizeof filter.belief.P) == 0;
}

static void test_a_block_that_cannot_be_factorised_leaves_the_estimate(void) {
    take_specimen(PLR_MODEL_BODY, true);
    spoil(1);
    before = filter;
    const plr_correction correction = correct(2);
    if (PLR_BLOCK_OBSERVATIONS == 1) {
        TEST_ASSERT_EQUAL_UINT(1, correction.applied);
        TEST_ASSERT_EQUAL_UINT(1, correction.failed_batches);
        return;
    }
    TEST_ASSERT_EQUAL_UINT(0, correction.applied);
    TEST_ASSERT_EQUAL_UINT(1, correction.failed_batches);
    TEST_ASSERT_TRUE(estimate_is_as_before());
}

/* The spoilt landmark is in the second block: the first is a valid posterior and stays. */
static void test_blocks_beside_a_failed_one_are_applied(void) {
    const unsigned blocks = (MANY + PLR_BLOCK_OBSERVATIONS - 1) / PLR_BLOCK_OBSERVATIONS;
    const unsigned first = (MANY + blocks - 1) / blocks; /* as alike as they can be */
    const unsigned second = (MANY - first + blocks - 2) / (blocks - 1);
    take_specimen(PLR_MODEL_BODY, false);
    spoil(first);
    const plr_correction correction = correct(MANY);
    TEST_ASSERT_EQUAL_UINT(1, correction.failed_batches);
    TEST_ASSERT_EQUAL_UINT(MANY - second, correction.applied);
}

/* An indefinite P whose diagonal looks healthy: the subtraction takes more than there is. */
static void test_a_variance_that_would_be_lost_stops_the_correction(void) {
    take_specimen(PLR_MODEL_BODY, false);
    const unsigned row = plr_covariance_row(&filter.belief, 0);
    const plr_real own = filter.belief.P[plr_packed_at(row, row)];
    /* correlated with the pose beyond 1 */
    filter.belief.P[plr_packed_at(0, 0)] = PLR_R(1e-4);
    filter.belief.P[plr_packed_at(row, 0)] = (plr_real)(20 * sqrt((double)own * 1e-4));
    before = filter;
    const plr_correction correction = correct(1);
    TEST_ASSERT_EQUAL_UINT(0, correction.applied);
    TEST_ASSERT_EQUAL_INT(PLR_E_DIVERGED, correction.status);
    TEST_ASSERT_EQUAL_UINT64(filter.belief.t_ns, filter.totals.diverged_ns);
    TEST_ASSERT_TRUE(estimate_is_as_before());
}

/* A correction of kilometres or of more than 3 rad is no correction. */
static void test_a_senseless_correction_is_a_divergence(void) {
    take_specimen(PLR_MODEL_BODY, false);
    for (unsigned i = 0; i < plr_covariance_dim(&filter.belief); i++) /* the pose: ten kilometres */
        for (unsigned k = 0; k < 3; k++)
            filter.belief.P[plr_packed_at(i, k)] *= i < 3 ? PLR_R(4e10) : PLR_R(2e5);
    seen[0].uL_px += 30;
    const plr_pose pose = {{0},
                           {filter.belief.p_WB[0], filter.belief.p_WB[1], filter.belief.p_WB[2]}};
    TEST_ASSERT_EQUAL_INT(PLR_E_DIVERGED, correct(1).status);
    TEST_ASSERT_EQUAL_MEMORY(pose.p, filter.belief.p_WB, sizeof pose.p);
}

/* Landmarks that are not correlated and take no part in a common motion. */
static void take_loose_specimen(void) {
    take_specimen(PLR_MODEL_BODY, false);
    for (unsigned slot = 0; slot < MANY; slot++)
        filter.belief.slots[slot].known = 1;
    for (unsigned i = 0; i < plr_covariance_dim(&filter.belief); i++)
        memset(filter.belief.P + plr_packed_at(i, 0), 0, i * sizeof *filter.belief.P);
}

static double range_of(unsigned slot) {
    const plr_real *q = filter.belief.slots[slot].x;
    return sqrt((double)(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]));
}

/* Pixels that say "beyond infinity" are believed: the point stands at the largest range, and what is
 * missing is kept beside it, so that nothing is cut. */
static void test_corrections_beyond_the_largest_range_are_kept(void) {
    take_loose_specimen();
    filter.camera.min_inverse_range = PLR_R(1) / PLR_R(40); /* 40 m, and all lie within 30 or so */
    filter.camera.pixel_variance = PLR_R(1e-6);
    const double by_inverse_range =
        (double)(filter.camera.given.fx * filter.camera.given.baseline); /* px m, along the axis */
    for (unsigned slot = 0; slot < 3; slot++)
        seen[slot].uR_px = seen[slot].uL_px + 30; /* beyond infinity */
    const plr_correction correction = correct(3);
    TEST_ASSERT_EQUAL_UINT(0, correction.cut);
    TEST_ASSERT_EQUAL_UINT(3, correction.applied);
    for (unsigned slot = 0; slot < 3; slot++) {
        const double range = range_of(slot), axis = (double)filter.belief.slots[slot].x[2] / range;
        const double inverse_range = 1 / range + (double)filter.belief.slots[slot].beyond;
        TEST_ASSERT_DOUBLE_WITHIN(0.4, 40, range);
        TEST_ASSERT_DOUBLE_WITHIN(0.3, -30, inverse_range / axis * by_inverse_range);
    }
    for (unsigned slot = 3; slot < MANY; slot++)
        TEST_ASSERT_TRUE(isfinite((double)filter.belief.slots[slot].x[2]));
}

static void test_corrections_at_the_least_range_are_counted(void) {
    take_loose_specimen();
    filter.camera.pixel_variance = PLR_R(1e-6);
    seen[0].uR_px = seen[0].uL_px - 1e5F; /* a millimetre before the lens */
    const plr_correction correction = correct(1);
    TEST_ASSERT_EQUAL_UINT(1, correction.applied);
    TEST_ASSERT_EQUAL_UINT(1, correction.cut);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.01, range_of(0));
}
