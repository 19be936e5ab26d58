// SPDX-License-Identifier: MIT
/* The `body` model against differences of the true, nonlinear maps: observation, new and known
 * landmarks, their place in the world (MATH 7, 9, 13). */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "state/model.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/rigid.h"
#include "support/specimens.h"
#include "support/twin.h"
#include "textbook/observe.h"

enum { RUNS = 20, LANDMARKS = 6 };

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

/* ---------------------------------------------------------------- observation */

static void test_observation_agrees_with_differences(void) {
    for (int run = 0; run < RUNS; run++) {
        take_specimen(false, LANDMARKS);
        for (unsigned slot = 0; slot < LANDMARKS; slot++) {
            const plr_observation corner = {0};
            const plr_measurement lin = specimen_measurement(&filter, slot, &corner);
            plr_real predicted[3];
            double q[3], z[3], got[3], unused[9], Jw[9], Ji[9];
            TEST_ASSERT_EQUAL_UINT(1, lin.H.terms); /* the pose has no part in it */
            point_of(slot, q);
            observe_project3(&truth.camera, q, z, unused);
            specimen_prediction(&filter, slot, predicted);
            to_doubles(got, predicted, 3);
            TEST_ASSERT_DOUBLE_WITHIN(5000 * eps, 0, largest_difference(z, got, 3));
            plr_view view;
            TEST_ASSERT_TRUE(
                plr_model_of(&filter.belief)->look(&filter.belief, &filter.camera, slot, &view));
            TEST_ASSERT_DOUBLE_WITHIN(0, q[2], (double)view.q[2]);
            specimen_chart(filter.belief.slots[slot].x, Jw, Ji);
            for (int j = 0; j < 3; j++) {
                const double h = j < 2 ? 1e-6 : 1e-6 / q[2];
                double ahead[3], behind[3], z_ahead[3], z_behind[3];
                for (int i = 0; i < 3; i++) {
                    ahead[i] = q[i] + h * Ji[3 * i + j];
                    behind[i] = q[i] - h * Ji[3 * i + j];
                }
                observe_project3(&truth.camera, ahead, z_ahead, unused);
                observe_project3(&truth.camera, behind, z_behind, unused);
                /* entries: fx px/rad, and fx b px m */
                for (int i = 0; i < 3; i++)
                    TEST_ASSERT_DOUBLE_WITHIN(1e-4 + 3e4 * eps,
                                              (z_ahead[i] - z_behind[i]) / (2 * h),
                                              (double)lin.H.term[0].H[3 * i + j]);
            }
        }
    }
}

static void test_a_point_nearer_than_min_depth_is_not_linearised(void) {
    static const double depths_m[] = {0.299, 0.0, -5.0, (double)NAN};
    take_specimen(false, 1);
    plr_view view;
    for (unsigned i = 0; i < sizeof depths_m / sizeof *depths_m; i++) {
        filter.belief.slots[0].x[2] = (plr_real)depths_m[i];
        TEST_ASSERT_FALSE(
            plr_model_of(&filter.belief)->look(&filter.belief, &filter.camera, 0, &view));
    }
    filter.belief.slots[0].x[2] = PLR_R(0.301);
    TEST_ASSERT_TRUE(plr_model_of(&filter.belief)->look(&filter.belief, &filter.camera, 0, &view));
}

/* ---------------------------------------------------------------- new landmarks */

/* Jw S S^T Jw^T of a random factor. */
static void test_a_new_landmark_takes_its_covariance_through_the_chart(void) {
    take_specimen(false, LANDMARKS);
    for (unsigned slot = 0; slot < LANDMARKS; slot++) {
        plr_new_landmark landmark;
        plr_real S[9];
        double s[9], Jw[9], Ji[9], JS[9], expected[9], got[9];
        const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
        rng_normals(&chance, 0.1, s, 9);
        to_reals(S, s, 9);
        to_doubles(s, S, 9);
        plr_model_of(&filter.belief)
            ->initialise(&filter.belief, &filter.camera, filter.belief.slots[slot].x, S, &landmark);
        specimen_chart(filter.belief.slots[slot].x, Jw, Ji);
        square_multiply(3, Jw, s, JS);
        oracle_sandwich(3, 3, JS, identity, expected);
        to_doubles(got, landmark.P, 9);
        TEST_ASSERT_DOUBLE_WITHIN(50 * eps, 0, specimen_gap(3, expected, got));
        TEST_ASSERT_FALSE(landmark.uses_pose);
        TEST_ASSERT_TRUE(same_bits(filter.belief.slots[slot].x, landmark.x, 3));
    }
}

static void known_landmark(plr_landmark *known) {
    double P[9];
    memset(known, 0, sizeof *known);
    random_spd(&chance, 3, 0.1, P);
    memcpy(known->P_W_m2, P, sizeof P);
    for (int i = 0; i < 3; i++)
        known->p_W_m[i] = filter.belief.p_WB[i] + 8 * rng_normal(&chance);
}

/* Where a fixed point of the world stands in the camera if the body is off by xi. */
static void seen_from(const double xi[6], const double m[3], double q[3]) {
    double E[16], T[16], inverse[16];
    rigid_exp(E, xi);
    square_multiply(4, truth.T_WB, E, T);
    rigid_inverse(inverse, T);
    rigid_apply(q, inverse, m);
    rigid_apply(q, truth.T_CB, q);
}

