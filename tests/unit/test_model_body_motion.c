// SPDX-License-Identifier: MIT
/* The `body` model in motion: propagation against differences of the true map (MATH 6), the
 * retraction and its transport against their formulas in double (11). */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "filter/predict.h"
#include "math/packed.h"
#include "process/process.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/motion.h"
#include "state/pose.h"
#include "support/held_step.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/rigid.h"
#include "support/specimens.h"
#include "support/twin.h"
#include "textbook/body.h"
#include "textbook/observe.h"

enum { RUNS = 20, LANDMARKS = 6, STEPS = 5 };

static const double eps = REAL_EPSILON;
static plr_filter filter;
static textbook truth; /* of which only the poses are used here: T_WB, T_CB and Ad_CB in double */
static rng chance;

void setUp(void) {
    chance = rng_seeded(44);
}

static void take_specimen(bool bias, unsigned landmarks) {
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, bias, landmarks);
    twin_of_specimen(&truth, &filter);
}

static void point_of(unsigned slot, double q[3]) {
    to_doubles(q, filter.belief.slots[slot].x, 3);
}

/* ---------------------------------------------------------------- propagate */

/* The twists of a few steps, and what the filter's estimate makes of them. */
static struct {
    double seconds[STEPS];
    double twist[STEPS][6];
    double bias[6];
    double estimate[16]; /* D */
} drive;

/* D = prod Exp(tau (u - b - db)) */
static void displacement(const double db[6], double D[16]) {
    rigid_exp(D, (const double[6]){0});
    for (int k = 0; k < STEPS; k++) {
        double xi[6], step[16], next[16];
        for (int i = 0; i < 6; i++)
            xi[i] = drive.seconds[k] * (drive.twist[k][i] - drive.bias[i] - db[i]);
        rigid_exp(step, xi);
        square_multiply(4, D, step, next);
        memcpy(D, next, sizeof next);
    }
}

static void drive_filter(void) {
    for (int k = 0; k < STEPS; k++) {
        plr_real reading[6];
        rng_normals(&chance, 1.5, drive.twist[k], 3);
        rng_normals(&chance, 0.5, drive.twist[k] + 3, 3);
        to_reals(reading, drive.twist[k], 6);
        to_doubles(drive.twist[k], reading, 6);
        drive.seconds[k] = (double)PLR_R(0.02);
        held_step(&plr_process_twist, &filter, filter.belief.t_ns + 20000000, reading, PLR_R(0.02),
                  PLR_R(0.02));
    }
    to_doubles(drive.bias, filter.belief.bias, 6);
    displacement((const double[6]){0}, drive.estimate);
}

/* Errors after the drive of errors before it: (xi, db, e_1, e_2, ...), e the error of q. */
static void carry(const double *before, double (*q)[3], unsigned landmarks, double *after) {
    static const double none[6] = {0};
    const double *db = filter.config.bias ? before + 6 : none;
    double D[16], back[16], E[16], ED[16], difference[16];
    displacement(db, D);
    rigid_inverse(back, drive.estimate);
    rigid_exp(E, before);
    square_multiply(4, E, D, ED);
    square_multiply(4, back, ED, difference);
    rigid_vee(after, difference);
    if (filter.config.bias)
        memcpy(after + 6, before + 6, 6 * sizeof *after);

    double T_BC[16], CD[16], D_C[16], inverse[16], CD_hat[16], D_hat[16], inverse_hat[16];
    rigid_inverse(T_BC, truth.T_CB);
    square_multiply(4, truth.T_CB, D, CD);
    square_multiply(4, CD, T_BC, D_C);
    rigid_inverse(inverse, D_C);
    square_multiply(4, truth.T_CB, drive.estimate, CD_hat);
    square_multiply(4, CD_hat, T_BC, D_hat);
    rigid_inverse(inverse_hat, D_hat);
    const unsigned first = textbook_row(&truth, 0);
    for (unsigned s = 0; s < landmarks; s++) {
        double q_true[3], q_hat[3];
        for (int i = 0; i < 3; i++)
            q_true[i] = q[s][i] + before[first + 3 * s + (unsigned)i];
        rigid_apply(q_true, inverse, q_true);
        rigid_apply(q_hat, inverse_hat, q[s]);
        for (int i = 0; i < 3; i++)
            after[first + 3 * s + (unsigned)i] = q_true[i] - q_hat[i];
    }
}

