// SPDX-License-Identifier: MIT
/* The start with an IMU (process/alignment.h): what is taken for rest, what is refused and why, and
 * what the filter then knows. */
#include <math.h>
#include <stdlib.h>
#include <unity.h>

#include "support/imu_still.h"
#include "support/specimens.h"

static const double g = 9.81;
static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_still_set_up();
}

/* ---------------------------------------------------------------- at rest */

static void test_a_body_that_stands_for_a_second_starts(void) {
    imu_still_begin();
    imu_still_feed_up(IMU_STILL_SECOND - 1, 0, 0, g);
    imu_still_demand_waiting(PLR_IMU_FAULT_NONE);
    imu_still_feed_up(2, 0, 0, g);
    imu_still_demand_started();
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_NONE, plr_filter_imu_fault(f));
}

static void test_until_the_start_the_pose_stays(void) {
    imu_still_begin_at(0);
    imu_still_feed_up(IMU_STILL_SECOND / 2, 0.5, 0, g);
    const plr_pose pose = pose_of(f);
    TEST_ASSERT_EQUAL_DOUBLE(1, pose.p[0]);
    TEST_ASSERT_EQUAL_DOUBLE(1, pose.R[0]);
}

/* Roll and pitch as gravity shows them; the rate is the gyro's bias. */
static void test_at_rest_tilt_and_gyro_bias_are_measured(void) {
    const double roll = 0.3, pitch = -0.2;
    const double a[3] = {-g * sin(pitch), g * cos(pitch) * sin(roll), g * cos(pitch) * cos(roll)};
    const double w[3] = {0.004, -0.003, 0.006};
    double b[6];
    imu_still_begin();
    TEST_ASSERT_EQUAL_INT(PLR_OK, imu_still_feed(IMU_STILL_SECOND + 1, a, w));
    imu_still_demand_started();
    const plr_pose pose = pose_of(f);
    for (int i = 0; i < 3; i++) /* noise of a second: 1 mm/s^2 in 9.8 m/s^2, 0.06 deg/s */
        TEST_ASSERT_DOUBLE_WITHIN(5e-3, a[i] / g, pose.R[6 + i]);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(f, b, NULL));
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(5e-3, w[i], b[3 + i]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, b[i]);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, pose.R[1],
                              pose.R[3]); /* the smallest turn: about a level axis */
}

/* The tilt is wrong by the accelerometer's bias: theta = [u]x db_a / g, and P says so. */
static void test_the_tilts_covariance_is_that_of_the_accelerometers_bias(void) {
    const double sigma = 0.2, s2 = sigma * sigma;
    const double roll = 0.4;
    imu_rig.config.bias_accel_sigma_mps2 = sigma;
    imu_still_begin();
    imu_still_feed_up(IMU_STILL_SECOND + 1, 0, g * sin(roll), g * cos(roll));
    imu_still_demand_started();
    const double u[3] = {(double)f->belief.R_WB[6], (double)f->belief.R_WB[7],
                         (double)f->belief.R_WB[8]};
    const double L[9] = {0, -u[2] / g, u[1] / g, u[2] / g, 0, -u[0] / g, -u[1] / g, u[0] / g, 0};
    double *P = specimen_covariance(f);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double LL = 0;
            for (int k = 0; k < 3; k++)
                LL += L[3 * i + k] * L[3 * j + k];
            /* beside it the noise of a second, and the start's own 1e-4 rad */
            TEST_ASSERT_DOUBLE_WITHIN(3e-6, LL * s2, P[PLR_CORE_DIM * (3 + i) + 3 + j]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-5, L[3 * i + j] * s2, P[PLR_CORE_DIM * (3 + i) + 9 + j]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-4 * s2, i == j ? s2 : 0,
                                      P[PLR_CORE_DIM * (9 + i) + 9 + j]);
        }
    free(P);
}

/* Errors of tilt and velocity over many starts, in units of P. */
static void test_starts_at_rest_are_as_wrong_as_they_believe(void) {
    enum { STARTS = 60 };
    double orientation = 0, gyro = 0;
    for (uint64_t seed = 1; seed <= STARTS; seed++) {
        imu_rig_begin(IMU_RIG_AT_REST, seed);
        imu_rig_readings(IMU_STILL_SECOND + 4);
        imu_still_demand_started();
        imu_rig_adopt_world();
        const imu_rig_errors e = imu_rig_errors_now();
        orientation += e.orientation / STARTS; /* yaw is as adopted: two degrees of freedom */
        gyro += e.gyro_bias / STARTS;
    }
    TEST_ASSERT_TRUE(orientation > 1.2 && orientation < 2.9);
    TEST_ASSERT_TRUE(gyro > 2 && gyro < 4.2);
}

