// SPDX-License-Identifier: MIT
/* The motion's noise outside of P (MATH 10): opened, informed by blocks of observations and closed, it
 * must come to what one dense gain makes of a P that holds it all, however large or singular it is. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "filter/correction.h"
#include "filter/gate.h"
#include "filter/predict.h"
#include "sensor/stereo.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/motion.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/reseal.h"
#include "support/rigid.h"
#include "support/specimens.h"
#include "support/twin.h"
#include "textbook/observe.h"

/* `MANY` is two whole blocks and a part of one. */
enum { MANY = 2 * PLR_BLOCK_OBSERVATIONS + 3, RUNS = 5 };

typedef enum noise_kind { ORDINARY, HUGE_NOISE, EXACT_AXES, EXACT, KINDS } noise_kind;

static const double eps = REAL_EPSILON;
static plr_filter filter;
static plr_applied_motion motion;
static rng chance;
static char at[48];

void setUp(void) {
    chance = rng_seeded(71);
}

/* Noise that is a thousand times what a pixel tells, none along some axes, or none at all. */
static void set_noise(noise_kind kind, plr_motion *m) {
    static const double huge[6] = {4, 2, 3, 1, 2, 0.5};
    for (unsigned i = 0; i < 36; i++) {
        const unsigned r = i / 6, c = i % 6;
        if (kind == HUGE_NOISE)
            m->Q[i] = (plr_real)(r == c ? huge[r] : 0.2);
        if (kind == EXACT || (kind == EXACT_AXES && (r % 3 == 1 || c % 3 == 1)))
            m->Q[i] = 0;
    }
}

/* A specimen with a motion to be applied, at nu = 0 or a random place. */
static void take_specimen(noise_kind kind, bool bias, bool shifted) {
    plr_real z[6] = {0};
    double z_double[6];
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, bias, MANY);
    specimen_motion(&filter, &chance, &filter.motion);
    filter.source.bias_velocity_walk = filter.source.bias_gyro_walk = 0; /* tests of motion.c */
    set_noise(kind, &filter.motion);
    for (unsigned i = 0; bias && i < 36; i++) /* as a tenth of a second of driving leaves it */
        filter.motion.B[PLR_DRIVERS * (i / 6) + i % 6] =
            (plr_real)(0.01 * rng_normal(&chance) - (i % 7 == 0 ? 0.1 : 0));
    plr_motion_prior(&filter.belief, &filter.motion, &filter.work.noise, 1, &motion);
    rng_normals(&chance, kind == HUGE_NOISE ? 0.01 : 1, z_double, 6);
    if (shifted)
        to_reals(z, z_double, 6);
    plr_motion_at(&filter.motion, &motion, z, &motion);
    snprintf(at, sizeof at, "noise %d, bias %d, shifted %d", kind, bias, shifted);
}

static void for_each_noise(void (*check)(noise_kind kind, bool bias, bool shifted)) {
    for (int kind = 0; kind < KINDS; kind++)
        for (int run = 0; run < 4 * RUNS; run++)
            check((noise_kind)kind, run % 2, run / 2 % 2);
}

/* ---------------------------------------------------------------- the factor */

/* L L^T = B P_bb B^T 1.0001 + Q, and zero columns where the twists are exact. */
static void check_factor(noise_kind kind, bool bias, bool shifted) {
    take_specimen(kind, bias, shifted);
    double M[36], L[36], got[36];
    to_doubles(M, filter.motion.Q, 36);
    if (bias) {
        double B[36], P_b[36], share[36];
        plr_real real[36];
        plr_covariance_get(&filter.belief, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, real);
        to_doubles(P_b, real, 36);
        specimen_bias_derivative(&filter.motion, B);
        oracle_sandwich(6, 6, B, P_b, share);
        for (unsigned i = 0; i < 36; i++)
            M[i] += 1.0001 * share[i];
    }
    to_doubles(L, motion.L, 36);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, 6, 6, 6, 1, L, L, 0, got);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-12 + 30 * eps, 0, specimen_gap(6, M, got), at);
    for (unsigned k = 0; k < 6; k++)
        if (!(M[7 * k] > 0))
            for (unsigned i = 0; i < 6; i++)
                TEST_ASSERT_TRUE_MESSAGE(motion.L[6 * i + k] == 0 && motion.L[6 * k + i] == 0, at);
}

static void test_the_factor_of_the_noise_is_one_even_where_it_is_singular(void) {
    for_each_noise(check_factor);
}

/* ---------------------------------------------------------------- opened and closed */

