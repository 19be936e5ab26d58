// SPDX-License-Identifier: MIT
/* The figures against truth, on errors that are known, and the rigid motions they rest on, held
 * against power series. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "posix/alignment.h"
#include "posix/evaluation.h"
#include "posix/pose_math.h"
#include "support/matrices.h"
#include "support/random.h"
#include "support/rigid.h"

static evaluation e;
static evaluation_figures figures;

void setUp(void) {
    evaluation_init(&e);
}

void tearDown(void) {
    evaluation_free(&e);
}

static plr_pose exp_pose(const double xi[6]) {
    double M[16];
    plr_pose pose;
    rigid_exp(M, xi);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            pose.R[3 * i + j] = M[4 * i + j];
        pose.p[i] = M[4 * i + 3];
    }
    return pose;
}

static plr_pose random_pose(rng *r, double metres, double radians) {
    double xi[6];
    rng_normals(r, metres, xi, 3);
    rng_normals(r, radians, xi + 3, 3);
    return exp_pose(xi);
}

static plr_pose compose(plr_pose a, plr_pose b) {
    pose_compose(&a, &a, &b);
    return a;
}

static void add(plr_time_ns t, const plr_pose *estimate, const plr_pose *truth, const double P[6]) {
    plr_pose_message pose;
    memset(&pose, 0, sizeof pose);
    pose.t_ns = t;
    pose.T_WB = *estimate;
    for (int i = 0; i < 6; i++)
        pose.P_xi[i * (i + 3) / 2] = P[i];
    evaluation_add_estimate(&e, &pose);
    if (truth != NULL) {
        const plr_truth message = {.t_ns = t, .T_WB = *truth};
        evaluation_add_truth(&e, &message);
    }
}

static const double ONES[6] = {1, 1, 1, 1, 1, 1};

/* --- rigid motions --- */

static void test_log_undoes_exp_up_to_almost_pi(void) {
    rng r = rng_seeded(1);
    for (int n = 0; n < 300; n++) {
        double xi[6], back[6];
        rng_normals(&r, 3, xi, 3);
        rng_normals(&r, 1, xi + 3, 3);
        const double angle = sqrt(xi[3] * xi[3] + xi[4] * xi[4] + xi[5] * xi[5]);
        const double wanted = n % 3 == 0 ? 3.141 : n % 3 == 1 ? pow(10, -n / 20.0) : 1;
        for (int i = 3; i < 6; i++)
            xi[i] *= wanted / angle;
        const plr_pose pose = exp_pose(xi);
        pose_log(back, &pose);
        for (int i = 0; i < 6; i++)
            TEST_ASSERT_DOUBLE_WITHIN(1e-8, xi[i], back[i]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-8, wanted, rotation_angle(pose.R));
    }
}

static void test_quaternions_give_their_rotation_back(void) {
    rng r = rng_seeded(2);
    for (int n = 0; n < 500; n++) {
        double R[9], q[4], back[9];
        random_rotation(&r, R);
        rotation_quaternion(q, R);
        rotation_from_quaternion(back, q);
        TEST_ASSERT_TRUE(q[3] >= 0);
        TEST_ASSERT_TRUE(largest_difference(R, back, 9) < 1e-14);
    }
}

static void test_a_pose_and_its_inverse_are_identity(void) {
    rng r = rng_seeded(3);
    const plr_pose pose = random_pose(&r, 10, 1);
    plr_pose inverse;
    double xi[6];
    pose_inverse(&inverse, &pose);
    const plr_pose product = compose(pose, inverse);
    pose_log(xi, &product);
    for (int i = 0; i < 6; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-13, 0, xi[i]);
}

/* --- alignment --- */

static void test_a_rigid_motion_of_points_is_found_exactly(void) {
    rng r = rng_seeded(4);
    for (int n = 3; n < 40; n++) {
        double a[120], b[120];
        const plr_pose A = random_pose(&r, 100, 2);
        plr_pose found;
        rng_normals(&r, 5, b, 120);
        for (int k = 0; k < n; k++)
            for (int i = 0; i < 3; i++) {
                a[3 * k + i] = A.p[i];
                for (int j = 0; j < 3; j++)
                    a[3 * k + i] += A.R[3 * i + j] * b[3 * k + j];
            }
        alignment_fit(&found, a, b, (size_t)n);
        TEST_ASSERT_TRUE(largest_difference(A.R, found.R, 9) < 1e-9);
        TEST_ASSERT_TRUE(largest_difference(A.p, found.p, 3) < 1e-9);
    }
}