/* Few readings are no mean, however much time lies between them. */
static void test_a_pause_between_readings_begins_the_second_anew(void) {
    imu_still_begin();
    imu_still_feed_up(10, 0, 0, g);
    const plr_imu imu = {{0, 0, g}, {0, 0, 1e-4}};
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_inertial(f, plr_filter_time(f) + UINT64_C(1500000000), &imu));
    imu_still_demand_waiting(PLR_IMU_FAULT_NONE);
    imu_still_feed_up(IMU_STILL_SECOND - 1, 0, 0, g);
    imu_still_demand_waiting(PLR_IMU_FAULT_NONE);
    imu_still_feed_up(2, 0, 0, g);
    imu_still_demand_started();
}

/* A pose that is set on another clock: what was averaged belongs to the old one. */
static void test_on_another_clock_the_start_begins_anew(void) {
    const plr_pose identity = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    imu_still_begin();
    imu_still_feed_up(IMU_STILL_SECOND / 2, 0, 0, g);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(f, 500000000, &identity, NULL));
    imu_still_feed_up(IMU_STILL_SECOND - 1, 0, 0, g);
    imu_still_demand_waiting(PLR_IMU_FAULT_NONE);
    imu_still_feed_up(3, 0, 0, g);
    imu_still_demand_started();
}

/* ---------------------------------------------------------------- what is no rest */

static void shake(double amplitude, double turn, unsigned seconds) {
    const plr_time_ns begin = plr_filter_time(f) ? plr_filter_time(f) : 1000000000;
    for (unsigned k = 1; k <= seconds * IMU_STILL_SECOND; k++) {
        const double s = 2 * 3.14159265 * 1.3 * k / IMU_STILL_SECOND;
        const plr_imu imu = {{amplitude * sin(s), amplitude * cos(1.3 * s), g},
                             {turn * sin(s), 0, turn * cos(s) + 1e-6 * k}};
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(f, begin + UINT64_C(2500000) * k, &imu));
    }
}

static void test_a_body_that_is_shaken_does_not_start_at_rest(void) {
    imu_rig.config.imu_start = PLR_IMU_START_REST;
    imu_still_begin();
    shake(2, 0.3, 5);
    imu_still_demand_waiting(PLR_IMU_FAULT_MOVES);
    imu_still_feed_up(2 * IMU_STILL_SECOND + 2, 0, 0, g); /* and then it stands */
    imu_still_demand_started();
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_NONE, plr_filter_imu_fault(f));
}

static void test_auto_starts_in_motion_where_the_body_never_stands(void) {
    imu_still_begin();
    shake(2, 0.3, 2);
    imu_still_demand_waiting(PLR_IMU_FAULT_MOVES);
    shake(2, 0.3, 3);
    imu_still_demand_started();
    double P_u[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(f, P_u));
    TEST_ASSERT_TRUE(P_u[0] >= 9);
}

static void test_a_gyro_in_degrees_turns_while_the_body_stands(void) {
    static const double up[3] = {0, 0, 9.81};
    static const double turn[3] = {0.8, -0.2, 0.3};
    imu_rig.config.imu_start = PLR_IMU_START_REST;
    imu_still_begin();
    TEST_ASSERT_EQUAL_INT(PLR_OK, imu_still_feed(3 * IMU_STILL_SECOND, up, turn));
    imu_still_demand_waiting(PLR_IMU_FAULT_TURNS);
}

static void test_after_a_turn_at_rest_moving_does_not_start_and_resting_does(void) {
    static const double up[3] = {0, 0, 9.81};
    static const double turn[3] = {0.8, -0.2, 0.3};
    imu_still_begin();
    TEST_ASSERT_EQUAL_INT(PLR_OK, imu_still_feed(3 * IMU_STILL_SECOND / 2, up, turn));
    imu_still_demand_waiting(PLR_IMU_FAULT_TURNS);
    shake(2, 0.3, 5);
    imu_still_demand_waiting(PLR_IMU_FAULT_TURNS);
    imu_still_feed_up(5 * IMU_STILL_SECOND / 2, 0, 0, 9.81);
    imu_still_demand_started();
}

static void test_an_accelerometer_in_g_is_told(void) {
    imu_still_begin();
    imu_still_feed_up(2 * IMU_STILL_SECOND, 0, 0, 1);
    imu_still_demand_waiting(PLR_IMU_FAULT_IN_G);
    imu_still_feed_up(4 * IMU_STILL_SECOND, 0, 0, 1); /* nor does it start as in motion */
    imu_still_demand_waiting(PLR_IMU_FAULT_IN_G);
}

static void test_a_force_at_rest_that_is_not_gravity_is_told(void) {
    imu_rig.config.imu_start = PLR_IMU_START_REST;
    imu_still_begin();
    imu_still_feed_up(2 * IMU_STILL_SECOND, 0, 0, g + 2);
    imu_still_demand_waiting(PLR_IMU_FAULT_NOT_GRAVITY);
    imu_still_feed_up(IMU_STILL_SECOND, 0, 0, g - 2);
    imu_still_demand_waiting(PLR_IMU_FAULT_NOT_GRAVITY);
    imu_still_feed_up(2 * IMU_STILL_SECOND, 0, 0, g + 0.5);
    imu_still_demand_started();
}

