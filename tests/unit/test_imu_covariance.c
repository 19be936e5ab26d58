// SPDX-License-Identifier: MIT
/* A stretch of IMU readings applied to P (docs/MATH.md 19): against the joint covariance of pose,
 * velocity, biases and landmarks, dense and in double, P <- A P A^T + N Q N^T. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "filter/predict.h"
#include "process/process.h"
#include "state/covariance.h"
#include "state/model.h"
#include "support/held_step.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/pose_of.h"
#include "support/reseal.h"
#include "support/rigid.h"
#include "support/specimens.h"

enum { RUNS = 12, READINGS = 10, CORE = PLR_CORE_DIM, DRIVER = PLR_DRIVERS, MANY = 20 };
enum { THETA = 3, VELOCITY = 6, BIAS = 9 };

static const double eps = REAL_EPSILON;
static plr_filter filter;
static rng chance;

void setUp(void) {
    chance = rng_seeded(301);
}

/* A specimen that has flown through some readings since its last frame. */
static void take_specimen(unsigned landmarks, bool noiseless) {
    specimen_imu(&filter, &chance, landmarks);
    for (unsigned k = 0; k < READINGS; k++) {
        double reading[6];
        plr_real held[6];
        rng_normals(&chance, 4, reading, 3);
        rng_normals(&chance, 0.5, reading + 3, 3);
        for (unsigned i = 0; i < 3; i++) /* about what a hovering body feels */
            reading[i] += 9.81 * (double)filter.belief.R_WB[6 + i];
        to_reals(held, reading, 6);
        held_step(&plr_process_imu, &filter, filter.belief.t_ns + 10000000, held, PLR_R(0.01),
                  PLR_R(0.01));
    }
    if (noiseless) {
        memset(filter.motion.Q, 0, sizeof filter.motion.Q);
        memset(filter.motion.core.Q_nc, 0, sizeof filter.motion.core.Q_nc);
        memset(filter.motion.core.Q_cc, 0, sizeof filter.motion.core.Q_cc);
    }
    reseal(&filter);
}

/* ---------------------------------------------------------------- the oracle */

/* D of the stretch, 4x4. */
static void relative_motion(double D[16]) {
    memset(D, 0, 16 * sizeof *D);
    for (int i = 0; i < 3; i++) {
        D[4 * i + 3] = (double)filter.motion.p[i];
        for (int j = 0; j < 3; j++)
            D[4 * i + j] = (double)filter.motion.E[3 * i + j] + (i == j);
    }
    D[15] = 1;
}

/* The core's own rows: theta and v by all drivers, biases as they are. */
static void core_rows(const double D[16], const double B[6 * DRIVER], double *A, unsigned n) {
    double V[3 * DRIVER], back[16], Ad[36];
    to_doubles(V, filter.motion.core.V, 3 * DRIVER);
    rigid_inverse(back, D);
    rigid_adjoint(Ad, back);
    for (unsigned i = 0; i < 6; i++) {
        for (unsigned j = 0; j < DRIVER; j++)
            A[n * i + THETA + j] = B[DRIVER * i + j];
        for (unsigned j = 0; j < 6; j++)
            A[n * i + j] += Ad[6 * i + j];
    }
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < DRIVER; j++)
            A[n * (VELOCITY + i) + THETA + j] = V[DRIVER * i + j];
    for (unsigned i = BIAS; i < CORE; i++)
        A[n * i + i] = 1;
}

/* dq+ / dn = -[I | -[q+]x] Ad(T_CB), 3x6. */
static void point_by_twist(const double q[3], const double T_CB[16], double K[18]) {
    const double M[18] = {-1,   0, 0,     0, -q[2], q[1], 0,     -1,   0,
                          q[2], 0, -q[0], 0, 0,     -1,   -q[1], q[0], 0};
    double Ad[36];
    rigid_adjoint(Ad, T_CB);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 6, 1, M, Ad, 0, K);
}

