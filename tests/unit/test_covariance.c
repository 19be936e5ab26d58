// SPDX-License-Identifier: MIT
/* The packed covariance against a dense matrix in double: layout, blocks, motion. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "math/packed.h"
#include "process/process.h"
#include "state/covariance.h"
#include "state/motion.h"
#include "support/covariance_twin.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/specimens.h"

static const double eps = REAL_EPSILON;

void setUp(void) {
    twin.chance = rng_seeded(43);
}

/* ---------------------------------------------------------------- layout and blocks */

static void check_layout(void) {
    const unsigned first = twin.filter.config.bias ? 12 : 6;
    TEST_ASSERT_EQUAL_UINT(first + 3 * twin.filter.belief.count,
                           plr_covariance_dim(&twin.filter.belief));
    for (unsigned slot = 0; slot < twin.filter.belief.count; slot++)
        TEST_ASSERT_EQUAL_UINT(first + 3 * slot, plr_covariance_row(&twin.filter.belief, slot));
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(twin.n, plr_covariance_ld(&twin.filter.belief));
    TEST_ASSERT_LESS_THAN_UINT(twin.n + PLR_TILE_COLUMNS, plr_covariance_ld(&twin.filter.belief));
}

static void test_pose_comes_first_then_bias_then_landmarks(void) {
    twin_for_each_size(check_layout);
}

static void demand_block(const plr_real *got, unsigned row, unsigned column) {
    for (unsigned i = 0; i < 36; i++)
        TEST_ASSERT_EQUAL_DOUBLE(twin.P[(row + i / 6) * twin.n + column + i % 6], (double)got[i]);
}

static void check_blocks(void) {
    plr_real block[36];
    plr_covariance_get(&twin.filter.belief, PLR_BLOCK_POSE, PLR_BLOCK_POSE, block);
    demand_block(block, 0, 0);
    if (!twin.filter.config.bias)
        return;
    plr_covariance_get(&twin.filter.belief, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, block);
    demand_block(block, 6, 6);
    plr_covariance_get(&twin.filter.belief, PLR_BLOCK_POSE, PLR_BLOCK_BIAS, block);
    demand_block(block, 0, 6);
}

static void test_blocks_are_read_as_they_stand(void) {
    twin_for_each_size(check_blocks);
}

static void check_set(void) {
    if (twin.filter.belief.count > 0)
        return;
    double P_xi[36];
    const double variance[6] = {1, 2, 3, 4, 5, 6};
    random_spd(&twin.chance, 6, 0.1, P_xi);
    plr_covariance_begin(&twin.filter.belief, PLR_BLOCK_POSE, P_xi);
    memset(twin.expected, 0, (size_t)twin.n * twin.n * sizeof *twin.expected);
    specimen_put(twin.expected, twin.n, 0, 0, 6, 6, P_xi);
    for (unsigned i = 6; i < twin.n; i++)
        for (unsigned j = 6; j < twin.n; j++)
            twin.expected[i * twin.n + j] = twin.P[i * twin.n + j];
    twin_demand_expected(1);
    if (!twin.filter.config.bias)
        return;
    double P_b[36] = {0};
    for (unsigned i = 0; i < 6; i++)
        P_b[7 * i] = variance[i];
    plr_covariance_begin(&twin.filter.belief, PLR_BLOCK_BIAS, P_b);
    for (unsigned i = 6; i < 12; i++)
        for (unsigned j = 6; j < 12; j++)
            twin.expected[i * twin.n + j] = i == j ? variance[i - 6] : 0;
    twin_demand_expected(1);
}

static void test_pose_and_bias_are_set_without_correlation(void) {
    twin_for_each_size(check_set);
}

static void check_joint(void) {
    for (unsigned slot = 0; slot < twin.filter.belief.count; slot++) {
        plr_real got[9];
        double pose[18], landmark[9], joint[9], got_double[9];
        double *J = specimen_zeros(3, twin.n);
        plr_rows rows = {2, {{plr_covariance_row(&twin.filter.belief, slot), 3, {0}}, {0, 6, {0}}}};
        twin_random(rows.term[1].H, pose, 18);
        twin_random(rows.term[0].H, landmark, 9);
        specimen_put_rows(J, twin.n, &rows);
        oracle_sandwich(3, twin.n, J, twin.P, joint);
        plr_covariance_of_rows(&twin.filter.belief, &rows, got);
        to_doubles(got_double, got, 9);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(100 * eps, 0, specimen_gap(3, joint, got_double),
                                          twin.at);
        free(J);
    }
}

static void test_joint_covariance_of_pose_and_landmark_agrees(void) {
    twin_for_each_size(check_joint);
}