/* F = d carry / d errors by central differences, n x n; to be freed. */
static double *carry_jacobian(double (*q)[3], unsigned landmarks) {
    const unsigned n = plr_covariance_dim(&filter.belief);
    const double h = 1e-5;
    double *F = specimen_zeros(n, n), *x = specimen_zeros(n, 1);
    double *ahead = specimen_zeros(n, 1), *behind = specimen_zeros(n, 1);
    for (unsigned j = 0; j < n; j++) {
        x[j] = h;
        carry(x, q, landmarks, ahead);
        x[j] = -h;
        carry(x, q, landmarks, behind);
        x[j] = 0;
        for (unsigned i = 0; i < n; i++)
            F[i * n + j] = (ahead[i] - behind[i]) / (2 * h);
    }
    free(behind);
    free(ahead);
    free(x);
    return F;
}

/* diag(I, J_0, J_1, ...), n x n, J = Jw or Ji of each slot's chart; to be freed. */
static double *charts(bool from_point) {
    const unsigned n = plr_covariance_dim(&filter.belief);
    double *J = specimen_zeros(n, n);
    for (unsigned i = 0; i < plr_covariance_row(&filter.belief, 0); i++)
        J[i * n + i] = 1;
    for (unsigned slot = 0; slot < filter.belief.count; slot++) {
        const unsigned row = plr_covariance_row(&filter.belief, slot);
        double Jw[9], Ji[9];
        specimen_chart(filter.belief.slots[slot].x, Jw, Ji);
        specimen_put(J, n, row, row, 3, 3, from_point ? Jw : Ji);
    }
    return J;
}

/* A ten-thousandth of what the biases make of the motion is charged as noise besides: 1e-4 F_b P_bb F_b^T
 * in all rows but the biases' own. */
static void add_share_of_bias(const double *F, const double *P, double *moved) {
    const unsigned n = plr_covariance_dim(&filter.belief);
    double *F_b = specimen_zeros(n, 6), *share = specimen_zeros(n, n), P_b[36];
    for (unsigned i = 0; i < n; i++)
        for (unsigned k = 0; k < 6; k++)
            F_b[6 * i + k] = i >= 6 && i < 12 ? 0 : F[i * n + 6 + k];
    for (unsigned i = 0; i < 36; i++)
        P_b[i] = P[(6 + i / 6) * n + 6 + i % 6];
    oracle_sandwich(n, 6, F_b, P_b, share);
    for (unsigned i = 0; i < n * n; i++)
        moved[i] += 1e-4 * share[i];
    free(share);
    free(F_b);
}

static void check_propagate(bool bias) {
    take_specimen(bias, LANDMARKS);
    memset(filter.source.velocity_variance, 0, sizeof filter.source.velocity_variance);
    memset(filter.source.gyro_variance, 0,
           sizeof filter.source.gyro_variance); /* tests of motion.c */
    filter.source.bias_velocity_walk = filter.source.bias_gyro_walk = 0;
    const unsigned n = plr_covariance_dim(&filter.belief);
    double q[LANDMARKS][3];
    for (unsigned slot = 0; slot < LANDMARKS; slot++)
        point_of(slot, q[slot]);
    double *P = specimen_covariance(&filter), *Ji = charts(false);
    drive_filter();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_prior(&filter));
    TEST_ASSERT_EQUAL_UINT(LANDMARKS, filter.belief.count);

    double *F = carry_jacobian(q, LANDMARKS), *Jw = charts(true);
    double *point = specimen_zeros(n, n), *moved = specimen_zeros(n, n);
    double *expected = specimen_zeros(n, n), *got = specimen_covariance(&filter);
    oracle_sandwich(n, n, Ji, P, point);
    oracle_sandwich(n, n, F, point, moved);
    if (bias)
        add_share_of_bias(F, P, moved);
    oracle_sandwich(n, n, Jw, moved, expected);
    /* 1e-8: differences; in units of eps: five accumulated steps and the charts at both ends */
    TEST_ASSERT_DOUBLE_WITHIN(1e-7 + 1000 * eps, 0, specimen_gap(n, expected, got));
    free(got);
    free(expected);
    free(moved);
    free(point);
    free(Jw);
    free(F);
    free(Ji);
    free(P);
}

static void test_propagation_agrees_with_differences(void) {
    for (int run = 0; run < RUNS; run++)
        check_propagate(run % 2);
}

