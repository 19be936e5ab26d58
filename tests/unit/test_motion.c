// SPDX-License-Identifier: MIT
/* The pose's motion and what it accumulates for the covariance (MATH 4), against the same in
 * double by power series. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "filter/predict.h"
#include "math/packed.h"
#include "process/process.h"
#include "state/covariance.h"
#include "state/motion.h"
#include "state/pose.h"
#include "support/held_step.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/pose_of.h"
#include "support/reseal.h"
#include "support/rigid.h"
#include "support/specimens.h"
#include "support/twin.h"

enum { STEPS = 10, LANDMARKS = 4 };

static const double eps = REAL_EPSILON;
static plr_filter filter, before;
static textbook truth;
static rng chance;

void setUp(void) {
    chance = rng_seeded(51);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, true, LANDMARKS);
    twin_of_specimen(&truth, &filter);
}

static void pose_now(double M[16]) {
    reseal(&filter); /* moved from inside */
    const plr_pose pose = pose_of(&filter);
    rigid_from_pose(M, &pose);
}

static void to_motion(double M[16], const plr_real R[9], const plr_real p[3]) {
    plr_pose pose;
    to_doubles(pose.R, R, 9);
    to_doubles(pose.p, p, 3);
    rigid_from_pose(M, &pose);
}

/* The same of (I + E, p). */
static void to_small_motion(double M[16], const plr_real E[9], const plr_real p[3]) {
    to_motion(M, E, p);
    for (int i = 0; i < 3; i++)
        M[5 * i] += 1;
}

static void random_reading(plr_real reading[6], double same[6]) {
    rng_normals(&chance, 2, same, 3);
    rng_normals(&chance, 0.7, same + 3, 3);
    to_reals(reading, same, 6);
    to_doubles(same, reading, 6);
}

/* ---------------------------------------------------------------- clear and check */

static void test_cleared_motion_is_none(void) {
    memset(&filter.motion, 0xFF, sizeof filter.motion);
    plr_motion_clear(&filter.belief, &filter.motion);
    const plr_motion motion = filter.motion;
    double D[16], identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    to_small_motion(D, motion.E, motion.p);
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, largest_difference(identity, D, 16));
    for (int i = 0; i < 36; i++)
        TEST_ASSERT_TRUE(motion.Q[i] == 0);
    for (int i = 0; i < PLR_MOTION_BY; i++)
        TEST_ASSERT_TRUE(motion.B[i] == 0);
    TEST_ASSERT_TRUE(motion.pending == 0 && motion.noisy == 0 && motion.seconds == 0);
}

static plr_status check(double v, double w, double seconds) {
    const plr_real reading[6] = {(plr_real)v, 0, 0, 0, (plr_real)w, 0};
    return plr_process_twist.check(&filter.belief, &filter.source, reading, (plr_real)seconds);
}

static void test_a_step_holds_up_to_pi_and_a_kilometre(void) {
    memset(filter.belief.bias, 0, sizeof filter.belief.bias);
    TEST_ASSERT_EQUAL_INT(PLR_OK, check(999, 3.14, 1));
    TEST_ASSERT_EQUAL_INT(PLR_OK, check(-9990, -31.4, 0.1));
    TEST_ASSERT_EQUAL_INT(PLR_E_RANGE, check(1001, 0, 1));
    TEST_ASSERT_EQUAL_INT(PLR_E_RANGE, check(0, 3.15, 1));
    TEST_ASSERT_EQUAL_INT(PLR_E_RANGE, check(0, -3.15, 1));
    TEST_ASSERT_EQUAL_INT(PLR_E_RANGE, check(1e30, 0, 1)); /* overflows in float32 */
    TEST_ASSERT_EQUAL_INT(PLR_E_RANGE, check((double)NAN, 0, 1));
    TEST_ASSERT_EQUAL_INT(PLR_OK, check(1e6, 1e3, 0));
}

static void test_the_bias_is_taken_off_before_the_limit(void) {
    filter.belief.bias[4] = PLR_R(2);
    TEST_ASSERT_EQUAL_INT(PLR_OK, check(0, 5.1, 1));
    TEST_ASSERT_EQUAL_INT(PLR_E_RANGE, check(0, -1.2, 1));
}

/* ---------------------------------------------------------------- step */