/* F, 3x3, of a landmark's own chart, and G, 3x6, by the motion's error. */
static void landmark_rows(unsigned slot, const double D[16], double F[9], double G[18]) {
    double T_CB[16], T_BC[16], X[16], D_C[16], back[16], R[9], q[3], to[3], K[18];
    double Jw[9], Ji[9], unused[9], RJ[9];
    plr_real there[3];
    memset(T_CB, 0, sizeof T_CB);
    for (int i = 0; i < 3; i++) {
        T_CB[4 * i + 3] = (double)filter.camera.given.t_CB[i];
        for (int j = 0; j < 3; j++)
            T_CB[4 * i + j] = (double)filter.camera.given.R_CB[3 * i + j];
    }
    T_CB[15] = 1;
    rigid_inverse(T_BC, T_CB);
    square_multiply(4, T_CB, D, X);
    square_multiply(4, X, T_BC, D_C);
    rigid_inverse(back, D_C);
    to_doubles(q, filter.belief.slots[slot].x, 3);
    rigid_apply(to, back, q);
    to_reals(there, to, 3);
    specimen_chart(filter.belief.slots[slot].x, unused, Ji);
    specimen_chart(there, Jw, unused);
    rigid_rotation(R, back);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 3, 3, 1, R, Ji, 0, RJ);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 3, 3, 1, Jw, RJ, 0, F);
    point_by_twist(to, T_CB, K);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 3, 1, Jw, K, 0, G);
}

/* Q of (n, v, b), 15 x 15, and with it the share of B P_dd B^T that the filter adds as noise. */
static void joint_noise(const double B[6 * DRIVER], const double *P, unsigned n, double *Q) {
    double P_dd[DRIVER * DRIVER], BPB[36];
    for (unsigned i = 0; i < CORE; i++)
        for (unsigned j = i; j < CORE; j++) {
            const double q = j < 6 ? (double)filter.motion.Q[6 * i + j]
                             : i < 6
                                 ? (double)filter.motion.core.Q_nc[PLR_REST_DIM * i + j - 6]
                                 : (double)filter.motion.core.Q_cc[PLR_REST_DIM * (i - 6) + j - 6];
            Q[CORE * i + j] = Q[CORE * j + i] = q;
        }
    for (unsigned i = 0; i < DRIVER; i++)
        for (unsigned j = 0; j < DRIVER; j++)
            P_dd[DRIVER * i + j] = P[n * (THETA + i) + THETA + j];
    oracle_sandwich(6, DRIVER, B, P_dd, BPB);
    for (unsigned i = 0; i < 6; i++)
        for (unsigned j = 0; j < 6; j++)
            Q[CORE * i + j] += 1e-4 * BPB[6 * i + j];
}

/* P after the stretch; to be freed. */
static double *expected_covariance(void) {
    const unsigned n = plr_covariance_dim(&filter.belief);
    double *P = specimen_covariance(&filter), *A = specimen_zeros(n, n);
    double *N = specimen_zeros(n, CORE), *own = specimen_zeros(n, n);
    double D[16], B[6 * DRIVER], Q[CORE * CORE];
    relative_motion(D);
    to_doubles(B, filter.motion.B, 6 * DRIVER);
    core_rows(D, B, A, n);
    for (unsigned i = 0; i < CORE; i++)
        N[(CORE + 1) * i] = 1;
    for (unsigned slot = 0; slot < filter.belief.count; slot++) {
        const unsigned row = plr_covariance_row(&filter.belief, slot);
        double F[9], G[18], GB[3 * DRIVER];
        landmark_rows(slot, D, F, G);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, DRIVER, 6, 1, G, B, 0, GB);
        specimen_put(A, n, row, row, 3, 3, F);
        specimen_put(A, n, row, THETA, 3, DRIVER, GB);
        specimen_put(N, CORE, row, 0, 3, 6, G);
    }
    joint_noise(B, P, n, Q);
    oracle_sandwich(n, CORE, N, Q, own);
    double *expected = specimen_zeros(n, n);
    oracle_sandwich(n, n, A, P, expected);
    for (unsigned i = 0; i < n * n; i++)
        expected[i] += own[i];
    free(own);
    free(N);
    free(A);
    free(P);
    return expected;
}

/* ---------------------------------------------------------------- tests */