static void test_propagation_moves_the_points_rigidly(void) {
    for (int run = 0; run < RUNS; run++) {
        double q[LANDMARKS][3], after[12 + 3 * LANDMARKS], zero[12 + 3 * LANDMARKS] = {0};
        take_specimen(true, LANDMARKS);
        for (unsigned slot = 0; slot < LANDMARKS; slot++)
            point_of(slot, q[slot]);
        drive_filter();
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_prior(&filter));
        carry(zero, q, LANDMARKS, after);
        double T_BC[16], CD[16], D_C[16], inverse[16];
        rigid_inverse(T_BC, truth.T_CB);
        square_multiply(4, truth.T_CB, drive.estimate, CD);
        square_multiply(4, CD, T_BC, D_C);
        rigid_inverse(inverse, D_C);
        for (unsigned slot = 0; slot < LANDMARKS; slot++) {
            double expected[3], got[3];
            rigid_apply(expected, inverse, q[slot]);
            point_of(slot, got);
            TEST_ASSERT_DOUBLE_WITHIN(300 * eps, 0, largest_difference(expected, got, 3));
        }
    }
}

/* A landmark that the camera runs into has no bearing: it is kept a centimetre off, and what is said of
 * the others is what it would be without it. */
static void test_a_landmark_that_the_camera_meets_is_kept_off_it(void) {
    static plr_filter without;
    take_specimen(true, LANDMARKS);
    without = filter;
    plr_covariance_remove(&without.belief, LANDMARKS - 1);
    without.belief.count--;

    plr_filter before = filter;
    drive_filter();
    const plr_motion motion = filter.motion;
    filter = before;
    filter.motion = without.motion = motion;
    double T_BC[16], CD[16], D_C[16], q[3];
    rigid_inverse(T_BC, truth.T_CB);
    square_multiply(4, truth.T_CB, drive.estimate, CD);
    square_multiply(4, CD, T_BC, D_C);
    for (int i = 0; i < 3; i++) /* where the camera will be */
        filter.belief.slots[LANDMARKS - 1].x[i] = (plr_real)D_C[4 * i + 3];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_prior(&filter));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_prior(&without));
    TEST_ASSERT_EQUAL_UINT(LANDMARKS, filter.belief.count);
    point_of(LANDMARKS - 1, q);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.01, sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]));
    TEST_ASSERT_TRUE(plr_covariance_is_positive(&filter.belief));
    const unsigned n = plr_covariance_dim(&without.belief);
    TEST_ASSERT_TRUE(same_bits(without.belief.P, filter.belief.P, n * (n + 1) / 2));
}

/* ---------------------------------------------------------------- retract */

/* A correction of a size that an update makes: centimetres, milliradians, a tenth of the range. */
static void random_correction(plr_real *dx, double *same) {
    const unsigned n = plr_covariance_dim(&filter.belief),
                   first = plr_covariance_row(&filter.belief, 0);
    rng_normals(&chance, 0.05, same, 3);
    rng_normals(&chance, 0.02, same + 3, 3);
    for (unsigned i = 6; i < n; i++)
        same[i] = i < first || (i - first) % 3 < 2 ? 0.01 * rng_normal(&chance)
                                                   : 0.003 * rng_normal(&chance);
    to_reals(dx, same, n);
    to_doubles(same, dx, n);
}

/* Points and transport of the retraction in double, in point errors (textbook/body.h):
 * q[i] becomes q+, and T (n x n) what P is multiplied by. */
static void retract_twin(const double *dx, double (*q)[3], double *T) {
    const unsigned n = plr_covariance_dim(&filter.belief);
    double eta[6], eta_C[6], E[16], back[16], R_back[9], pose[16], pose_back[16], A[36];
    double e[LANDMARKS][3];
    body_fit fit = {.A = {0}};
    for (unsigned slot = 0; slot < filter.belief.count; slot++) {
        double Jw[9], Ji[9];
        specimen_chart(filter.belief.slots[slot].x, Jw, Ji);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 3, 1, Ji,
                    dx + plr_covariance_row(&filter.belief, slot), 0, e[slot]);
        body_fit_add(&truth, &fit, q[slot], e[slot]);
    }
    body_fit_solve(&truth, &fit, dx, eta);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, 1, 6, 1, truth.Ad_CB, eta, 0, eta_C);
    rigid_exp(E, eta_C);
    rigid_inverse(back, E);
    rigid_rotation(R_back, back);
    rigid_exp(pose, dx);
    rigid_inverse(pose_back, pose);
    rigid_adjoint(A, pose_back);
    for (unsigned i = 0; i < plr_covariance_row(&filter.belief, 0); i++)
        T[i * n + i] = 1;
    specimen_put(T, n, 0, 0, 6, 6, A);
    for (unsigned slot = 0; slot < filter.belief.count; slot++) {
        const unsigned row = plr_covariance_row(&filter.belief, slot);
        double moved[3], J[9], JR[9];
        body_along(&truth, eta, back, q[slot], e[slot]);
        body_polar_step(q[slot], e[slot], moved, J);
        square_multiply(3, J, R_back, JR);
        specimen_put(T, n, row, row, 3, 3, JR);
        memcpy(q[slot], moved, sizeof moved);
    }
}