static void check_trace(void) {
    double trace = 0;
    for (unsigned i = 0; i < twin.n; i++)
        trace += twin.P[i * twin.n + i];
    TEST_ASSERT_DOUBLE_WITHIN(1e-14 * trace, trace, plr_covariance_trace(&twin.filter.belief));
}

static void test_trace_is_the_sum_of_the_variances(void) {
    twin_for_each_size(check_trace);
}

static void check_positive(void) {
    static const plr_real spoilt[3] = {PLR_R(-1e-30), (plr_real)NAN, (plr_real)INFINITY};
    TEST_ASSERT_TRUE(plr_covariance_is_positive(&twin.filter.belief));
    for (unsigned i = 0; i < twin.n; i++) {
        plr_real *variance = &twin.filter.belief.P[plr_packed_at(i, i)];
        const plr_real before = *variance;
        for (int k = 0; k < 3; k++) {
            *variance = spoilt[k];
            TEST_ASSERT_FALSE_MESSAGE(plr_covariance_is_positive(&twin.filter.belief), twin.at);
        }
        *variance = 0; /* mapping: the pose is exact */
        TEST_ASSERT_TRUE_MESSAGE(plr_covariance_is_positive(&twin.filter.belief), twin.at);
        *variance = before;
    }
}

static void test_each_variance_is_looked_at(void) {
    twin_for_each_size(check_positive);
}

/* ---------------------------------------------------------------- motion */

static void check_transport(void) {
    plr_real A[36], F[9 * TWIN_MOST_LANDMARKS];
    double same[36];
    double *T = twin_identity();
    twin_random(A, same, 36);
    specimen_put(T, twin.n, 0, 0, 6, 6, same);
    for (unsigned slot = 0; slot < twin.filter.belief.count; slot++) {
        const unsigned row = plr_covariance_row(&twin.filter.belief, slot);
        twin_random(F + 9 * slot, same, 9);
        specimen_put(T, twin.n, row, row, 3, 3, same);
    }
    oracle_sandwich(twin.n, twin.n, T, twin.P, twin.expected);
    plr_covariance_transport(&twin.filter.belief, twin.filter.work.Vt, A, F);
    twin_demand_expected(100);
    free(T);
}

static void test_transport_agrees(void) {
    twin_for_each_size(check_transport);
}

/* P of x <- F x + G (B db + noise), F given, with noise covariance Q. */
static void expect_motion(const plr_motion *motion, double *F, const double *G) {
    double B[36], Q[36], *GB = specimen_zeros(twin.n, 6), *noise = specimen_zeros(twin.n, twin.n);
    specimen_bias_derivative(motion, B);
    to_doubles(Q, motion->Q, 36);
    if (twin.filter.config.bias) {
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, twin.n, 6, 6, 1, G, B, 0, GB);
        for (unsigned i = 0; i < twin.n; i++)
            for (unsigned j = 0; j < 6; j++)
                F[i * twin.n + 6 + j] += GB[6 * i + j];
    }
    oracle_sandwich(twin.n, twin.n, F, twin.P, twin.expected);
    oracle_sandwich(twin.n, 6, G, Q, noise);
    for (unsigned i = 0; i < twin.n * twin.n; i++)
        twin.expected[i] += noise[i];
    free(noise);
    free(GB);
}

static void check_predict_pose(void) {
    plr_motion motion;
    plr_real A[36];
    double same[36], *F = twin_identity(), *G = specimen_zeros(twin.n, 6);
    specimen_motion(&twin.filter, &twin.chance, &motion);
    twin_random(A, same, 36);
    specimen_put(F, twin.n, 0, 0, 6, 6, same);
    for (unsigned k = 0; k < 6; k++)
        G[7 * k] = 1;
    expect_motion(&motion, F, G);
    plr_real BPB[36], M[36];
    twin.filter.motion = motion;
    plr_motion_covariance_by_state(&twin.filter.belief, &twin.filter.motion, BPB);
    for (int i = 0; i < 36; i++)
        M[i] = BPB[i] + motion.Q[i];
    plr_covariance_predict_pose(&twin.filter.belief, A, motion.B, M);
    twin_demand_expected(200);
    free(G);
    free(F);
}

static void test_motion_of_the_pose_alone_agrees(void) {
    twin_for_each_size(check_predict_pose);
}

static void check_walk(void) {
    if (!twin.filter.config.bias)
        return;
    twin.filter.source.bias_velocity_walk = PLR_R(0.125);
    twin.filter.source.bias_gyro_walk = PLR_R(0.03125);
    plr_process_twist.walk(&twin.filter.belief, &twin.filter.source, 2);
    for (unsigned i = 6; i < 12; i++)
        twin.expected[i * twin.n + i] += i < 9 ? 0.25 : 0.0625;
    twin_demand_expected(1);
}

static void test_the_walk_adds_to_the_bias_variances_alone(void) {
    twin_for_each_size(check_walk);
}