static void check_stretch(unsigned landmarks, bool noiseless) {
    take_specimen(landmarks, noiseless);
    const unsigned n = plr_covariance_dim(&filter.belief);
    double *expected = expected_covariance();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_pending(&filter));
    TEST_ASSERT_EQUAL_UINT8(1, filter.work.noise.open);
    TEST_ASSERT_EQUAL_INT(
        PLR_OK, plr_covariance_close_noise(&filter.belief, &filter.camera, &filter.work, NULL));
    memset(filter.work.dx, 0, sizeof filter.work.dx); /* P goes along the motion, uncorrected */
    (void)plr_model_of(&filter.belief)
        ->retract(&filter.belief, &filter.camera, &filter.work, filter.work.dx);
    double *got = specimen_covariance(&filter);
    TEST_ASSERT_DOUBLE_WITHIN(1e-11 + 300 * eps, 0, specimen_gap(n, expected, got));
    free(got);
    free(expected);
}

static void test_a_stretch_of_readings_moves_the_joint_covariance(void) {
    for (unsigned run = 0; run < RUNS; run++)
        check_stretch(run % 3 == 0 ? 0 : 1 + rng_below(&chance, MANY), false);
}

static void test_so_it_does_where_nothing_but_the_state_drives_it(void) {
    for (unsigned run = 0; run < RUNS; run++)
        check_stretch(1 + rng_below(&chance, MANY), true);
}

/* The pose's block before it is applied is the one after, and so are those of velocity and biases. */
static void test_the_estimate_between_frames_has_the_covariance_that_the_frame_will_apply(void) {
    for (unsigned run = 0; run < RUNS; run++) {
        double P_xi[36], P_u[36], P_b[36];
        take_specimen(6, false);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&filter, P_xi));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(&filter, P_u));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&filter, (double[6]){0}, P_b));
        const unsigned n = plr_covariance_dim(&filter.belief);
        double *P = expected_covariance();
        for (unsigned i = 0; i < 6; i++)
            for (unsigned j = 0; j < 6; j++) {
                const double size = sqrt(P[(n + 1) * i] * P[(n + 1) * j]);
                TEST_ASSERT_DOUBLE_WITHIN((2e-4 + 100 * eps) * size, P[n * i + j], P_xi[6 * i + j]);
                const unsigned r = BIAS + i, c = BIAS + j;
                const double bias_size = sqrt(P[(n + 1) * r] * P[(n + 1) * c]);
                TEST_ASSERT_DOUBLE_WITHIN(100 * eps * bias_size, P[n * r + c], P_b[6 * i + j]);
            }
        for (unsigned i = 0; i < 3; i++)
            for (unsigned j = 0; j < 3; j++) {
                const unsigned v = VELOCITY + i, c = VELOCITY + j, g = BIAS + 3 + j;
                const double size = sqrt(P[(n + 1) * v] * P[(n + 1) * c]);
                const double cross = sqrt(P[(n + 1) * v] * P[(n + 1) * g]);
                TEST_ASSERT_DOUBLE_WITHIN(200 * eps * size, P[n * v + c], P_u[6 * i + j]);
                TEST_ASSERT_DOUBLE_WITHIN(200 * eps * cross, -P[n * v + g], P_u[6 * i + 3 + j]);
            }
        free(P);
    }
}

/* A pose that is set drops the motion; velocity and biases are as after it. */
static void test_a_pose_that_is_set_keeps_what_is_known_of_velocity_and_biases(void) {
    take_specimen(5, false);
    const unsigned n = plr_covariance_dim(&filter.belief);
    double *expected = expected_covariance();
    const plr_pose pose = pose_of(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&filter, filter.belief.t_ns, &pose, NULL));
    double *got = specimen_covariance(&filter);
    TEST_ASSERT_EQUAL_UINT(CORE, plr_covariance_dim(&filter.belief));
    for (unsigned i = VELOCITY; i < CORE; i++)
        for (unsigned j = VELOCITY; j < CORE; j++) {
            const double size = sqrt(expected[(n + 1) * i] * expected[(n + 1) * j]);
            TEST_ASSERT_DOUBLE_WITHIN(200 * eps * size, expected[n * i + j], got[CORE * i + j]);
        }
    free(got);
    free(expected);
}