/* As if a motion had been applied, of which each number is uncertain by so much, squared. */
static void allow_common_motion(double spread) {
    for (int k = 0; k < 6; k++) {
        filter.work.noise.motion_variance[k] = (plr_real)spread;
        truth.motion_variance[k] = (double)filter.work.noise.motion_variance[k];
    }
}

static void check_retract(bool bias) {
    take_specimen(bias, LANDMARKS);
    const unsigned n = plr_covariance_dim(&filter.belief);
    plr_real dx[12 + 3 * LANDMARKS];
    double same[12 + 3 * LANDMARKS], q[LANDMARKS][3];
    double *T = specimen_zeros(n, n), *P = specimen_covariance(&filter), *Ji = charts(false);
    double *point = specimen_zeros(n, n), *moved = specimen_zeros(n, n);
    double *expected = specimen_zeros(n, n);
    for (unsigned slot = 0; slot < LANDMARKS; slot++)
        point_of(slot, q[slot]);
    random_correction(dx, same);
    allow_common_motion(1e-4);
    retract_twin(same, q, T);
    TEST_ASSERT_EQUAL_UINT(
        0, plr_model_of(&filter.belief)->retract(&filter.belief, &filter.camera, &filter.work, dx));
    for (unsigned slot = 0; slot < LANDMARKS; slot++) {
        double got[3];
        point_of(slot, got);
        TEST_ASSERT_DOUBLE_WITHIN(500 * eps, 0, largest_difference(q[slot], got, 3));
    }
    double *Jw = charts(true), *got = specimen_covariance(&filter);
    oracle_sandwich(n, n, Ji, P, point);
    oracle_sandwich(n, n, T, point, moved);
    oracle_sandwich(n, n, Jw, moved, expected);
    TEST_ASSERT_DOUBLE_WITHIN(500 * eps, 0, specimen_gap(n, expected, got));
    free(got);
    free(Jw);
    free(expected);
    free(moved);
    free(point);
    free(Ji);
    free(P);
    free(T);
}

static void test_retraction_and_its_transport_agree(void) {
    for (int run = 0; run < RUNS; run++)
        check_retract(run % 2);
}

/* If every landmark's correction is what the pose's correction does to it, nothing has moved in the
 * world: the directions that no camera can see are kept exactly. */
static void test_a_rigid_correction_moves_no_landmark_in_the_world(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_real dx[12 + 3 * LANDMARKS];
        double same[12 + 3 * LANDMARKS];
        plr_world_point before[LANDMARKS], after;
        take_specimen(run % 2, LANDMARKS);
        random_correction(dx, same);
        allow_common_motion(1e25); /* all of it may be this frame's */
        for (unsigned slot = 0; slot < LANDMARKS; slot++) {
            double q[3], K[18], e[3], w[3], Jw[9], Ji[9];
            plr_model_of(&filter.belief)
                ->in_world(&filter.belief, &filter.camera, &filter.motion,
                           &filter.belief.slots[slot], &before[slot]);
            point_of(slot, q);
            observe_camera_by_pose(&truth, q, K);
            oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 6, 1, K, same, 0, e);
            specimen_chart(filter.belief.slots[slot].x, Jw, Ji);
            oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 3, 1, Jw, e, 0, w);
            to_reals(dx + plr_covariance_row(&filter.belief, slot), w, 3);
        }
        (void)plr_model_of(&filter.belief)
            ->retract(&filter.belief, &filter.camera, &filter.work, dx);
        plr_pose_correct(&filter.belief, dx);
        for (unsigned slot = 0; slot < LANDMARKS; slot++) {
            plr_model_of(&filter.belief)
                ->in_world(&filter.belief, &filter.camera, &filter.motion,
                           &filter.belief.slots[slot], &after);
            /* w_3 is rounded as a part of 1/r: r^2 times that, with r up to 35 m */
            TEST_ASSERT_DOUBLE_WITHIN(3000 * eps, 0,
                                      largest_difference(before[slot].p_W, after.p_W, 3));
        }
    }
}

static void assert_finite_landmarks(void) {
    for (unsigned slot = 0; slot < LANDMARKS; slot++)
        for (int i = 0; i < 3; i++)
            TEST_ASSERT_TRUE(isfinite((double)filter.belief.slots[slot].x[i]));
}