/* G Jr(L z), n x 6: how the noise of n enters the pose and the charts; to be freed. */
static double *entrance(void) {
    static textbook camera;
    const unsigned n = plr_covariance_dim(&filter.belief);
    double L[36], z[6], at_n[6], Jr[36], *GJ = specimen_zeros(n, 6);
    reseal(&filter);
    twin_of_specimen(&camera, &filter);
    to_doubles(L, motion.L, 36);
    to_doubles(z, motion.z, 6);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, 1, 6, 1, L, z, 0, at_n);
    rigid_right_jacobian(Jr, at_n);
    specimen_put(GJ, 6, 0, 0, 6, 6, Jr);
    for (unsigned slot = 0; slot < filter.belief.count; slot++) {
        double q[3], K[18], Jw[9], Ji[9], JK[18];
        to_doubles(q, filter.belief.slots[slot].x, 3);
        observe_camera_by_pose(&camera, q, K);
        specimen_chart(filter.belief.slots[slot].x, Jw, Ji);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 3, 1, Jw, K, 0, JK);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 6, 1, JK, Jr, 0,
                    GJ + 6 * plr_covariance_row(&filter.belief, slot));
    }
    return GJ;
}

/* P <- P + C (G J)^T + (...)^T + G J L L^T J^T G^T, where C = P_(:,b) B^T. */
static void add_motion(double *P, bool bias) {
    const unsigned n = plr_covariance_dim(&filter.belief);
    double *GJ = entrance(), *C = specimen_zeros(n, 6), *X = specimen_zeros(n, n);
    double L[36], M[36], B[36], *own = specimen_zeros(n, n);
    to_doubles(L, motion.L, 36);
    specimen_bias_derivative(&filter.motion, B);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, 6, 6, 6, 1, L, L, 0, M);
    for (unsigned i = 0; bias && i < n; i++)
        oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, 1, 6, 6, 1, P + i * n + 6, B, 0, C + 6 * i);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, n, n, 6, 1, C, GJ, 0, X);
    oracle_sandwich(n, 6, GJ, M, own);
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < n; j++)
            P[i * n + j] += X[i * n + j] + X[j * n + i] + own[i * n + j];
    free(own);
    free(X);
    free(C);
    free(GJ);
}

/* Landmarks and P along the motion that is held, without a correction. */
static void carry(plr_filter *f) {
    static const plr_real none[PLR_MAX_LD] = {0};
    TEST_ASSERT_EQUAL_UINT8(1, f->belief.held.any);
    (void)plr_model_of(&f->belief)->retract(&f->belief, &f->camera, &f->work, none);
    TEST_ASSERT_EQUAL_UINT8(0, f->belief.held.any);
}

static void check_open_and_close(noise_kind kind, bool bias, bool shifted) {
    take_specimen(kind, bias, shifted);
    const plr_motion pending = filter.motion;
    const plr_filter before = filter;
    filter.motion.noisy = 0; /* the transport alone */
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply(&filter, &motion));
    filter.motion = pending;
    double *expected = specimen_covariance(&filter);
    add_motion(expected, bias);

    filter = before;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply(&filter, &motion));
    TEST_ASSERT_EQUAL_UINT8(1, filter.work.noise.open);
    plr_real nu[6];
    TEST_ASSERT_EQUAL_INT(
        PLR_OK, plr_covariance_close_noise(&filter.belief, &filter.camera, &filter.work, nu));
    TEST_ASSERT_EQUAL_UINT8(0, filter.work.noise.open);
    carry(&filter);
    double *got = specimen_covariance(&filter);
    const unsigned n = plr_covariance_dim(&filter.belief);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-11 + 300 * eps, 0, specimen_gap(n, expected, got), at);
    for (unsigned k = 0; k < 6; k++) /* no observation: nu is what it was a priori */
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(10 * eps, 0, (double)nu[k], at);
    free(got);
    free(expected);
}

static void test_without_observations_the_noise_comes_back_into_P(void) {
    for_each_noise(check_open_and_close);
}

/* ---------------------------------------------------------------- with observations */

typedef struct joint_update {
    unsigned n, m;
    double *P, *mean; /* of the state with the noise in it: P + W W^T and dx - W z */
    double *H, *r;
} joint_update;

/* What the filter has opened, in one P. */
static joint_update take_together(const plr_observation *seen, unsigned count) {
    const unsigned n = plr_covariance_dim(&filter.belief), ld = plr_covariance_ld(&filter.belief);
    joint_update u = {n,
                      3 * count,
                      specimen_covariance(&filter),
                      specimen_zeros(n, 1),
                      specimen_zeros(3 * count, n),
                      specimen_zeros(3 * count, 1)};
    const plr_real *Wt = filter.work.noise.Wt;
    for (unsigned i = 0; i < n; i++) {
        u.mean[i] = (double)filter.work.dx[i];
        for (unsigned k = 0; k < 6; k++) {
            u.mean[i] -= (double)Wt[k * ld + i] * (double)motion.z[k];
            for (unsigned j = 0; j < n; j++)
                u.P[i * n + j] += (double)Wt[k * ld + i] * (double)Wt[k * ld + j];
        }
    }
    for (unsigned a = 0; a < count; a++) {
        const plr_measurement measured = specimen_measurement(&filter, a, &seen[a]);
        specimen_put_rows(u.H + 3 * (size_t)a * n, n, &measured.H);
        to_doubles(u.r + 3 * a, measured.r, 3);
    }
    return u;
}