static double fit_error(const plr_pose *A, const double *a, const double *b, int n) {
    double sum = 0;
    for (int k = 0; k < n; k++)
        for (int i = 0; i < 3; i++) {
            double d = a[3 * k + i] - A->p[i];
            for (int j = 0; j < 3; j++)
                d -= A->R[3 * i + j] * b[3 * k + j];
            sum += d * d;
        }
    return sum;
}

static void test_no_small_motion_improves_the_fit_of_noisy_points(void) {
    rng r = rng_seeded(5);
    double a[60], b[60];
    plr_pose found;
    rng_normals(&r, 5, a, 60);
    rng_normals(&r, 5, b, 60);
    alignment_fit(&found, a, b, 20);
    const double least = fit_error(&found, a, b, 20);
    for (int n = 0; n < 200; n++) {
        const plr_pose moved = compose(found, random_pose(&r, 0.05, 0.05));
        TEST_ASSERT_TRUE(fit_error(&moved, a, b, 20) > least);
    }
}

static void test_points_on_a_line_and_a_single_point_are_fitted(void) {
    const double a[9] = {0, 1, 0, 0, 2, 0, 0, 3, 0}, b[9] = {1, 0, 0, 2, 0, 0, 3, 0, 0};
    plr_pose found;
    alignment_fit(&found, a, b, 3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-20, 0, fit_error(&found, a, b, 3));
    alignment_fit(&found, a, b, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-20, 0, fit_error(&found, a, b, 1));
}

/* --- figures --- */

static void test_a_perfect_estimate_in_another_world_has_no_error(void) {
    rng r = rng_seeded(6);
    const plr_pose A = random_pose(&r, 50, 2);
    for (plr_time_ns t = 0; t < 50; t++) {
        const plr_pose truth = random_pose(&r, 20, 1), estimate = compose(A, truth);
        add(t, &estimate, &truth, ONES);
    }
    evaluation_figures_of(&e, &figures);
    TEST_ASSERT_EQUAL_size_t(50, figures.frames);
    TEST_ASSERT_DOUBLE_WITHIN(1e-11, 0, figures.err0_m);
    TEST_ASSERT_DOUBLE_WITHIN(1e-11, 0, figures.ate_m);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0, figures.rot_deg);
    TEST_ASSERT_DOUBLE_WITHIN(1e-20, 0, figures.nees_per_dof);
}

/* After the first frame the estimate is off by 3 m and 0.1 rad in the body: over n frames RMS
 * 3 sqrt((n-1)/n), and e^T P^-1 e / 6 = (9/4 + 0.01/0.04) / 6. */
static void test_a_known_error_gives_known_figures(void) {
    rng r = rng_seeded(7);
    const double xi[6] = {3, 0, 0, 0, 0, 0}, turn[6] = {0, 0, 0, 0.1, 0, 0};
    const double P[6] = {4, 1, 1, 0.04, 1, 1};
    const int n = 25;
    for (plr_time_ns t = 0; t < (plr_time_ns)n; t++) {
        const plr_pose estimate = random_pose(&r, 20, 1);
        plr_pose truth = estimate;
        if (t > 0) /* along the axis of the turn, so that Log is (3, 0, 0, 0.1, 0, 0) */
            truth = compose(compose(estimate, exp_pose(xi)), exp_pose(turn));
        add(t, &estimate, &truth, P);
    }
    evaluation_figures_of(&e, &figures);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 3 * sqrt(24.0 / 25), figures.err0_m);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.1 * sqrt(24.0 / 25) * 57.29577951308232, figures.rot_deg);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 2.5 / 6, figures.nees_per_dof);
    TEST_ASSERT_TRUE(figures.ate_m > 0.1 && figures.ate_m < figures.err0_m);
}

static void test_nees_of_errors_drawn_from_P_is_one(void) {
    rng r = rng_seeded(8);
    const double P[6] = {0.04, 0.09, 0.01, 1e-4, 4e-4, 9e-4};
    plr_pose truth = random_pose(&r, 20, 1);
    add(0, &truth, &truth, P);
    for (plr_time_ns t = 1; t <= 4000; t++) {
        double xi[6];
        for (int i = 0; i < 6; i++)
            xi[i] = sqrt(P[i]) * rng_normal(&r);
        const plr_pose estimate = random_pose(&r, 20, 1);
        truth = compose(estimate, exp_pose(xi));
        add(t, &estimate, &truth, P);
    }
    evaluation_figures_of(&e, &figures);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 1, figures.nees_per_dof); /* sigma 0.009 */
}

