// SPDX-License-Identifier: MIT
/* An IMU that sits elsewhere on the body, and is turned: a filter that is told so says of the body
 * what a filter that takes the IMU for the body says of the IMU. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "pelorus/filter.h"
#include "support/imu_flight.h"
#include "support/matrices.h"
#include "support/pose_of.h"
#include "support/rigid.h"

static const double turn[3] = {0.4, -1.1, 2.0}, arm[3] = {0.3, -0.2, 0.15};

/* The search for a frame's motion ends at another place near the minimum if the axes are others. */
static const double close = 1e-3;

static plr_filter plain, mounted;
static imu_flight flight;
static double T_BI[16], T_IB[16];

void setUp(void) {
    imu_flight_options options;
    const double xi[6] = {0, 0, 0, turn[0], turn[1], turn[2]};
    imu_flight_options_default(&options);
    imu_flight_start(&flight, &options);
    rigid_exp(T_BI, xi);
    for (int i = 0; i < 3; i++)
        T_BI[4 * i + 3] = arm[i];
    rigid_inverse(T_IB, T_BI);
}

static void begin(void) {
    static const double variance[3] = {1e-4, 1e-4, 1e-4};
    plr_config config;
    plr_calibration calibration = flight.calibration;
    double T_CI[16], T_CB[16], T_WI[16], T_WB[16], v[3], v_B[3], P_I[36], P_B[36], Ad[36], next[36];
    plr_pose pose;
    plr_config_default(&config);
    config.process = PLR_PROCESS_IMU;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&plain, &calibration, &config, NULL));
    rigid_from_pose(T_CI, &calibration.T_CB);
    square_multiply(4, T_CI, T_IB, T_CB);
    rigid_to_pose(&calibration.T_CB, T_CB);
    memcpy(config.imu_turn_rad, turn, sizeof turn);
    memcpy(config.imu_arm_m, arm, sizeof arm);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&mounted, &calibration, &config, NULL));

    imu_flight_truth(&flight, T_WI, v);
    rigid_to_pose(&pose, T_WI);
    memset(P_I, 0, sizeof P_I);
    for (int i = 0; i < 6; i++)
        P_I[7 * i] = 1e-4 * (i + 1);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&plain, flight.t_ns, &pose, P_I));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(&plain, v, variance));
    square_multiply(4, T_WI, T_IB, T_WB);
    rigid_to_pose(&pose, T_WB);
    rigid_adjoint(Ad, T_BI); /* the body's error by that of the IMU */
    square_multiply(6, Ad, P_I, next);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            P_B[6 * i + j] = 0;
            for (int k = 0; k < 6; k++)
                P_B[6 * i + j] += next[6 * i + k] * Ad[6 * j + k];
        }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < i; j++)
            P_B[6 * i + j] = P_B[6 * j + i];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&mounted, flight.t_ns, &pose, P_B));
    for (int i = 0; i < 3; i++) {
        v_B[i] = 0;
        for (int j = 0; j < 3; j++)
            v_B[i] += T_BI[4 * i + j] * v[j];
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(&mounted, v_B, variance));
}

static void fly(unsigned frames) {
    for (unsigned k = 0; k < 40 * frames; k++) {
        imu_flight_move(&flight);
        const plr_imu imu = imu_flight_read(&flight);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(&plain, flight.t_ns, &imu));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(&mounted, flight.t_ns, &imu));
        if ((k + 1) % 40 != 0)
            continue;
        const plr_frame frame = imu_flight_look(&flight);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&plain, &frame, NULL));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&mounted, &frame, NULL));
    }
}

static void test_pose_and_covariance_are_those_of_the_body(void) {
    plr_pose of_imu, of_body;
    double T[16], expected[16], got[16], P_I[36], P_B[36], Ad[36], next[36];
    begin();
    fly(20);
    plr_filter_pose(&plain, &of_imu);
    plr_filter_pose(&mounted, &of_body);
    rigid_from_pose(T, &of_imu);
    square_multiply(4, T, T_IB, expected);
    rigid_from_pose(got, &of_body);
    TEST_ASSERT_DOUBLE_WITHIN(close, 0, largest_difference(expected, got, 16));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&plain, P_I));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&mounted, P_B));
    rigid_adjoint(Ad, T_BI);
    square_multiply(6, Ad, P_I, next);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            double sum = 0;
            for (int k = 0; k < 6; k++)
                sum += next[6 * i + k] * Ad[6 * j + k];
            const double scale = sqrt(P_B[7 * i] * P_B[7 * j]);
            TEST_ASSERT_DOUBLE_WITHIN(100 * close, sum / scale, P_B[6 * i + j] / scale);
        }
}

static void test_velocity_is_that_of_the_body(void) {
    plr_twist of_imu, of_body;
    begin();
    fly(20);
    plr_filter_velocity(&plain, &of_imu);
    plr_filter_velocity(&mounted, &of_body);
    double w[3], v[3];
    for (int i = 0; i < 3; i++) {
        w[i] = v[i] = 0;
        for (int j = 0; j < 3; j++) {
            w[i] += T_BI[4 * i + j] * of_imu.w_B_radps[j];
            v[i] += T_BI[4 * i + j] * of_imu.v_B_mps[j];
        }
    }
    for (int i = 0; i < 3; i++) { /* v_body = v_imu - w x r */
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        TEST_ASSERT_DOUBLE_WITHIN(close, w[i], of_body.w_B_radps[i]);
        TEST_ASSERT_DOUBLE_WITHIN(close, v[i] - w[j] * arm[k] + w[k] * arm[j], of_body.v_B_mps[i]);
    }
}

/* A wheel at a place of the body: the same reading, described from either origin. */
static void test_a_sensor_has_its_place_on_the_body(void) {
    begin();
    fly(10);
    plr_twist of_body;
    plr_filter_velocity(&mounted, &of_body);
    plr_reading wheel = {.t_ns = flight.t_ns, .sensor = PLR_SENSOR_WHEEL, .axes = 7};
    plr_reading_result result;
    for (int i = 0; i < 3; i++) {
        wheel.value[i] = of_body.v_B_mps[i];
        wheel.sigma[i] = 0.01;
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(&mounted, &wheel, &result));
    TEST_ASSERT_TRUE(result.used);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0, result.d2);
}

static void test_twists_know_no_mount(void) {
    plr_config config;
    plr_pose pose, before = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {1, 2, 3}};
    plr_config_default(&config);
    memcpy(config.imu_arm_m, arm, sizeof arm);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&plain, &flight.calibration, &config, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&plain, 1, &before, NULL));
    pose = pose_of(&plain);
    TEST_ASSERT_EQUAL_MEMORY(&before, &pose, sizeof pose);
}