/* mean += K (r - H mean), P in Joseph's form. */
static void one_gain(joint_update *u) {
    const unsigned n = u->n, m = u->m;
    double *S = specimen_zeros(m, m), *K = specimen_zeros(m, n), *I_KH = specimen_zeros(n, n);
    double *KR = specimen_zeros(n, m);
    oracle_sandwich(m, n, u->H, u->P, S);
    for (unsigned i = 0; i < m; i++)
        S[i * m + i] += (i % 3 == 2 ? 0.5 : 1) * (double)filter.camera.pixel_variance;
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, m, n, n, 1, u->H, u->P, 0, K);
    TEST_ASSERT_TRUE(oracle_solve_spd(m, n, S, K)); /* K^T */
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, m, 1, n, -1, u->H, u->mean, 1, u->r);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, n, 1, m, 1, K, u->r, 1, u->mean);
    for (unsigned i = 0; i < n; i++)
        I_KH[i * n + i] = 1;
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, n, n, m, -1, K, u->H, 1, I_KH);
    double *P = specimen_zeros(n, n);
    oracle_sandwich(n, n, I_KH, u->P, P);
    for (unsigned i = 0; i < n; i++)
        for (unsigned k = 0; k < m; k++)
            KR[i * m + k] =
                K[k * n + i] * sqrt((k % 3 == 2 ? 0.5 : 1) * (double)filter.camera.pixel_variance);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, n, n, m, 1, KR, KR, 1, P);
    memcpy(u->P, P, (size_t)n * n * sizeof *P);
    free(P);
    free(KR);
    free(I_KH);
    free(K);
    free(S);
}

/* P as the filter would retract it, had it come to the joint one. */
static void retract_joint(const plr_filter *before, const plr_real *dx, joint_update *u) {
    static plr_filter copy;
    copy = *before;
    pack_lower(copy.belief.P, u->P, u->n);
    (void)plr_model_of(&copy.belief)->retract(&copy.belief, &copy.camera, &copy.work, dx);
    unpack_symmetric(u->P, copy.belief.P, u->n);
}

/*
 * The oracle holds the noise in its P and loses digits by it: 1e-9 or so where that is huge. What the
 * filter loses is a few roundings of each standard deviation that is left, however large the noise. With
 * fewer points than tell a motion, what they leave open is still as large as the noise was, and the
 * retraction turns it. Two points tell nothing of the turn about the line through both: its information is the prior's, 1,
 * beside 1e6 and more in float32. Of 600 draws with one to three points the largest loss is 7e4 eps.
 */
static void demand_joint(noise_kind kind, unsigned count, const plr_filter *before,
                         joint_update *joint) {
    const double oracle = kind == HUGE_NOISE ? 1e-8 : 1e-12;
    const double few = kind != HUGE_NOISE || count >= 6 ? 0 : count > 3 ? 1e4 : 1e5;
    for (unsigned i = 0; i < joint->n; i++)
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE((oracle + 600 * eps) * sqrt(joint->P[i * joint->n + i]),
                                          joint->mean[i], (double)filter.work.dx[i], at);
    retract_joint(before, filter.work.dx, joint);
    double *got = specimen_covariance(&filter);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(oracle + (few + 300) * eps, 0,
                                      specimen_gap(joint->n, joint->P, got), at);
    free(got);
}

static void check_update(noise_kind kind, bool bias, bool shifted) {
    static plr_observation seen[MANY];
    static plr_measurement measured[MANY];
    static plr_filter before;
    take_specimen(kind, bias, shifted);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply(&filter, &motion));
    const unsigned count = shifted ? MANY : 1 + rng_below(&chance, MANY);
    for (unsigned slot = 0; slot < count; slot++) {
        const float u = (float)rng_normal(&chance), v = (float)rng_normal(&chance);
        const float shift[4] = {u, v, (float)(0.9 * (double)u), v};
        if (!(filter.belief.slots[slot].x[2] > 1)) /* a shift may take one beside the camera */
            filter.belief.slots[slot].x[2] = 1;
        seen[slot] = specimen_observation(&filter, slot, shift);
        TEST_ASSERT_TRUE(
            plr_stereo_measure(&filter.belief, &filter.camera, slot, &seen[slot], &measured[slot]));
    }
    joint_update joint = take_together(seen, count);
    one_gain(&joint);
    before = filter;
    const plr_correction correction = plr_correct(&filter, NULL, measured, count);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(count, correction.applied, at);
    TEST_ASSERT_EQUAL_INT_MESSAGE(PLR_OK, correction.status, at);
    TEST_ASSERT_EQUAL_UINT8_MESSAGE(0, filter.work.noise.open, at);
    demand_joint(kind, count, &before, &joint);
    free(joint.r);
    free(joint.H);
    free(joint.mean);
    free(joint.P);
}

static void test_blocks_and_the_open_noise_come_to_one_gain(void) {
    for_each_noise(check_update);
}