static void test_steps_move_the_pose_by_exponentials(void) {
    double T[16], got[16];
    pose_now(T);
    for (int k = 0; k < STEPS; k++) {
        plr_real reading[6];
        double same[6], xi[6], D[16], next[16];
        random_reading(reading, same);
        for (int i = 0; i < 6; i++)
            xi[i] = (double)PLR_R(0.05) * (same[i] - (double)filter.belief.bias[i]);
        rigid_exp(D, xi);
        square_multiply(4, T, D, next);
        memcpy(T, next, sizeof T);
        held_step(&plr_process_twist, &filter, filter.belief.t_ns + 50000000, reading, PLR_R(0.05),
                  PLR_R(0.05));
    }
    pose_now(got);
    TEST_ASSERT_DOUBLE_WITHIN(30 * STEPS * eps, 0, largest_difference(T, got, 16));
    TEST_ASSERT_EQUAL_UINT64(1000000000 + 50000000ULL * STEPS, filter.belief.t_ns);
    TEST_ASSERT_DOUBLE_WITHIN(10 * eps, 0.05 * STEPS, (double)filter.motion.seconds);
}

/* A float32 position would round a tenth of a millimetre away at 10 km. */
static void test_far_from_the_origin_small_steps_are_not_lost(void) {
    const plr_real creep[6] = {PLR_R(0.01), 0, 0, 0, 0, 0};
    memset(filter.belief.bias, 0, sizeof filter.belief.bias);
    for (int i = 0; i < 9; i++)
        filter.belief.R_WB[i] = i % 4 == 0;
    filter.belief.p_WB[0] = 1e4;
    for (int k = 0; k < 10000; k++)
        held_step(&plr_process_twist, &filter, filter.belief.t_ns + 10000000, creep, PLR_R(0.01),
                  PLR_R(0.01));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 1e4 + 1, filter.belief.p_WB[0]);
}

static void test_the_motion_accumulates_as_a_product(void) {
    double start[16], end[16], inverse[16], expected[16], got[16];
    pose_now(start);
    for (int k = 0; k < STEPS; k++) {
        plr_real reading[6];
        double same[6];
        random_reading(reading, same);
        held_step(&plr_process_twist, &filter, filter.belief.t_ns + 50000000, reading, PLR_R(0.05),
                  PLR_R(0.05));
    }
    pose_now(end);
    rigid_inverse(inverse, start);
    square_multiply(4, inverse, end, expected);
    to_small_motion(got, filter.motion.E, filter.motion.p);
    TEST_ASSERT_DOUBLE_WITHIN(100 * STEPS * eps, 0, largest_difference(expected, got, 16));
    TEST_ASSERT_EQUAL_UINT8(1, filter.motion.pending);
    TEST_ASSERT_EQUAL_UINT8(1, filter.motion.noisy);
}

/* Q <- Ad(D_k^-1) Q Ad(D_k^-1)^T + Q_k,  B <- Ad(D_k^-1) B - tau Jr(xi) */
static void test_noise_and_bias_jacobian_follow_their_recursions(void) {
    double Q[36] = {0}, B[36] = {0};
    const plr_real variance[6] = {PLR_R(0.25), PLR_R(0.0625), PLR_R(1),
                                  PLR_R(0.01), PLR_R(0.04),   PLR_R(0.5)};
    memcpy(filter.source.velocity_variance, variance, sizeof filter.source.velocity_variance);
    memcpy(filter.source.gyro_variance, variance + 3, sizeof filter.source.gyro_variance);
    for (int k = 0; k < STEPS; k++) {
        plr_real reading[6];
        double same[6], xi[6], D[16], inverse[16], A[36], Jr[36], next[36];
        const double tau = (double)PLR_R(0.05);
        random_reading(reading, same);
        for (int i = 0; i < 6; i++)
            xi[i] = tau * (same[i] - (double)filter.belief.bias[i]);
        rigid_exp(D, xi);
        rigid_inverse(inverse, D);
        rigid_adjoint(A, inverse);
        oracle_sandwich(6, 6, A, Q, next);
        for (int i = 0; i < 6; i++)
            next[7 * i] += (double)variance[i] * tau * tau;
        memcpy(Q, next, sizeof Q);
        rigid_right_jacobian(Jr, xi);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, 6, 6, 1, A, B, 0, next);
        for (int i = 0; i < 36; i++)
            B[i] = next[i] - tau * Jr[i];
        held_step(&plr_process_twist, &filter, filter.belief.t_ns + 50000000, reading, PLR_R(0.05),
                  PLR_R(0.05));
    }
    double got_Q[36], got_B[36];
    to_doubles(got_Q, filter.motion.Q, 36);
    specimen_bias_derivative(&filter.motion, got_B);
    TEST_ASSERT_DOUBLE_WITHIN(30 * STEPS * eps, 0, specimen_gap(6, Q, got_Q));
    TEST_ASSERT_DOUBLE_WITHIN(30 * STEPS * eps, 0, largest_difference(B, got_B, 36));
}

