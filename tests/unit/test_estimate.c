// SPDX-License-Identifier: MIT
/* What the filter says of pose, velocity, bias and time, and when it says nothing. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "math/packed.h"
#include "state/covariance.h"
#include "support/axes.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/reseal.h"
#include "support/rig.h"
#include "support/specimens.h"

static const double eps = REAL_EPSILON;

void setUp(void) {
    rig_set_up();
}

static void begin_with_bias(void) {
    rig.config.bias = 1;
    rig_begin();
}

static void test_time_is_that_of_the_last_twist_or_frame(void) {
    rig_drive(2);
    TEST_ASSERT_EQUAL_UINT64(rig.world.t_ns, plr_filter_time(&rig.filter));
    rig_twist();
    TEST_ASSERT_EQUAL_UINT64(rig.world.t_ns - RIG_STEP_NS, plr_filter_time(&rig.filter));
    TEST_ASSERT_EQUAL_UINT64(0, plr_filter_time(NULL));
}

static void test_the_pose_is_near_the_truth_and_says_how_near(void) {
    for (uint64_t seed = 1; seed <= 5; seed++) {
        double P[36];
        rig.options.seed = seed;
        rig_begin();
        rig_drive(40);
        const plr_pose pose = pose_of(&rig.filter);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
        const double sigma = sqrt(P[0] + P[7] + P[14]);
        for (int i = 0; i < 3; i++)
            TEST_ASSERT_DOUBLE_WITHIN(4 * sigma, rig.world.T_WB[4 * i + 3], pose.p[i]);
        TEST_ASSERT_LESS_THAN_DOUBLE(0.2, sigma); /* after 8 m */
        TEST_ASSERT_GREATER_THAN_DOUBLE(0, oracle_smallest_eigenvalue(6, P));
    }
}

static void test_pose_covariance_grows_from_twist_to_twist_and_shrinks_with_a_frame(void) {
    double last[36], P[36];
    rig_drive(3);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, last));
    for (int k = 0; k < 10; k++) {
        rig_twist();
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
        if (k > 0) /* the first reading moves nothing yet */
            TEST_ASSERT_GREATER_THAN_DOUBLE(last[0] + last[7] + last[14], P[0] + P[7] + P[14]);
        memcpy(last, P, sizeof last);
    }
    rig_frame(); /* 10 ms later, whose noise is as much of the way as four frames tell */
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    TEST_ASSERT_LESS_THAN_DOUBLE(0.8 * (last[21] + last[28] + last[35]), P[21] + P[28] + P[35]);
}

/* ---------------------------------------------------------------- velocity */

static void test_velocity_is_the_reading_without_the_bias(void) {
    const double b[6] = {0.5, -0.25, 0, 0.125, 0, -1}, variance[6] = {0};
    const plr_twist reading = {{2, 1, 0.5}, {0.25, -0.5, 0.75}};
    plr_twist velocity;
    begin_with_bias();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_bias(&rig.filter, b, variance));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, 1, &reading));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity(&rig.filter, &velocity));
    for (int i = 0; i < 3; i++) { /* all of these numbers are exact in float32 */
        TEST_ASSERT_EQUAL_DOUBLE(reading.v_B_mps[i] - b[i], velocity.v_B_mps[i]);
        TEST_ASSERT_EQUAL_DOUBLE(reading.w_B_radps[i] - b[3 + i], velocity.w_B_radps[i]);
    }
}

static void test_velocity_covariance_is_the_readings_plus_the_biases(void) {
    double P_u[36], b[6], P_b[36];
    const double sigma[6] = {0.5, 0.25, 1, 0.25, 0.125, 2};
    memcpy(rig.config.velocity_sigma, sigma, sizeof rig.config.velocity_sigma);
    memcpy(rig.config.gyro_sigma, sigma + 3, sizeof rig.config.gyro_sigma);
    begin_with_bias();
    rig_drive(5);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P_b));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(&rig.filter, P_u));
    for (int i = 0; i < 36; i++) {
        const double noise = i % 7 ? 0 : sigma[i / 7] * sigma[i / 7];
        TEST_ASSERT_DOUBLE_WITHIN(2 * eps, P_b[i] + noise, P_u[i]);
    }
}

/* With noise = step the sigmas are a displacement's: the velocity's are those by the step. */
static void test_noise_of_a_step_is_divided_by_the_step(void) {
    double P_u[36];
    rig.config.bias = 0;
    rig.config.noise = PLR_NOISE_STEP;
    each_axis(rig.config.velocity_sigma, 0.001);
    each_axis(rig.config.gyro_sigma, 0.002);
    rig_begin();
    rig_drive(2);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(&rig.filter, P_u));
    TEST_ASSERT_DOUBLE_WITHIN(10 * eps, 0.01, P_u[0]);
    TEST_ASSERT_DOUBLE_WITHIN(10 * eps, 0.04, P_u[35]);
}

/* ---------------------------------------------------------------- bias */

static void test_without_bias_states_the_bias_is_zero(void) {
    double b[6] = {1, 1, 1, 1, 1, 1}, P[36];
    rig.config.bias = 0;
    rig_begin();
    rig_drive(3);
    P[0] = 1;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, largest(b, 6));
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, largest(P, 36));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, NULL));
}

