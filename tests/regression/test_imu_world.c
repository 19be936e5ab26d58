// SPDX-License-Identifier: MIT
/* What a review of the IMU's start found: the anchor after a start in motion took position and heading
 * for free although a sensor or a map had just told them, and held them for known to a tenth of a
 * millimetre while they were wrong by half a metre; in mapping, where nothing has to start, an IMU
 * was waited for without end; a known landmark came in before the start, which then turned the pose
 * by which it had come; and the time since the start was counted across a jump of the clock. And an
 * attack from outside: a pose that was known to 26 m, after a pause in motion, counted two seconds later
 * as known to a tenth of a millimetre. */
#include <math.h>
#include <unity.h>

#include "support/imu_rig.h"
#include "support/rigid.h"

enum { SEEDS = PELORUS_SHORT_FORM ? 1 : 4 };

static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_rig_set_up();
}

static plr_pose true_pose(void) {
    double T[16], v[3];
    plr_pose pose;
    imu_flight_truth(&imu_rig.flight, T, v);
    rigid_to_pose(&pose, T);
    return pose;
}

/* The truth is set as the pose, which is known to `sigma`: metres on each axis, and 0.01 rad. */
static void place(double sigma) {
    double P[36] = {0};
    const plr_pose pose = true_pose();
    for (int i = 0; i < 6; i++)
        P[7 * i] = i < 3 ? sigma * sigma : 1e-4;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(f, imu_rig.flight.t_ns, &pose, P));
}

/* A position, wrong by `off` on each axis. */
static void measure_position(double off) {
    double T[16], v[3];
    plr_reading_result result;
    plr_reading reading = {.t_ns = imu_rig.flight.t_ns,
                           .sensor = PLR_SENSOR_POSITION,
                           .axes = 7,
                           .sigma = {0.5, 0.5, 0.5}};
    imu_flight_truth(&imu_rig.flight, T, v);
    for (int i = 0; i < 3; i++)
        reading.value[i] = T[4 * i + 3] + off;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(f, &reading, &result));
    TEST_ASSERT_TRUE(result.used);
}

static double position_sigma(void) {
    double P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(f, P));
    return sqrt((P[0] + P[7] + P[14]) / 3);
}

static void test_a_measured_position_is_not_given_up_for_an_anchor(void) {
    imu_rig_begin(IMU_RIG_IN_MOTION, 1);
    place(1);
    imu_rig_fly(10);
    TEST_ASSERT_TRUE(f->source.inertial.phase >= PLR_IMU_UNSETTLED);
    measure_position(0.4);
    imu_rig_fly(30); /* past the time of the anchor */
    TEST_ASSERT_TRUE(position_sigma() > 0.2);
    for (unsigned more = 0; more < 20; more++) {
        measure_position(more % 2 == 0 ? -0.4 : 0.4);
        imu_rig_fly(1);
    }
    double T[16], v[3], off2 = 0;
    imu_flight_truth(&imu_rig.flight, T, v);
    const plr_pose pose = pose_of(f);
    for (int i = 0; i < 3; i++)
        off2 += pow(pose.p[i] - T[4 * i + 3], 2);
    TEST_ASSERT_TRUE(off2 < 21 * position_sigma() * position_sigma());
}

/* What is said of the pose's covariance is said of the caller's world, which no anchor may replace. */
static void test_a_pose_that_was_set_with_a_covariance_stays_in_its_world(void) {
    static const double sigmas[3] = {1e-4, 0.1, 10};
    for (unsigned k = 0; k < 3; k++)
        for (uint64_t seed = 1; seed <= SEEDS; seed++) {
            imu_rig_begin(IMU_RIG_IN_MOTION, seed);
            place(sigmas[k]);
            for (unsigned frame = 0; frame < 60; frame++) {
                imu_rig_fly(1);
                const imu_rig_errors e = imu_rig_errors_now();
                TEST_ASSERT_TRUE(imu_rig.report.health != PLR_HEALTH_GOOD ||
                                 (e.position < 21 && e.orientation < 21)); /* 1 in 10,000 */
            }
            TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, imu_rig.report.health);
            TEST_ASSERT_TRUE(position_sigma() > sigmas[k]);
        }
}

static plr_landmark known_landmark(void) {
    plr_landmark known = {.id = 9000000, .P_W_m2 = {0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01}};
    for (int i = 0; i < 3; i++)
        known.p_W_m[i] = imu_rig.flight.p_W[0][i];
    return known;
}

static void test_a_known_landmark_keeps_the_anchor_away(void) {
    for (int with_map = 0; with_map < 2; with_map++) {
        imu_rig_begin(IMU_RIG_IN_MOTION, 2);
        const plr_pose pose = true_pose();
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(f, imu_rig.flight.t_ns, &pose, NULL));
        imu_rig_fly(5);
        const plr_landmark known = known_landmark();
        if (with_map)
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_insert_known(f, &known));
        imu_rig_fly(25);
        TEST_ASSERT_EQUAL_INT(with_map, position_sigma() > 0.1);
    }
}

static void test_a_known_landmark_has_to_wait_for_the_start(void) {
    imu_rig_begin(IMU_RIG_AT_REST, 1);
    imu_rig_fly(2);
    const plr_landmark known = known_landmark();
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_insert_known(f, &known));
    TEST_ASSERT_EQUAL_UINT(0, plr_filter_landmark_count(f));
    imu_rig_fly(12);
    TEST_ASSERT_TRUE(f->source.inertial.phase >= PLR_IMU_UNSETTLED);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_insert_known(f, &known));
}

static void test_mapping_with_an_imu_makes_landmarks_at_once(void) {
    imu_rig.config.mode = PLR_MODE_MAPPING;
    imu_flight_start(&imu_rig.flight, &imu_rig.options);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_init(f, &imu_rig.flight.calibration, &imu_rig.config, NULL));
    for (unsigned frame = 0; frame < 10; frame++) {
        double T[16], v[3];
        plr_pose pose;
        imu_rig_readings(IMU_RIG_EVERY);
        imu_flight_truth(&imu_rig.flight, T, v);
        rigid_to_pose(&pose, T);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(f, imu_rig.flight.t_ns, &pose));
        imu_rig_frame();
    }
    TEST_ASSERT_TRUE(plr_filter_landmark_count(f) > 20);
    TEST_ASSERT_TRUE(imu_rig.report.used > 20);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, imu_rig.report.health);
}

static void test_a_jump_of_the_clock_is_no_time_since_the_start(void) {
    const plr_time_ns year = UINT64_C(31557600000000000);
    for (int forth = 0; forth < 2; forth++) {
        imu_rig_begin(IMU_RIG_IN_MOTION, 4);
        imu_rig_fly(15);
        TEST_ASSERT_EQUAL_UINT8(PLR_IMU_UNSETTLED, f->source.inertial.phase);
        const plr_time_ns since = f->belief.t_ns - f->source.inertial.started_ns;
        TEST_ASSERT_EQUAL_INT(PLR_OK,
                              plr_filter_resume(f, forth ? f->belief.t_ns + year : 1, NULL));
        TEST_ASSERT_EQUAL_UINT64(since, f->belief.t_ns - f->source.inertial.started_ns);
        const plr_frame look = imu_flight_look(&imu_rig.flight);
        const plr_frame next = {f->belief.t_ns + 1, PLR_NO_BUDGET, look.count, look.observations};
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(f, &next, NULL));
        TEST_ASSERT_EQUAL_UINT8(PLR_IMU_UNSETTLED,
                                f->source.inertial.phase); /* two seconds have not passed */
    }
}