static void test_truth_in_any_order_and_between_frames_is_matched_by_time(void) {
    rng r = rng_seeded(9);
    plr_pose poses[10];
    for (plr_time_ns t = 0; t < 10; t++) {
        poses[t] = random_pose(&r, 5, 1);
        add(10 * t, &poses[t], NULL, ONES);
    }
    for (plr_time_ns t = 10; t-- > 0;) {
        plr_truth truth = {.t_ns = 10 * t + 5, .T_WB = random_pose(&r, 5, 1)};
        evaluation_add_truth(&e, &truth);
        if (t % 2 == 0)
            continue;
        truth = (plr_truth){.t_ns = 10 * t, .T_WB = poses[t]};
        evaluation_add_truth(&e, &truth);
    }
    evaluation_figures_of(&e, &figures);
    TEST_ASSERT_EQUAL_size_t(5, figures.frames);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, figures.err0_m);
}

static void test_what_cannot_be_had_is_not_a_number(void) {
    const plr_pose identity = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    plr_truth broken = {.t_ns = 1, .T_WB = identity};
    add(1, &identity, NULL, ONES);
    broken.T_WB.p[1] = (double)NAN;
    evaluation_add_truth(&e, &broken);
    evaluation_figures_of(&e, &figures);
    TEST_ASSERT_EQUAL_size_t(0, figures.frames);
    TEST_ASSERT_TRUE(isnan(figures.err0_m) && isnan(figures.ate_m));
    TEST_ASSERT_TRUE(isnan(figures.rot_deg) && isnan(figures.nees_per_dof));
    add(2, &identity, &identity, ONES); /* a single frame has errors, and no NEES */
    evaluation_figures_of(&e, &figures);
    TEST_ASSERT_EQUAL_DOUBLE(0, figures.err0_m);
    TEST_ASSERT_TRUE(isnan(figures.nees_per_dof));
}

static void test_frames_without_a_positive_covariance_are_left_out_of_nees_and_counted(void) {
    const plr_pose identity = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    const double broken[6] = {1, 1, -1e-9, 1, 1, 1}, zeros[6] = {0};
    add(1, &identity, &identity, ONES);
    add(2, &identity, &identity, broken);
    add(3, &identity, &identity, ONES);
    add(4, &identity, &identity, zeros);
    evaluation_figures_of(&e, &figures);
    TEST_ASSERT_EQUAL_size_t(2, figures.not_positive);
    TEST_ASSERT_EQUAL_DOUBLE(0, figures.nees_per_dof);
}

/* 1 m off everywhere. A covariance of 2^40 would bring the mean down to nothing. */
static void test_frames_of_a_diverged_filter_count_for_the_error_and_not_for_nees(void) {
    const double unknown[6] = {PLR_WIRE_UNKNOWN_VARIANCE, PLR_WIRE_UNKNOWN_VARIANCE,
                               PLR_WIRE_UNKNOWN_VARIANCE, PLR_WIRE_UNKNOWN_VARIANCE,
                               PLR_WIRE_UNKNOWN_VARIANCE, PLR_WIRE_UNKNOWN_VARIANCE};
    const plr_pose identity = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    plr_pose away = identity;
    away.p[0] = 1;
    add(1, &identity, &identity, ONES);
    add(2, &away, &identity, ONES);
    for (plr_time_ns t = 3; t < 11; t++)
        add(t, &away, &identity, unknown);
    evaluation_figures_of(&e, &figures);
    TEST_ASSERT_EQUAL_size_t(10, figures.frames);
    TEST_ASSERT_EQUAL_size_t(8, figures.not_positive);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 1.0 / 6, figures.nees_per_dof);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, sqrt(0.9), figures.err0_m);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_log_undoes_exp_up_to_almost_pi);
    RUN_TEST(test_quaternions_give_their_rotation_back);
    RUN_TEST(test_a_pose_and_its_inverse_are_identity);
    RUN_TEST(test_a_rigid_motion_of_points_is_found_exactly);
    RUN_TEST(test_no_small_motion_improves_the_fit_of_noisy_points);
    RUN_TEST(test_points_on_a_line_and_a_single_point_are_fitted);
    RUN_TEST(test_a_perfect_estimate_in_another_world_has_no_error);
    RUN_TEST(test_a_known_error_gives_known_figures);
    RUN_TEST(test_nees_of_errors_drawn_from_P_is_one);
    RUN_TEST(test_truth_in_any_order_and_between_frames_is_matched_by_time);
    RUN_TEST(test_what_cannot_be_had_is_not_a_number);
    RUN_TEST(test_frames_without_a_positive_covariance_are_left_out_of_nees_and_counted);
    RUN_TEST(test_frames_of_a_diverged_filter_count_for_the_error_and_not_for_nees);
    return UNITY_END();
}
