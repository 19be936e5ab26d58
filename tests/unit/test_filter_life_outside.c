// SPDX-License-Identifier: MIT
/* Pose and bias from outside: every refusal that filter.h documents, and that it
 * changes nothing. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "math/packed.h"
#include "support/matrices.h"
#include "support/reseal.h"
#include "support/rig.h"

void setUp(void) {
    rig_set_up();
}

/* ---------------------------------------------------------------- pose from outside */

static void test_a_pose_from_outside_is_taken_with_its_covariance(void) {
    rng chance = rng_seeded(55);
    plr_pose T_WB;
    double P[36], P_got[36];
    rig_drive(5);
    random_rotation(&chance, T_WB.R);
    rng_normals(&chance, 100, T_WB.p, 3);
    random_spd(&chance, 6, 0.1, P);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&rig.filter, 77, &T_WB, P));
    const plr_pose got = pose_of(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P_got));
    TEST_ASSERT_DOUBLE_WITHIN(4 * REAL_EPSILON, 0, largest_difference(T_WB.R, got.R, 9));
    TEST_ASSERT_EQUAL_MEMORY(T_WB.p, got.p, sizeof got.p);
    TEST_ASSERT_DOUBLE_WITHIN(20 * REAL_EPSILON, 0, largest_difference(P, P_got, 36));
    TEST_ASSERT_EQUAL_UINT64(77, plr_filter_time(&rig.filter)); /* it may be anything */
}

static unsigned handed_over;

static int count_sink(void *context, const plr_landmark *landmark) {
    (void)context;
    (void)landmark;
    handed_over++;
    return 0;
}

static void test_a_pose_from_outside_drops_the_landmarks_without_the_sink(void) {
    const plr_map map = {.sink = count_sink};
    handed_over = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_init(&rig.filter, &rig.calibration, &rig.config, &map));
    rig_drive(5);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_set_pose(&rig.filter, rig.world.t_ns, &rig_identity, NULL));
    TEST_ASSERT_EQUAL_UINT(0, plr_filter_landmark_count(&rig.filter));
    TEST_ASSERT_EQUAL_UINT(0, handed_over);
}

static void test_poses_from_outside_are_counted_once_the_clock_runs(void) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&rig.filter, 5, &rig_identity, NULL));
    TEST_ASSERT_EQUAL_UINT32(0, rig.filter.totals.resets); /* that was the start */
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&rig.filter, 6, &rig_identity, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&rig.filter, 4, &rig_identity, NULL));
    TEST_ASSERT_EQUAL_UINT32(2, rig.filter.totals.resets);
}

static void test_a_pose_from_outside_keeps_the_bias_and_its_covariance(void) {
    double b[6], P[36], b_after[6], P_after[36];
    rig_begin_with(PLR_MODE_SLAM, true);
    rig_drive(5);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_set_pose(&rig.filter, rig.world.t_ns, &rig_identity, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b_after, P_after));
    TEST_ASSERT_GREATER_THAN_DOUBLE(1e-6, largest(b, 6));
    TEST_ASSERT_EQUAL_MEMORY(b, b_after, sizeof b);
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 0, largest_difference(P, P_after, 36));
}

static void test_a_pose_from_outside_heals_a_diverged_filter(void) {
    rig_begin_with(PLR_MODE_SLAM, true);
    rig_drive(5);
    spoil_covariance(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_set_pose(&rig.filter, rig.world.t_ns, &rig_identity, NULL));
    double b[6], P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, largest(b, 6)); /* mean and variance are the prior's again */
    for (int i = 0; i < 6; i++) {
        const double sigma =
            i < 3 ? rig.config.bias_velocity_sigma_mps : rig.config.bias_gyro_sigma_radps;
        const double walk = i < 3 ? rig.config.bias_velocity_walk : rig.config.bias_gyro_walk;
        const double variance = sigma * sigma + rig.filter.source.bias_walked_s * walk;
        TEST_ASSERT_DOUBLE_WITHIN(2e-7 * variance, variance, P[7 * i]);
    }
    rig_drive(5);
}

/* A velocity of long ago, or of another clock, is no velocity of now. */
static void test_after_a_jump_of_the_clock_the_old_reading_is_forgotten(void) {
    rig_drive(5);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&rig.filter, 5, &rig_identity, NULL));
    const plr_frame frame = {200000005, PLR_NO_BUDGET, 0, NULL};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, NULL));
    const plr_pose pose = pose_of(&rig.filter);
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, largest(pose.p, 3));
}

