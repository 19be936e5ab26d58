// SPDX-License-Identifier: MIT
/* The `world` model against differences of the true, nonlinear maps (III.1 to III.14). */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "filter/predict.h"
#include "math/packed.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/motion.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/rigid.h"
#include "support/specimens.h"
#include "support/twin.h"
#include "textbook/observe.h"

enum { RUNS = 20, LANDMARKS = 6 };

static const double eps = REAL_EPSILON;
static plr_filter filter;
static textbook truth; /* of which only the poses are used here */
static rng chance;

void setUp(void) {
    chance = rng_seeded(45);
}

static void take_specimen(bool bias, unsigned landmarks) {
    specimen_filter(&filter, &chance, PLR_MODEL_WORLD, bias, landmarks);
    twin_of_specimen(&truth, &filter);
}

/* z of the point m if the body is off by xi. */
static void seen_from(const double xi[6], const double m[3], double z[3]) {
    double E[16], T[16], inverse[16], q[3], unused[9];
    rigid_exp(E, xi);
    square_multiply(4, truth.T_WB, E, T);
    rigid_inverse(inverse, T);
    rigid_apply(q, inverse, m);
    rigid_apply(q, truth.T_CB, q);
    observe_project3(&truth.camera, q, z, unused);
}

static void check_column(double ends[2][3], double h, const plr_real *H, unsigned ld) {
    for (unsigned i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-4 + 3e4 * eps, (ends[0][i] - ends[1][i]) / (2 * h),
                                  (double)H[i * ld]);
}

static void test_observation_agrees_with_differences(void) {
    static const double none[6] = {0};
    const double h = 1e-6;
    for (int run = 0; run < RUNS; run++) {
        take_specimen(false, LANDMARKS);
        for (unsigned slot = 0; slot < LANDMARKS; slot++) {
            const plr_observation corner = {0};
            const plr_measurement lin = specimen_measurement(&filter, slot, &corner);
            plr_real predicted[3];
            double m[3], z[3], got[3], ends[2][3];
            TEST_ASSERT_EQUAL_UINT(2, lin.H.terms);
            to_doubles(m, filter.belief.slots[slot].x, 3);
            seen_from(none, m, z);
            specimen_prediction(&filter, slot, predicted);
            to_doubles(got, predicted, 3);
            /* 20 m of world coordinates rounded, at fx / 2 m */
            TEST_ASSERT_DOUBLE_WITHIN(3e4 * eps, 0, largest_difference(z, got, 3));
            for (int j = 0; j < 6; j++) {
                double xi[6] = {0};
                xi[j] = h;
                seen_from(xi, m, ends[0]);
                xi[j] = -h;
                seen_from(xi, m, ends[1]);
                check_column(ends, h, lin.H.term[1].H + j, 6);
            }
            for (int j = 0; j < 3; j++) {
                double moved[3];
                memcpy(moved, m, sizeof m);
                moved[j] += h;
                seen_from(none, moved, ends[0]);
                moved[j] -= 2 * h;
                seen_from(none, moved, ends[1]);
                check_column(ends, h, lin.H.term[0].H + j, 3);
            }
        }
    }
}

static void test_a_point_nearer_than_min_depth_is_not_linearised(void) {
    plr_view view;
    double T_BC[16];
    take_specimen(false, 1);
    rigid_inverse(T_BC, truth.T_CB);
    const double depths_m[] = {0.29, 0, -5};
    for (unsigned i = 0; i < sizeof depths_m / sizeof *depths_m; i++) {
        double m[3] = {0, 0, depths_m[i]};
        rigid_apply(m, T_BC, m);
        rigid_apply(m, truth.T_WB, m);
        to_reals(filter.belief.slots[0].x, m, 3);
        TEST_ASSERT_FALSE(
            plr_model_of(&filter.belief)->look(&filter.belief, &filter.camera, 0, &view));
    }
}

/* Where a camera point lies in the world if the body is off by xi. */
static void place_from(const double xi[6], const double q[3], double m[3]) {
    double E[16], T[16], T_BC[16];
    rigid_exp(E, xi);
    square_multiply(4, truth.T_WB, E, T);
    rigid_inverse(T_BC, truth.T_CB);
    rigid_apply(m, T_BC, q);
    rigid_apply(m, T, m);
}

static void test_a_new_landmark_copies_the_pose_through_its_jacobian(void) {
    static const double none[6] = {0};
    const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, h = 1e-6;
    take_specimen(false, 0);
    for (int run = 0; run < RUNS; run++) {
        plr_new_landmark landmark;
        plr_real q_real[3], S[9];
        double q[3], m[3], got[3], s[9], R_WC[9], RS[9], expected[9], P[9];
        rng_normals(&chance, 8, q, 3);
        to_reals(q_real, q, 3);
        to_doubles(q, q_real, 3);
        rng_normals(&chance, 0.3, s, 9);
        to_reals(S, s, 9);
        to_doubles(s, S, 9);
        plr_model_of(&filter.belief)
            ->initialise(&filter.belief, &filter.camera, q_real, S, &landmark);

        place_from(none, q, m);
        to_doubles(got, landmark.x, 3);
        TEST_ASSERT_DOUBLE_WITHIN(300 * eps, 0, largest_difference(m, got, 3));
        TEST_ASSERT_TRUE(landmark.uses_pose);
        for (int j = 0; j < 6; j++) {
            double xi[6] = {0}, ends[2][3];
            xi[j] = h;
            place_from(xi, q, ends[0]);
            xi[j] = -h;
            place_from(xi, q, ends[1]);
            for (int i = 0; i < 3; i++)
                TEST_ASSERT_DOUBLE_WITHIN(1e-7 + 300 * eps, (ends[0][i] - ends[1][i]) / (2 * h),
                                          (double)landmark.J_pose[6 * i + j]);
        }
        observe_camera_to_world(&truth, R_WC);
        square_multiply(3, R_WC, s, RS);
        oracle_sandwich(3, 3, RS, identity, expected);
        to_doubles(P, landmark.P, 9);
        TEST_ASSERT_DOUBLE_WITHIN(50 * eps, 0, specimen_gap(3, expected, P));
    }
}

