// SPDX-License-Identifier: MIT
/* What pictures say before the start with an IMU: whether the body stands. */
#include <math.h>
#include <unity.h>

#include "support/imu_still.h"

static const double g = 9.81;
static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_still_set_up();
}

static void test_frames_before_the_start_are_taken_and_make_no_landmarks(void) {
    imu_still_begin();
    for (unsigned k = 0; k < 3; k++) {
        imu_still_feed_up(IMU_STILL_SECOND / 4, 0, 0, g);
        const plr_report report = imu_still_look(0);
        TEST_ASSERT_EQUAL_UINT16(0, report.active);
        TEST_ASSERT_EQUAL_UINT16(0, report.used);
        TEST_ASSERT_EQUAL_INT(PLR_HEALTH_LOST, report.health);
        TEST_ASSERT_TRUE(report.reasons & PLR_REASON_NOT_STARTED);
    }
    imu_still_feed_up(IMU_STILL_SECOND / 4 + 2, 0, 0, g);
    imu_still_demand_started();
    const plr_report report = imu_still_look(0);
    TEST_ASSERT_EQUAL_UINT16(5, report.created);
    TEST_ASSERT_FALSE(report.reasons & PLR_REASON_NOT_STARTED);
    imu_still_feed_up(10, 0, 0, g);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, imu_still_look(0).health);
}

static void test_in_dead_reckoning_too_the_start_ends_the_waiting(void) {
    imu_rig.config.mode = PLR_MODE_DEAD_RECKONING;
    imu_still_begin();
    imu_still_feed_up(IMU_STILL_SECOND / 2, 0, 0, g);
    (void)imu_still_look(0);
    imu_still_demand_waiting(PLR_IMU_FAULT_NONE);
    imu_still_feed_up(IMU_STILL_SECOND / 2 + 2, 0, 0, g);
    imu_still_demand_started();
    (void)imu_still_look(0);
    imu_still_feed_up(IMU_STILL_SECOND / 10, 0, 0, g);
    TEST_ASSERT_EQUAL_HEX32(0, imu_still_reasons());
}

/* A steady flight feels like rest: the pictures know better. */
static void test_pictures_that_move_keep_the_filter_from_a_start_at_rest(void) {
    imu_rig.config.imu_start = PLR_IMU_START_REST;
    imu_still_begin();
    for (unsigned k = 0; k < 16; k++) {
        imu_still_feed_up(IMU_STILL_SECOND / 4, 0, 0, g);
        (void)imu_still_look(30.0 * k);
    }
    imu_still_demand_waiting(PLR_IMU_FAULT_MOVES);
    for (unsigned k = 0; k < 6; k++) {
        imu_still_feed_up(IMU_STILL_SECOND / 4, 0, 0, g);
        (void)imu_still_look(450);
    }
    imu_still_demand_started();
}

/* Any match may be wrong, the first one of a point too. */
static void test_wrong_matches_do_not_keep_it_from_a_start_at_rest(void) {
    imu_rig.config.imu_start = PLR_IMU_START_REST;
    imu_still_begin();
    for (unsigned k = 0; k < 6; k++) { /* two frames show nothing but other points */
        imu_still_feed_up(IMU_STILL_SECOND / 6, 0, 0, g);
        (void)imu_still_look(k == 2 || k == 4 ? 50 : 0);
    }
    imu_still_feed_up(IMU_STILL_SECOND / 6, 0, 0, g);
    imu_still_demand_started();
}

/* A tracker that wanders shows points elsewhere while the body stands. */
static void test_tracks_that_wander_do_not_keep_it_from_a_start_at_rest(void) {
    const double drift_px[2] = {6, 0};
    imu_rig.config.imu_start = PLR_IMU_START_REST;
    for (unsigned k = 0; k < 2; k++) {
        imu_rig.config.track_drift_px = drift_px[k];
        imu_still_begin();
        for (unsigned frame = 0; frame < 6; frame++) {
            imu_still_feed_up(IMU_STILL_SECOND / 6, 0, 0, g);
            (void)imu_still_look(frame < 3 ? 0 : 7);
        }
        imu_still_feed_up(IMU_STILL_SECOND / 6, 0, 0, g);
        if (drift_px[k] > 0)
            imu_still_demand_started();
        else
            imu_still_demand_waiting(PLR_IMU_FAULT_MOVES);
    }
}