/* B is how the accumulated displacement hangs on the bias: by differences of the whole product. */
static void test_bias_jacobian_agrees_with_differences(void) {
    const double h = 1e-6, tau = (double)PLR_R(0.05);
    double twists[STEPS][6];
    for (int k = 0; k < STEPS; k++) {
        plr_real reading[6];
        random_reading(reading, twists[k]);
        held_step(&plr_process_twist, &filter, filter.belief.t_ns + 50000000, reading, PLR_R(0.05),
                  PLR_R(0.05));
    }
    for (int j = 0; j < 6; j++) {
        double D[3][16];
        for (int end = 0; end < 3; end++) {
            rigid_exp(D[end], (const double[6]){0});
            for (int k = 0; k < STEPS; k++) {
                double xi[6], step[16], next[16];
                for (int i = 0; i < 6; i++)
                    xi[i] = tau * (twists[k][i] - (double)filter.belief.bias[i] -
                                   (i == j ? (end - 1) * h : 0));
                rigid_exp(step, xi);
                square_multiply(4, D[end], step, next);
                memcpy(D[end], next, sizeof next);
            }
        }
        double back[16], product[16], ahead[6], behind[6];
        rigid_inverse(back, D[1]);
        square_multiply(4, back, D[2], product);
        rigid_vee(ahead, product);
        square_multiply(4, back, D[0], product);
        rigid_vee(behind, product);
        for (int i = 0; i < 6; i++)
            TEST_ASSERT_DOUBLE_WITHIN(1e-8 + 30 * STEPS * eps, (ahead[i] - behind[i]) / (2 * h),
                                      (double)filter.motion.B[PLR_DRIVERS * i + j]);
    }
}

/* A reading held in parts is charged once in all: sigma^2 tau^2. */
static double charged(plr_noise_kind noise, double part_s, int parts) {
    const plr_real standing[6] = {0};
    setUp();
    memset(filter.belief.bias, 0, sizeof filter.belief.bias);
    filter.source.noise = (uint8_t)noise;
    filter.source.velocity_variance[0] = PLR_R(4);
    for (int k = 0; k < parts; k++)
        held_step(&plr_process_twist, &filter, filter.belief.t_ns + 1000000, standing,
                  (plr_real)part_s, PLR_R(0.1));
    return (double)filter.motion.Q[0];
}

static void test_a_reading_is_charged_once_however_it_is_cut(void) {
    TEST_ASSERT_DOUBLE_WITHIN(20 * eps, 4 * 0.1 * 0.1, charged(PLR_NOISE_TWIST, 0.1, 1));
    TEST_ASSERT_DOUBLE_WITHIN(20 * eps, 4 * 0.1 * 0.1, charged(PLR_NOISE_TWIST, 0.025, 4));
    TEST_ASSERT_DOUBLE_WITHIN(100 * eps, 4, charged(PLR_NOISE_STEP, 0.1, 1));
    TEST_ASSERT_DOUBLE_WITHIN(100 * eps, 4, charged(PLR_NOISE_STEP, 0.02, 5));
}

/* ---------------------------------------------------------------- jump and correction */

static void test_a_jump_is_exact_and_free_of_noise(void) {
    double there[16], start[16], inverse[16], expected[16], got[16], xi[6];
    plr_real R[9];
    pose_now(start);
    rng_normals(&chance, 0.5, xi, 6);
    rigid_exp(expected, xi);
    square_multiply(4, start, expected, there);
    const double p[3] = {there[3], there[7], there[11]};
    for (int i = 0; i < 9; i++)
        R[i] = (plr_real)there[4 * (i / 3) + i % 3];
    plr_motion_jump(&filter.belief, &filter.motion, 123, R, p);
    TEST_ASSERT_EQUAL_UINT64(123, filter.belief.t_ns);
    TEST_ASSERT_EQUAL_MEMORY(p, filter.belief.p_WB, sizeof p);
    TEST_ASSERT_TRUE(same_bits(R, filter.belief.R_WB, 9));
    rigid_inverse(inverse, start);
    square_multiply(4, inverse, there, expected);
    to_small_motion(got, filter.motion.E, filter.motion.p);
    TEST_ASSERT_DOUBLE_WITHIN(50 * eps, 0, largest_difference(expected, got, 16));
    TEST_ASSERT_EQUAL_UINT8(0, filter.motion.noisy);
    for (int i = 0; i < 36; i++)
        TEST_ASSERT_TRUE(filter.motion.Q[i] == 0);
    for (int i = 0; i < PLR_MOTION_BY; i++)
        TEST_ASSERT_TRUE(filter.motion.B[i] == 0);
}

static double distance_from_rotation(void) {
    double R[9], Rt_R[9], identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    to_doubles(R, filter.belief.R_WB, 9);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, 3, 3, 3, 1, R, R, 0, Rt_R);
    return largest_difference(identity, Rt_R, 9);
}