static void test_set_pose_refuses_what_is_no_pose(void) {
    double P[36] = {0};
    plr_pose bad;
    for (int i = 0; i < 6; i++)
        P[7 * i] = 1;
    rig_drive(5);
    rig_remember();
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_set_pose(NULL, 1, &rig_identity, P));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_set_pose(&rig.filter, 1, NULL, P));
    bad = rig_identity;
    bad.R[3] = (double)NAN;
    rig_demand_refusal(PLR_E_NOT_FINITE, plr_filter_set_pose(&rig.filter, 1, &bad, P));
    bad = rig_identity;
    bad.p[2] = (double)INFINITY;
    rig_demand_refusal(PLR_E_NOT_FINITE, plr_filter_set_pose(&rig.filter, 1, &bad, P));
    bad = rig_identity;
    bad.R[0] = 0.9;
    rig_demand_refusal(PLR_E_ARGUMENT, plr_filter_set_pose(&rig.filter, 1, &bad, P));
    bad = rig_identity;
    bad.p[0] = 1e300;
    rig_demand_refusal(PLR_E_RANGE, plr_filter_set_pose(&rig.filter, 1, &bad, P));
    P[35] = (double)NAN;
    rig_demand_refusal(PLR_E_NOT_FINITE, plr_filter_set_pose(&rig.filter, 1, &rig_identity, P));
    P[35] = -1;
    rig_demand_refusal(PLR_E_ARGUMENT, plr_filter_set_pose(&rig.filter, 1, &rig_identity, P));
    P[35] = 1e300;
    rig_demand_refusal(PLR_E_RANGE, plr_filter_set_pose(&rig.filter, 1, &rig_identity, P));
    P[35] = 1;
    P[1] = 0.5;
    rig_demand_refusal(PLR_E_ARGUMENT, plr_filter_set_pose(&rig.filter, 1, &rig_identity, P));
}

static void test_mapping_takes_no_pose_but_by_move_to(void) {
    rig_begin_with(PLR_MODE_MAPPING, false);
    rig_remember();
    rig_demand_refusal(PLR_E_MODE, plr_filter_set_pose(&rig.filter, 1, &rig_identity, NULL));
}

/* ---------------------------------------------------------------- bias from outside */

static void test_a_bias_prior_is_taken_before_the_first_twist(void) {
    const double mean[6] = {0.5, -0.25, 0, 0.125, 0, -1}, variance[6] = {1, 2, 4, 8, 0, 16};
    double b[6], P[36];
    rig_begin_with(PLR_MODE_SLAM, true);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_bias(&rig.filter, mean, variance));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(mean, b, 6);
    for (int i = 0; i < 36; i++)
        TEST_ASSERT_EQUAL_DOUBLE(i % 7 == 0 ? variance[i / 7] : 0, P[i]);
}

static void test_set_bias_refuses_what_is_no_prior(void) {
    double mean[6] = {0}, variance[6] = {1, 1, 1, 1, 1, 1};
    rig_begin_with(PLR_MODE_SLAM, true);
    rig_remember();
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_set_bias(NULL, mean, variance));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_set_bias(&rig.filter, NULL, variance));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_set_bias(&rig.filter, mean, NULL));
    mean[4] = (double)NAN;
    rig_demand_refusal(PLR_E_NOT_FINITE, plr_filter_set_bias(&rig.filter, mean, variance));
    mean[4] = 1e300;
    rig_demand_refusal(PLR_E_RANGE, plr_filter_set_bias(&rig.filter, mean, variance));
    mean[4] = 0;
    variance[2] = -1e-9;
    rig_demand_refusal(PLR_E_ARGUMENT, plr_filter_set_bias(&rig.filter, mean, variance));
    variance[2] = (double)INFINITY;
    rig_demand_refusal(PLR_E_NOT_FINITE, plr_filter_set_bias(&rig.filter, mean, variance));
    variance[2] = 1e300;
    rig_demand_refusal(PLR_E_RANGE, plr_filter_set_bias(&rig.filter, mean, variance));
}

static void test_a_bias_prior_comes_too_late_after_a_twist(void) {
    const double mean[6] = {0}, variance[6] = {0};
    const plr_twist twist = {{0}, {0}};
    rig_begin_with(PLR_MODE_SLAM, true);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, 1, &twist));
    rig_remember();
    rig_demand_refusal(PLR_E_MODE, plr_filter_set_bias(&rig.filter, mean, variance));
}

/* Frames alone tie the pose to the bias too: a filter without twists stands still, with noise. */
static void test_a_bias_prior_comes_too_late_after_a_frame(void) {
    const double mean[6] = {0}, variance[6] = {1e-6, 1e-6, 1e-6, 1e-8, 1e-8, 1e-8};
    rig_begin_with(PLR_MODE_SLAM, true);
    for (int k = 0; k < 3; k++) {
        const plr_frame frame = scene_look(&rig.world);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, NULL));
        rig.world.t_ns += 100000000;
    }
    rig_remember();
    rig_demand_refusal(PLR_E_MODE, plr_filter_set_bias(&rig.filter, mean, variance));
}

static void test_without_bias_states_there_is_no_prior(void) {
    const double mean[6] = {0}, variance[6] = {0};
    rig_begin_with(PLR_MODE_SLAM, false);
    rig_remember();
    rig_demand_refusal(PLR_E_MODE, plr_filter_set_bias(&rig.filter, mean, variance));
}