static void test_no_force_at_all_does_not_start_at_rest(void) {
    imu_rig.config.imu_start = PLR_IMU_START_REST;
    imu_still_begin();
    imu_still_feed_up(3 * IMU_STILL_SECOND, 0, 0, 0);
    imu_still_demand_waiting(PLR_IMU_FAULT_NOT_GRAVITY);
}

static void test_gravity_that_points_down_in_the_given_pose_is_told(void) {
    imu_still_begin_at(0);
    imu_still_feed_up(2 * IMU_STILL_SECOND, 0, 0, -g);
    imu_still_demand_waiting(PLR_IMU_FAULT_UPSIDE_DOWN);
    imu_still_feed_up(4 * IMU_STILL_SECOND, 0, 0, -g);
    imu_still_demand_waiting(PLR_IMU_FAULT_UPSIDE_DOWN);
}

/* Without a pose any tilt is believed, an IMU upside down too. */
static void test_without_a_pose_upside_down_is_a_tilt(void) {
    imu_still_begin();
    imu_still_feed_up(IMU_STILL_SECOND + 1, 0, 0, -g);
    imu_still_demand_started();
    const plr_pose pose = pose_of(f);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, -1, pose.R[8]);
    double RtR[9] = {0};
    for (int i = 0; i < 9; i++)
        for (int k = 0; k < 3; k++)
            RtR[i] += pose.R[3 * k + i / 3] * pose.R[3 * k + i % 3];
    for (int i = 0; i < 9; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, i % 4 == 0, RtR[i]);
}

static void test_another_tilt_than_the_given_poses_is_told_and_taken(void) {
    imu_still_begin_at(0);
    imu_still_feed_up(IMU_STILL_SECOND + 1, 0, g * sin(0.6), g * cos(0.6));
    imu_still_demand_started();
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_TILT, plr_filter_imu_fault(f));
    TEST_ASSERT_TRUE(imu_still_reasons() & PLR_REASON_IMU_FAULT);
    const plr_pose pose = pose_of(f);
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, sin(0.6), pose.R[7]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 1, pose.p[0]);
}

static void test_a_given_pose_keeps_its_place_and_heading(void) {
    double P[36];
    imu_still_begin_at(0.1);
    imu_still_feed_up(IMU_STILL_SECOND + 1, 0, g * sin(0.12), g * cos(0.12));
    imu_still_demand_started();
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_NONE, plr_filter_imu_fault(f));
    const plr_pose pose = pose_of(f);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1, pose.R[0]);
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, sin(0.12), pose.R[7]);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(f, P));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 1e-8, P[0]);
}

/* ---------------------------------------------------------------- in motion, and given */

static void test_a_start_in_motion_takes_a_tenth_of_a_second(void) {
    imu_rig.config.imu_start = PLR_IMU_START_MOTION;
    imu_still_begin();
    imu_still_feed_up(IMU_STILL_SECOND / 10 - 1, 0, 0, g);
    imu_still_demand_waiting(PLR_IMU_FAULT_NONE);
    imu_still_feed_up(3, 0, 0, g);
    imu_still_demand_started();
}

/* Until the anchor what the first second did to the pose is believed; then position and yaw are where
 * they are. */
static void test_the_anchor_lays_position_and_yaw_anew_two_seconds_after_a_start_in_motion(void) {
    double P[36];
    imu_rig_begin(IMU_RIG_IN_MOTION, 3);
    imu_rig_fly(18);
    TEST_ASSERT_EQUAL_UINT8(PLR_IMU_UNSETTLED, f->source.inertial.phase);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(f, P));
    TEST_ASSERT_TRUE(P[0] + P[7] + P[14] > 1e-5);
    imu_rig_fly(6);
    TEST_ASSERT_EQUAL_UINT8(PLR_IMU_SETTLED, f->source.inertial.phase);
    imu_rig_begin(IMU_RIG_IN_MOTION, 3);
    while (f->source.inertial.phase != PLR_IMU_SETTLED) {
        imu_rig_readings(IMU_RIG_EVERY);
        imu_rig_frame();
    }
    const plr_pose pose = pose_of(f);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(f, P));
    double along = 0;
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-10, 1e-8, P[7 * i]);
        for (int j = 0; j < 3; j++)
            along += pose.R[6 + i] * P[6 * (3 + i) + 3 + j] * pose.R[6 + j];
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1e-8, along);
    TEST_ASSERT_TRUE(P[21] + P[28] + P[35] > 1e-6); /* the tilt is as well known as it is */
}

static void test_a_given_start_waits_for_nothing_but_its_pose(void) {
    imu_rig.config.imu_start = PLR_IMU_START_GIVEN;
    imu_still_begin();
    imu_still_feed_up(2 * IMU_STILL_SECOND, 0, 0, g);
    imu_still_demand_waiting(PLR_IMU_FAULT_NONE);
    imu_still_begin_at(0);
    imu_still_feed_up(1, 0, 0, g);
    imu_still_demand_started();
    double P_u[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(f, P_u));
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 9, P_u[0]);
}