static void test_a_known_landmark_hangs_on_the_pose_as_differences_say(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_landmark known;
        plr_new_landmark landmark;
        double q[3], got[3], Jw[9], Ji[9];
        take_specimen(false, 0);
        known_landmark(&known);
        TEST_ASSERT_TRUE(
            plr_model_of(&filter.belief)
                ->adopt(&filter.belief, &filter.camera, &filter.motion, &known, &landmark));
        seen_from((const double[6]){0}, known.p_W_m, q);
        to_doubles(got, landmark.x, 3);
        TEST_ASSERT_DOUBLE_WITHIN(300 * eps, 0, largest_difference(q, got, 3));
        TEST_ASSERT_TRUE(landmark.uses_pose);
        specimen_chart(landmark.x, Jw, Ji);
        const double r = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
        for (int j = 0; j < 6; j++) {
            const double h = 1e-6;
            double xi[6] = {0}, ahead[3], behind[3];
            xi[j] = h;
            seen_from(xi, known.p_W_m, ahead);
            xi[j] = -h;
            seen_from(xi, known.p_W_m, behind);
            for (int i = 0; i < 3; i++) {
                double w = 0;
                for (int k = 0; k < 3; k++)
                    w += Jw[3 * i + k] * (ahead[k] - behind[k]) / (2 * h);
                const double size = (i < 2 ? 1 : 1 / r) * (1 + 1 / r);
                TEST_ASSERT_DOUBLE_WITHIN(size * (1e-7 + 300 * eps), w,
                                          (double)landmark.J_pose[6 * i + j]);
            }
        }
        double R_WC[9], R_CW[9], J[9], expected[9], P[9];
        observe_camera_to_world(&truth, R_WC);
        for (int i = 0; i < 9; i++)
            R_CW[i] = R_WC[3 * (i % 3) + i / 3];
        square_multiply(3, Jw, R_CW, J);
        oracle_sandwich(3, 3, J, known.P_W_m2, expected);
        to_doubles(P, landmark.P, 9);
        TEST_ASSERT_DOUBLE_WITHIN(100 * eps, 0, specimen_gap(3, expected, P));
    }
}

static void test_a_known_landmark_on_the_camera_or_out_of_range_is_refused(void) {
    plr_landmark known;
    plr_new_landmark landmark;
    double T_BC[16], centre[3];
    take_specimen(false, 0);
    known_landmark(&known);
    rigid_inverse(T_BC, truth.T_CB);
    rigid_apply(centre, T_BC, (const double[3]){0});
    rigid_apply(known.p_W_m, truth.T_WB, centre);
    TEST_ASSERT_FALSE(
        plr_model_of(&filter.belief)
            ->adopt(&filter.belief, &filter.camera, &filter.motion, &known, &landmark));
    known.p_W_m[0] += 0.5;
    TEST_ASSERT_TRUE(
        plr_model_of(&filter.belief)
            ->adopt(&filter.belief, &filter.camera, &filter.motion, &known, &landmark));
    known.p_W_m[0] += 99990;
    TEST_ASSERT_TRUE(
        plr_model_of(&filter.belief)
            ->adopt(&filter.belief, &filter.camera, &filter.motion, &known, &landmark));
    known.p_W_m[0] += 20; /* max-range is 100 km */
    TEST_ASSERT_FALSE(
        plr_model_of(&filter.belief)
            ->adopt(&filter.belief, &filter.camera, &filter.motion, &known, &landmark));
    known.p_W_m[0] = 1e300;
    TEST_ASSERT_FALSE(
        plr_model_of(&filter.belief)
            ->adopt(&filter.belief, &filter.camera, &filter.motion, &known, &landmark));
}

/* ---------------------------------------------------------------- in the world */

static void test_place_in_the_world_agrees_with_differences(void) {
    for (int run = 0; run < RUNS; run++) {
        take_specimen(false, LANDMARKS);
        for (unsigned slot = 0; slot < LANDMARKS; slot++) {
            plr_world_point point;
            double q[3], s[3], m[3], T_BC[16], Jw[9], Ji[9], R_WC[9], J[9];
            plr_model_of(&filter.belief)
                ->in_world(&filter.belief, &filter.camera, &filter.motion,
                           &filter.belief.slots[slot], &point);
            point_of(slot, q);
            rigid_inverse(T_BC, truth.T_CB);
            rigid_apply(s, T_BC, q);
            rigid_apply(m, truth.T_WB, s);
            TEST_ASSERT_DOUBLE_WITHIN(300 * eps, 0, largest_difference(m, point.p_W, 3));
            for (int j = 0; j < 6; j++) {
                const double h = 1e-6;
                double xi[6] = {0}, E[16], T[16], ends[2][3];
                for (int end = 0; end < 2; end++) {
                    xi[j] = end ? -h : h;
                    rigid_exp(E, xi);
                    square_multiply(4, truth.T_WB, E, T);
                    rigid_apply(ends[end], T, s);
                }
                for (int i = 0; i < 3; i++)
                    TEST_ASSERT_DOUBLE_WITHIN(1e-7 + 300 * eps, (ends[0][i] - ends[1][i]) / (2 * h),
                                              (double)point.J.term[1].H[6 * i + j]);
            }
            specimen_chart(filter.belief.slots[slot].x, Jw, Ji);
            observe_camera_to_world(&truth, R_WC);
            square_multiply(3, R_WC, Ji, J);
            for (int i = 0; i < 9; i++)
                TEST_ASSERT_DOUBLE_WITHIN(1e4 * eps, J[i], (double)point.J.term[0].H[i]);
        }
    }
}