static void test_a_correction_is_an_exponential_on_the_right(void) {
    double start[16], D[16], expected[16], got[16], same[6];
    plr_real xi[6];
    pose_now(start);
    rng_normals(&chance, 0.3, same, 6);
    to_reals(xi, same, 6);
    to_doubles(same, xi, 6);
    rigid_exp(D, same);
    square_multiply(4, start, D, expected);
    plr_pose_correct(&filter.belief, xi);
    pose_now(got);
    TEST_ASSERT_DOUBLE_WITHIN(50 * eps, 0, largest_difference(expected, got, 16));
}

static void test_a_correction_makes_the_rotation_one_again(void) {
    const plr_real none[6] = {0};
    for (int i = 0; i < 9; i++)
        filter.belief.R_WB[i] *= PLR_R(1.0001);
    plr_pose_correct(&filter.belief, none);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7 + 10 * eps, 0, distance_from_rotation()); /* 1e-4 squared */
}

/* An hour at 100 Hz without a single observation. */
static void test_the_rotation_stays_one_through_an_hour_of_steps(void) {
    const plr_real turning[6] = {PLR_R(1), 0, 0, PLR_R(0.1), PLR_R(-0.3), PLR_R(0.5)};
    for (int k = 0; k < 360000; k++)
        held_step(&plr_process_twist, &filter, filter.belief.t_ns + 10000000, turning, PLR_R(0.01),
                  PLR_R(0.01));
    TEST_ASSERT_DOUBLE_WITHIN(10 * eps, 0, distance_from_rotation());
}

/* ---------------------------------------------------------------- settle */

static void drive(void) {
    for (int k = 0; k < STEPS; k++) {
        plr_real reading[6];
        double same[6];
        random_reading(reading, same);
        held_step(&plr_process_twist, &filter, filter.belief.t_ns + 10000000, reading, PLR_R(0.01),
                  PLR_R(0.01));
    }
}

/* A ten-thousandth of what the biases make of the motion is charged as noise besides, in `body`. */
static void add_share_of_bias(double P[36]) {
    plr_real P_b[36];
    double B[36], same[36], share[36];
    plr_covariance_get(&before.belief, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, P_b);
    to_doubles(same, P_b, 36);
    specimen_bias_derivative(&before.motion, B);
    oracle_sandwich(6, 6, B, same, share);
    for (int i = 0; i < 36; i++)
        P[i] += 1e-4 * share[i];
}

static void check_pose_covariance(plr_model_kind model, bool bias) {
    plr_real on_the_side[36], settled[36];
    double a[36], b[36];
    specimen_filter(&filter, &chance, model, bias, LANDMARKS);
    drive();
    before = filter;
    plr_motion_pose_covariance(&filter.belief, &filter.motion, on_the_side);
    TEST_ASSERT_EQUAL_MEMORY(&before, &filter, sizeof filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_prior(&filter));
    plr_covariance_get(&filter.belief, PLR_BLOCK_POSE, PLR_BLOCK_POSE, settled);
    to_doubles(a, on_the_side, 36);
    to_doubles(b, settled, 36);
    if (bias && model == PLR_MODEL_BODY)
        add_share_of_bias(a);
    TEST_ASSERT_DOUBLE_WITHIN(100 * eps, 0, specimen_gap(6, b, a));
    TEST_ASSERT_TRUE(is_symmetric(on_the_side, 6));
}

static void test_pose_covariance_on_the_side_is_the_settled_one(void) {
    for (int run = 0; run < 8; run++)
        check_pose_covariance(run % 2 ? PLR_MODEL_BODY : PLR_MODEL_WORLD, run / 2 % 2);
}

static void test_settling_clears_the_motion_and_is_done_once(void) {
    drive();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_prior(&filter));
    TEST_ASSERT_EQUAL_UINT8(0, filter.motion.pending);
    before = filter;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_prior(&filter));
    TEST_ASSERT_EQUAL_MEMORY(&before, &filter, sizeof filter);
}

static void test_settling_charges_the_walk_of_the_bias(void) {
    plr_real was[36], is[36];
    filter.source.bias_velocity_walk = PLR_R(0.5);
    filter.source.bias_gyro_walk = PLR_R(0.125);
    plr_covariance_get(&filter.belief, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, was);
    drive();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_prior(&filter));
    plr_covariance_get(&filter.belief, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, is);
    const double seconds = 0.01 * STEPS;
    for (int i = 0; i < 6; i++)
        TEST_ASSERT_DOUBLE_WITHIN(20 * eps, (i < 3 ? 0.5 : 0.125) * seconds,
                                  (double)is[7 * i] - (double)was[7 * i]);
}

static void test_a_variance_that_is_lost_is_a_divergence(void) {
    filter.belief.P[plr_packed_at(14, 14)] = (plr_real)-1e3;
    drive();
    TEST_ASSERT_EQUAL_INT(PLR_E_DIVERGED, plr_predict_apply_prior(&filter));
    TEST_ASSERT_EQUAL_UINT64(filter.belief.t_ns, filter.totals.diverged_ns);
}