/* The report's Sigma_m: S_q alone, turned, and no correlation with anything. */
static void test_an_independent_landmark_shares_nothing_with_the_pose(void) {
    const plr_real q[3] = {PLR_R(0.5), PLR_R(-0.25), PLR_R(8)};
    const plr_real S[9] = {PLR_R(1.4), 0, 0, 0, PLR_R(1.4), 0, 0, 0, PLR_R(1.4)};
    take_specimen(true, LANDMARKS);
    filter.camera.landmark_prior = PLR_PRIOR_INDEPENDENT;
    plr_new_landmark landmark;
    plr_model_of(&filter.belief)->initialise(&filter.belief, &filter.camera, q, S, &landmark);
    TEST_ASSERT_FALSE(landmark.uses_pose);
    plr_covariance_append(&filter.belief, &landmark);
    const unsigned row = plr_covariance_dim(&filter.belief);
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j <= row + i; j++)
            TEST_ASSERT_DOUBLE_WITHIN(16 * eps, j == row + i ? 1.96 : 0,
                                      (double)filter.belief.P[plr_packed_at(row + i, j)]);
}

static void test_a_known_landmark_enters_as_it_is(void) {
    plr_landmark known = {.p_W_m = {1, -2, 3}, .P_W_m2 = {4, 1, 0, 1, 5, 2, 0, 2, 6}};
    plr_new_landmark landmark;
    take_specimen(false, 0);
    TEST_ASSERT_TRUE(
        plr_model_of(&filter.belief)
            ->adopt(&filter.belief, &filter.camera, &filter.motion, &known, &landmark));
    TEST_ASSERT_FALSE(landmark.uses_pose);
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(0, known.p_W_m[i], (double)landmark.x[i]);
    for (int i = 0; i < 9; i++)
        TEST_ASSERT_DOUBLE_WITHIN(0, known.P_W_m2[i], (double)landmark.P[i]);
}

static void test_motion_moves_no_landmark_and_no_landmark_block(void) {
    take_specimen(true, LANDMARKS);
    plr_slot before[LANDMARKS];
    memcpy(before, filter.belief.slots, sizeof before);
    double *P = specimen_covariance(&filter);
    const unsigned n = plr_covariance_dim(&filter.belief);
    specimen_motion(&filter, &chance, &filter.motion);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_prior(&filter));
    TEST_ASSERT_EQUAL_MEMORY(before, filter.belief.slots, sizeof before);
    double *after = specimen_covariance(&filter);
    for (unsigned i = 12; i < n; i++)
        for (unsigned j = 12; j < n; j++)
            TEST_ASSERT_DOUBLE_WITHIN(0, P[i * n + j], after[i * n + j]);
    TEST_ASSERT_GREATER_THAN_DOUBLE(1e-4, largest_difference(P, after, 36)); /* the pose's moved */
    free(after);
    free(P);
}

static void test_retraction_adds_to_landmarks_and_leaves_P_alone(void) {
    take_specimen(true, LANDMARKS);
    const unsigned n = plr_covariance_dim(&filter.belief);
    plr_real dx[12 + 3 * LANDMARKS];
    double same[12 + 3 * LANDMARKS], before[3 * LANDMARKS], after[3];
    rng_normals(&chance, 0.1, same, n);
    to_reals(dx, same, n);
    for (unsigned slot = 0; slot < LANDMARKS; slot++)
        to_doubles(before + 3 * slot, filter.belief.slots[slot].x, 3);
    double *P = specimen_covariance(&filter);
    TEST_ASSERT_EQUAL_UINT(
        0, plr_model_of(&filter.belief)->retract(&filter.belief, &filter.camera, &filter.work, dx));
    for (unsigned slot = 0; slot < LANDMARKS; slot++) {
        to_doubles(after, filter.belief.slots[slot].x, 3);
        for (unsigned i = 0; i < 3; i++)
            TEST_ASSERT_DOUBLE_WITHIN(100 * eps, before[3 * slot + i] + same[12 + 3 * slot + i],
                                      after[i]);
    }
    double *P_after = specimen_covariance(&filter);
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, largest_difference(P, P_after, n * n));
    free(P_after);
    free(P);
}

static void test_place_in_the_world_is_the_landmark_itself(void) {
    take_specimen(false, LANDMARKS);
    for (unsigned slot = 0; slot < LANDMARKS; slot++) {
        plr_world_point point;
        double m[3];
        plr_model_of(&filter.belief)
            ->in_world(&filter.belief, &filter.camera, &filter.motion, &filter.belief.slots[slot],
                       &point);
        to_doubles(m, filter.belief.slots[slot].x, 3);
        TEST_ASSERT_DOUBLE_WITHIN(0, 0, largest_difference(m, point.p_W, 3));
        TEST_ASSERT_EQUAL_UINT(1, point.J.terms); /* the pose's error has no part in it */
        for (int i = 0; i < 9; i++)
            TEST_ASSERT_DOUBLE_WITHIN(0, i % 4 == 0, (double)point.J.term[0].H[i]);
    }
}