static void test_the_walk_shows_before_it_is_applied(void) {
    double b[6], before[36], pending[36], applied[36];
    rig.config.bias_velocity_walk = 0.5;
    rig.config.bias_gyro_walk = 0.25;
    begin_with_bias();
    rig_twist();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, before));
    for (int k = 0; k < 10; k++)
        rig_twist();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, pending));
    for (int i = 0; i < 6; i++)
        TEST_ASSERT_DOUBLE_WITHIN(20 * eps, (i < 3 ? 0.5 : 0.25) * 0.1,
                                  pending[7 * i] - before[7 * i]);
    const plr_observation unknown = {99, 400, 300, 390, 300}; /* its birth applies it */
    const plr_frame frame = {plr_filter_time(&rig.filter), 1, 1, &unknown};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, NULL));
    TEST_ASSERT_EQUAL_UINT8(0, rig.filter.motion.pending);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, applied));
    TEST_ASSERT_DOUBLE_WITHIN(2 * eps, 0, largest_difference(pending, applied, 36));
}

static void test_a_bias_is_found(void) {
    const double true_bias[6] = {0.06, -0.04, 0.02, 0.01, -0.012, 0.008};
    double b[6], P[36];
    memcpy(rig.options.bias, true_bias, sizeof true_bias);
    rig.config.bias_velocity_sigma_mps = 0.03;
    begin_with_bias();
    rig_drive(150);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
    for (int i = 0; i < 6; i++) {
        const double sigma = sqrt(P[7 * i]);
        TEST_ASSERT_DOUBLE_WITHIN(4 * sigma, true_bias[i], b[i]);
        TEST_ASSERT_LESS_THAN_DOUBLE(fabs(true_bias[i]), 2 * sigma); /* it is no mere prior */
    }
}

/* ---------------------------------------------------------------- trace, totals, refusals */

/* Pose and biases as they are now, the landmarks as they stand. */
static void test_trace_is_of_pose_and_biases_now_and_the_landmarks(void) {
    for (int pending = 0; pending < 2; pending++) {
        double sum = 0, P[36], b[6];
        rig.config.bias_velocity_walk = rig.config.bias_gyro_walk = 0.01;
        begin_with_bias();
        rig_drive(3);
        for (int k = 0; pending && k < 3; k++)
            rig_twist();
        TEST_ASSERT_EQUAL_UINT8(pending, rig.filter.motion.pending);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
        for (int i = 0; i < 6; i++)
            sum += P[7 * i];
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
        for (int i = 0; i < 6; i++)
            sum += P[7 * i];
        for (unsigned i = 12; i < plr_covariance_dim(&rig.filter.belief); i++)
            sum += (double)rig.filter.belief.P[plr_packed_at(i, i)];
        TEST_ASSERT_DOUBLE_WITHIN(1e-12 * sum, sum, plr_filter_trace(&rig.filter));
    }
    TEST_ASSERT_EQUAL_DOUBLE(0, plr_filter_trace(NULL));
}

static void test_getters_refuse_null_pointers(void) {
    plr_pose pose;
    plr_twist twist;
    plr_totals totals;
    double x[36];
    rig_remember();
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_pose(NULL, &pose));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_pose(&rig.filter, NULL));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_pose_covariance(NULL, x));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_pose_covariance(&rig.filter, NULL));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_velocity(NULL, &twist));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_velocity(&rig.filter, NULL));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_velocity_covariance(NULL, x));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_velocity_covariance(&rig.filter, NULL));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_bias(NULL, x, x));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_bias(&rig.filter, NULL, x));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_totals(NULL, &totals));
    rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_totals(&rig.filter, NULL));
    TEST_ASSERT_NULL(plr_filter_config(NULL));
}

static void test_getters_change_nothing(void) {
    plr_pose pose;
    plr_twist twist;
    plr_totals totals;
    double x[36], P[36];
    begin_with_bias();
    rig_drive(3);
    rig_twist();
    rig_twist();
    rig_remember();
    rig_demand_untouched(PLR_OK, plr_filter_pose(&rig.filter, &pose));
    rig_demand_untouched(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    rig_demand_untouched(PLR_OK, plr_filter_velocity(&rig.filter, &twist));
    rig_demand_untouched(PLR_OK, plr_filter_velocity_covariance(&rig.filter, P));
    rig_demand_untouched(PLR_OK, plr_filter_bias(&rig.filter, x, P));
    TEST_ASSERT_GREATER_THAN_DOUBLE(0, plr_filter_trace(&rig.filter));
    rig_demand_untouched(PLR_OK, plr_filter_totals(&rig.filter, &totals));
    TEST_ASSERT_EQUAL_MEMORY(&rig.filter.totals, &totals, sizeof totals);
}

static void test_a_diverged_filter_gives_means_and_no_covariance(void) {
    plr_pose pose;
    plr_twist twist;
    double x[36], P[36];
    begin_with_bias();
    rig_drive(3);
    spoil_covariance(&rig.filter);
    rig_remember();
    rig_demand_untouched(PLR_OK, plr_filter_pose(&rig.filter, &pose));
    rig_demand_untouched(PLR_OK, plr_filter_velocity(&rig.filter, &twist));
    rig_demand_untouched(PLR_OK, plr_filter_bias(&rig.filter, x, NULL));
    rig_demand_untouched(PLR_E_DIVERGED, plr_filter_bias(&rig.filter, x, P));
    rig_demand_untouched(PLR_E_DIVERGED, plr_filter_pose_covariance(&rig.filter, P));
    rig_demand_untouched(PLR_E_DIVERGED, plr_filter_velocity_covariance(&rig.filter, P));
    TEST_ASSERT_EQUAL_DOUBLE(0, plr_filter_trace(&rig.filter));
}