static double range_of(const double q[3]) {
    return sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
}

/* The point itself can go no further than the largest range. The rest of the correction is not cut off,
 * or noise would bring every point at infinity nearer: it stays beside the point, and comes back. */
static void test_a_correction_beyond_infinity_is_kept_and_comes_back(void) {
    plr_real dx[12 + 3 * LANDMARKS] = {0};
    double q[3];
    take_specimen(false, LANDMARKS);
    for (unsigned slot = 0; slot < LANDMARKS; slot++)
        filter.belief.slots[slot].known =
            1; /* not used for a common motion: each is corrected by itself */
    plr_real *inverse_range = &dx[plr_covariance_row(&filter.belief, 1) + 2];
    point_of(1, q);
    const double before = 1 / range_of(q);
    *inverse_range = -1;
    TEST_ASSERT_EQUAL_UINT(
        0, plr_model_of(&filter.belief)->retract(&filter.belief, &filter.camera, &filter.work, dx));
    assert_finite_landmarks();
    point_of(1, q);
    TEST_ASSERT_DOUBLE_WITHIN(10, 1e5, range_of(q));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, before - 1, (double)filter.belief.slots[1].beyond);
    for (unsigned slot = 0; slot < LANDMARKS; slot++)
        if (slot != 1)
            TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.belief.slots[slot].beyond);

    *inverse_range = 1;
    TEST_ASSERT_EQUAL_UINT(
        0, plr_model_of(&filter.belief)->retract(&filter.belief, &filter.camera, &filter.work, dx));
    point_of(1, q);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, before, 1 / range_of(q));
    TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.belief.slots[1].beyond);
}

static void test_corrections_that_are_cut_are_counted(void) {
    plr_real dx[12 + 3 * LANDMARKS] = {0};
    take_specimen(false, LANDMARKS);
    dx[plr_covariance_row(&filter.belief, 1) + 2] = 1000; /* before the lens */
    TEST_ASSERT_EQUAL_UINT(
        1, plr_model_of(&filter.belief)->retract(&filter.belief, &filter.camera, &filter.work, dx));
    assert_finite_landmarks();

    memset(dx, 0, sizeof dx);
    take_specimen(false, LANDMARKS);
    dx[plr_covariance_row(&filter.belief, 4)] =
        3; /* against each other: no rigid motion does that */
    dx[plr_covariance_row(&filter.belief, 5)] = -3;
    TEST_ASSERT_EQUAL_UINT(
        2, plr_model_of(&filter.belief)->retract(&filter.belief, &filter.camera, &filter.work, dx));
    assert_finite_landmarks();
}

/* ---------------------------------------------------------------- far points */

/* Turning the camera on the spot mixes no range into a bearing, not even that of a point 3 km away
 * whose range is all but unknown. A product of Jw and Ji would: r times the rounding. */
static void test_far_points_keep_the_variance_of_their_bearing(void) {
    const plr_real far[3] = {PLR_R(1200), PLR_R(-300), PLR_R(2700)};
    const double bearing = 1e-10, inverse_range = 1e-4, turn[6] = {0, 0, 0, 0.1, -0.2, 0.15};
    double T_BC[16], D_C[16], D[16], T[16];
    take_specimen(false, 1);
    memcpy(filter.belief.slots[0].x, far, sizeof far);
    memset(filter.belief.P, 0, 45 * sizeof *filter.belief.P);
    filter.belief.P[plr_packed_at(6, 6)] = filter.belief.P[plr_packed_at(7, 7)] = (plr_real)bearing;
    filter.belief.P[plr_packed_at(8, 8)] = (plr_real)inverse_range;
    rigid_exp(D_C, turn);
    rigid_inverse(T_BC, truth.T_CB);
    square_multiply(4, T_BC, D_C, T);
    square_multiply(4, T, truth.T_CB, D);
    for (int i = 0; i < 3; i++) {
        filter.motion.p[i] = (plr_real)D[4 * i + 3];
        for (int j = 0; j < 3; j++)
            filter.motion.E[3 * i + j] = (plr_real)(D[4 * i + j] - (i == j));
    }
    filter.motion.pending = 1;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_prior(&filter));
    TEST_ASSERT_EQUAL_UINT(1, filter.belief.count);
    double *P = specimen_covariance(&filter);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 1, (P[6 * 9 + 6] + P[7 * 9 + 7]) / (2 * bearing));
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 1, P[8 * 9 + 8] / inverse_range);
    free(P);
}