/* ---------------------------------------------------------------- motors that idle */

/* Standing while motors shake the IMU about its mean by so much, white; two pictures in a tenth of a second
 * where `sees`, in which nothing moves. */
static void idle(double force, double rate, const double bias[3], unsigned tenths, bool sees) {
    const plr_time_ns begin = plr_filter_time(f) ? plr_filter_time(f) : 1000000000;
    for (unsigned k = 1; k <= tenths * IMU_STILL_SECOND / 10; k++) {
        plr_imu imu = {{0, 0, g}, {bias[0], bias[1], bias[2]}};
        for (int i = 0; i < 3; i++) {
            imu.a_B_mps2[i] += force * rng_normal(&imu_still_chance);
            imu.w_B_radps[i] += rate * rng_normal(&imu_still_chance);
        }
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(f, begin + UINT64_C(2500000) * k, &imu));
        if (sees && k % (IMU_STILL_SECOND / 20) == 0)
            (void)imu_still_look(0);
    }
}

static const double no_bias[3] = {0};

static void test_motors_that_idle_are_rest_where_the_pictures_stand(void) {
    const double of_force[3] = {0.08, 0.4, 0.9}, of_rate[3] = {0.12, 0.25, 0.4};
    for (unsigned k = 0; k < 3; k++) {
        double P_u[36], P[36];
        imu_rig.config.bias_gyro_sigma_radps = 0.1;
        imu_rig.config.imu_start = PLR_IMU_START_REST;
        imu_still_begin_at(0);
        idle(of_force[k], of_rate[k], no_bias, 11, true);
        imu_still_demand_started();
        TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_NONE, plr_filter_imu_fault(f));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(f, P_u));
        TEST_ASSERT_TRUE(P_u[0] < 0.02);
        const double bias2 =
            of_rate[k] * of_rate[k] / IMU_STILL_SECOND; /* known as well as the mean is */
        TEST_ASSERT_TRUE(
            (double)f->source.bias_prior_sigma[4] * (double)f->source.bias_prior_sigma[4] > bias2);
        TEST_ASSERT_DOUBLE_WITHIN(4 * sqrt(bias2), 0, (double)f->belief.bias[4]);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(f, P));
        TEST_ASSERT_TRUE(P[21] > of_force[k] * of_force[k] / (IMU_STILL_SECOND * g * g));
    }
}

/* Without pictures it may be carried as well. */
static void test_motors_that_idle_unseen_start_in_motion_and_are_no_fault(void) {
    imu_still_begin();
    idle(0.3, 0.2, no_bias, 25, false);
    imu_still_demand_waiting(PLR_IMU_FAULT_MOVES);
    idle(0.3, 0.2, no_bias, 10, false);
    imu_still_demand_started();
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_NONE, plr_filter_imu_fault(f));
}

/* Its prior says a hundredth. */
static void test_a_gyro_bias_that_is_far_off_its_prior_is_measured_where_the_pictures_stand(void) {
    const double bias[3] = {0.11, -0.25, 0.04};
    imu_rig.config.bias_gyro_sigma_radps = 0.01;
    imu_rig.config.imu_start = PLR_IMU_START_REST;
    imu_still_begin();
    idle(0.02, 0.01, bias, 12, false);
    imu_still_demand_waiting(PLR_IMU_FAULT_TURNS);
    imu_still_begin();
    idle(0.02, 0.01, bias, 12, true);
    imu_still_demand_started();
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(3e-3, bias[i], (double)f->belief.bias[3 + i]);
    idle(0.02, 0.01, bias, 20, true);
    TEST_ASSERT_FALSE(imu_still_reasons() & PLR_REASON_BIAS_OFF_PRIOR);
}

/* More than any part's bias is degrees instead of rad. */
static void test_pictures_that_stand_excuse_no_gyro_in_degrees(void) {
    const double degrees[3] = {0.7, -0.5, 0.2};
    imu_rig.config.imu_start = PLR_IMU_START_REST;
    imu_still_begin();
    idle(0.02, 0.01, degrees, 15, true);
    imu_still_demand_waiting(PLR_IMU_FAULT_TURNS);
}
