// SPDX-License-Identifier: MIT
/* plr_filter_inertial and plr_filter_set_velocity: what is refused, for what reason, and that the filter
 * goes on as if it had not come. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/imu_rig.h"
#include "support/specimens.h"

static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_rig_set_up();
}

/* A filter in flight, and the next reading, which it has not seen. */
static plr_imu in_flight(void) {
    imu_rig_begin(IMU_RIG_GIVEN, 7);
    imu_rig_fly(3);
    imu_rig_readings(5);
    imu_flight_move(&imu_rig.flight);
    imu_rig_remember();
    return imu_flight_read(&imu_rig.flight);
}

static plr_status give(const plr_imu *imu) {
    return plr_filter_inertial(f, imu_rig.flight.t_ns, imu);
}

static plr_health_state health_now(void) {
    plr_health_state health;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_health(f, plr_filter_time(f), &health));
    return health;
}

/* Refused for that, which health says until readings have come again for a frame. */
static void demand_fault(plr_status expected, const plr_imu *imu, plr_imu_fault fault) {
    const uint32_t refused = f->totals.twists_refused;
    imu_rig_demand_refusal(expected, give(imu));
    TEST_ASSERT_EQUAL_UINT32(refused + 1, f->totals.twists_refused);
    TEST_ASSERT_EQUAL_INT(fault, plr_filter_imu_fault(f));
    TEST_ASSERT_EQUAL_INT(fault != PLR_IMU_FAULT_NONE,
                          (health_now().reasons & PLR_REASON_IMU_FAULT) != 0);
    TEST_ASSERT_TRUE(health_now().reasons & PLR_REASON_NO_TWISTS);
}

static void demand_recovery(void) {
    imu_rig_readings(IMU_RIG_EVERY);
    imu_rig_frame(); /* this one follows the fault */
    TEST_ASSERT_TRUE(imu_rig.report.reasons & PLR_REASON_IMU_FAULT);
    imu_rig_readings(IMU_RIG_EVERY);
    imu_rig_frame();
    TEST_ASSERT_FALSE(imu_rig.report.reasons & PLR_REASON_IMU_FAULT);
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_NONE, plr_filter_imu_fault(f));
    TEST_ASSERT_EQUAL_HEX32(0, health_now().reasons);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, health_now().health);
}

static void test_null_pointers_and_a_filter_that_is_none(void) {
    static plr_filter none;
    const plr_imu imu = in_flight();
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_inertial(NULL, 1, &imu));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_inertial(f, 1, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_inertial(&none, 1, &imu));
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_NONE, plr_filter_imu_fault(NULL));
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_NONE, plr_filter_imu_fault(&none));
    TEST_ASSERT_TRUE(specimen_same_state(&imu_rig.before, f));
}

static void test_each_process_refuses_the_others_readings(void) {
    const plr_imu imu = in_flight();
    const plr_twist twist = {{1, 0, 0}, {0}};
    imu_rig_demand_refusal(PLR_E_MODE, plr_filter_predict(f, imu_rig.flight.t_ns, &twist));
    imu_rig.config.process = PLR_PROCESS_TWIST;
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_init(f, &imu_rig.flight.calibration, &imu_rig.config, NULL));
    imu_rig_remember();
    imu_rig_demand_refusal(PLR_E_MODE, give(&imu));
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_NONE, plr_filter_imu_fault(f));
}

static void test_numbers_that_are_none(void) {
    for (int i = 0; i < 6; i++) {
        plr_imu imu = in_flight();
        double *number = i < 3 ? &imu.a_B_mps2[i] : &imu.w_B_radps[i - 3];
        *number = i % 2 ? (double)NAN : -(double)INFINITY;
        demand_fault(PLR_E_NOT_FINITE, &imu, PLR_IMU_FAULT_NOT_FINITE);
    }
    demand_recovery();
}

static void test_numbers_that_no_body_survives(void) {
    plr_imu imu = in_flight();
    imu.a_B_mps2[1] = 1e300; /* none of float32 */
    demand_fault(PLR_E_RANGE, &imu, PLR_IMU_FAULT_NONE);
    imu.a_B_mps2[1] = 1e9; /* 1 km within the interval */
    demand_fault(PLR_E_RANGE, &imu, PLR_IMU_FAULT_NONE);
    imu.a_B_mps2[1] = 0;
    imu.w_B_radps[2] = 1300; /* 180 degrees */
    demand_fault(PLR_E_RANGE, &imu, PLR_IMU_FAULT_NONE);
}

static void test_readings_at_the_sensors_limit(void) {
    imu_rig.config.gyro_range_radps = 4.36;
    imu_rig.config.accel_range_mps2 = 39.2;
    static plr_filter copy;
    const plr_imu good = in_flight();
    plr_imu imu = good;
    imu.a_B_mps2[2] = -39.2;
    demand_fault(PLR_E_RANGE, &imu, PLR_IMU_FAULT_SATURATED);
    imu = good;
    imu.w_B_radps[0] = 4.36;
    demand_fault(PLR_E_RANGE, &imu, PLR_IMU_FAULT_SATURATED);
    imu.w_B_radps[0] = 4.35; /* is within */
    copy = *f;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(&copy, imu_rig.flight.t_ns, &imu));
    TEST_ASSERT_EQUAL_INT(PLR_OK, give(&good));
    demand_recovery();
}

static void test_the_same_numbers_ten_times(void) {
    plr_imu imu = in_flight();
    TEST_ASSERT_EQUAL_INT(PLR_OK, give(&imu));
    for (int k = 1; k < 10; k++) {
        imu_flight_move(&imu_rig.flight);
        TEST_ASSERT_EQUAL_INT(PLR_OK, give(&imu));
    }
    imu_flight_move(&imu_rig.flight);
    imu_rig_remember();
    for (int k = 0; k < 3; k++)
        demand_fault(PLR_E_ARGUMENT, &imu, PLR_IMU_FAULT_FROZEN);
    imu_flight_move(&imu_rig.flight);
    imu.a_B_mps2[0] += 0.01;
    TEST_ASSERT_EQUAL_INT(PLR_OK, give(&imu));
    demand_recovery();
}

static void test_a_single_spike_is_refused_and_a_shock_is_not(void) {
    plr_imu imu = in_flight(), spike = imu;
    spike.a_B_mps2[0] = 400;
    demand_fault(PLR_E_RANGE, &spike, PLR_IMU_FAULT_SPIKE);
    imu_flight_move(&imu_rig.flight);
    TEST_ASSERT_EQUAL_INT(PLR_OK, give(&imu));
    demand_recovery();
    imu_flight_move(&imu_rig.flight);
    imu_rig_remember();
    spike = imu;
    spike.w_B_radps[1] = -60;
    demand_fault(PLR_E_RANGE, &spike, PLR_IMU_FAULT_SPIKE);
    demand_fault(PLR_E_RANGE, &spike, PLR_IMU_FAULT_SPIKE);
    TEST_ASSERT_EQUAL_INT(PLR_OK, give(&spike)); /* a third time: it is true */
}

/* What shakes as a whole has no spikes. */
static void test_a_rough_ride_is_no_fault(void) {
    (void)in_flight();
    for (int k = 0; k < 2000; k++) {
        imu_flight_move(&imu_rig.flight);
        plr_imu imu = imu_flight_read(&imu_rig.flight);
        imu.a_B_mps2[2] += (k < 1000 ? 40e-3 * k : 40) * rng_normal(&imu_rig.flight.chance);
        TEST_ASSERT_EQUAL_INT(PLR_OK, give(&imu));
    }
}

static void test_time_that_repeats_or_goes_back_and_a_gap(void) {
    const plr_imu imu = in_flight();
    TEST_ASSERT_EQUAL_INT(PLR_OK, give(&imu));
    imu_rig_remember();
    demand_fault(PLR_E_TIME, &imu, PLR_IMU_FAULT_NONE);
    imu_rig.flight.t_ns -= 1;
    demand_fault(PLR_E_TIME, &imu, PLR_IMU_FAULT_NONE);
    imu_rig.flight.t_ns += UINT64_C(2000000002);
    demand_fault(PLR_E_GAP, &imu, PLR_IMU_FAULT_NONE);
}

static void test_a_reading_before_the_last_frame_is_too_late(void) {
    const plr_imu imu = in_flight();
    imu_flight_move(&imu_rig.flight);
    imu_rig_frame();
    imu_rig.flight.t_ns -= 1000000;
    imu_rig_remember();
    demand_fault(PLR_E_TIME, &imu, PLR_IMU_FAULT_NONE);
}

static void test_a_refused_reading_changes_nothing_that_follows(void) {
    static plr_filter spoilt;
    const plr_imu broken = {{(double)NAN, 0, 0}, {0}};
    (void)in_flight();
    spoilt = *f;
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_FINITE,
                          plr_filter_inertial(&spoilt, imu_rig.flight.t_ns, &broken));
    for (int k = 1; k <= 2 * IMU_RIG_EVERY; k++) {
        const plr_imu imu = imu_rig_read();
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(&spoilt, imu_rig.flight.t_ns, &imu));
        if (k % IMU_RIG_EVERY > 0)
            continue;
        const plr_frame frame = imu_flight_look(&imu_rig.flight);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(f, &frame, NULL));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&spoilt, &frame, NULL));
    }
    spoilt.supervisor.refused_before = f->supervisor.refused_before; /* its count */
    TEST_ASSERT_TRUE(specimen_same_state(f, &spoilt));
}

static void test_mapping_takes_readings_and_does_not_use_them(void) {
    imu_rig.config.mode = PLR_MODE_MAPPING;
    imu_flight_start(&imu_rig.flight, &imu_rig.options);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_init(f, &imu_rig.flight.calibration, &imu_rig.config, NULL));
    imu_rig_remember();
    imu_rig_readings(5);
    TEST_ASSERT_TRUE(specimen_same_state(&imu_rig.before, f));
    TEST_ASSERT_EQUAL_UINT32(5, f->totals.twists);
    TEST_ASSERT_FALSE(health_now().reasons & PLR_REASON_NOT_STARTED);
}

static void test_a_measured_velocity_has_to_wait_for_the_start(void) {
    const plr_reading wheel = {
        .t_ns = 1100000000, .sensor = PLR_SENSOR_WHEEL, .axes = 1, .sigma = {0.1, 0.1, 0.1}};
    imu_rig_begin(IMU_RIG_AT_REST, 1);
    imu_rig_readings(20);
    imu_rig_remember();
    imu_rig_demand_refusal(PLR_E_NOT_READY, plr_filter_measure(f, &wheel, NULL));
    TEST_ASSERT_EQUAL_UINT32(1, f->totals.readings_refused);
}

/* ---------------------------------------------------------------- none is taken any more */

static double position_sigma(void) {
    double P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(f, P));
    return sqrt(P[0] + P[7] + P[14]);
}

static double orientation_sigma(void) {
    double P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(f, P));
    return sqrt(P[21] + P[28] + P[35]);
}

static double error_m(const plr_pose *told) {
    double true_pose[16], v[3], sum = 0;
    imu_flight_truth(&imu_rig.flight, true_pose, v);
    for (unsigned i = 0; i < 3; i++) {
        const double off = told->p[i] - true_pose[4 * i + 3];
        sum += off * off;
    }
    return sqrt(sum);
}

/* The body flies on for so long, and no reading is taken: their clock has started again, so that it ascends, but
 * from 0. */
static void fly_refused(double seconds) {
    const unsigned count = (unsigned)(seconds * 400);
    for (unsigned k = 0; k < count; k++) {
        imu_flight_move(&imu_rig.flight);
        const plr_imu imu = imu_flight_read(&imu_rig.flight);
        TEST_ASSERT_EQUAL_INT(PLR_E_TIME, plr_filter_inertial(f, 1000 + k, &imu));
    }
}

static void test_a_filter_whose_readings_are_refused_grows_with_the_way_that_the_body_goes(void) {
    static const double seconds[] = {2.5, 6, 20};
    for (unsigned i = 0; i < 3; i++) {
        imu_rig_begin(IMU_RIG_GIVEN, 11 + i);
        imu_rig_fly(10);
        const double before = position_sigma();
        const plr_pose told = pose_of(f);
        fly_refused(seconds[i]);
        TEST_ASSERT_TRUE(position_sigma() > 5 * before);
        TEST_ASSERT_TRUE(error_m(&told) < 3 * position_sigma());
        TEST_ASSERT_TRUE(health_now().reasons & PLR_REASON_NO_TWISTS);
        TEST_ASSERT_TRUE(specimen_gives_finite_numbers(f));
    }
    fly_refused(120); /* and not beyond all bounds */
    TEST_ASSERT_TRUE(position_sigma() <= 1.01 * sqrt(3.0) * 1000);
    TEST_ASSERT_TRUE(orientation_sigma() <= 1.01 * sqrt(3.0) * 1.8138);
}

static void test_readings_that_are_doubled_or_late_for_less_than_max_gap_open_nothing(void) {
    imu_rig_begin(IMU_RIG_GIVEN, 5);
    imu_rig_fly(10);
    for (unsigned k = 0; k < 2000; k++) { /* each comes twice, in time */
        const plr_imu imu = imu_rig_read();
        TEST_ASSERT_EQUAL_INT(PLR_E_TIME, plr_filter_inertial(f, imu_rig.flight.t_ns, &imu));
        if (k % IMU_RIG_EVERY == 0)
            imu_rig_frame();
    }
    imu_rig_remember();
    fly_refused(0.9 * imu_rig.config.max_gap_s);
    TEST_ASSERT_TRUE(specimen_same_state(&imu_rig.before, f));
}

/* ---------------------------------------------------------------- set_velocity */

/* A new filter, with a pose or without one. */
static void make_filter(bool pose_given) {
    const plr_pose identity = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    imu_flight_start(&imu_rig.flight, &imu_rig.options);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_init(f, &imu_rig.flight.calibration, &imu_rig.config, NULL));
    if (pose_given)
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(f, imu_rig.flight.t_ns, &identity, NULL));
}

static void test_a_velocity_is_refused_where_it_makes_no_sense(void) {
    static const double v[3] = {1, 2, 3}, good[3] = {0.1, 0.1, 0.1};
    const double nan_v[3] = {1, (double)NAN, 0}, fast[3] = {0, 0, 2e4}, negative[3] = {1, -1e-9, 1};
    const double infinite[3] = {1, 1, (double)INFINITY}, huge[3] = {1, 2e12, 1};
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_set_velocity(NULL, v, good));
    make_filter(false);
    imu_rig_remember();
    imu_rig_demand_refusal(PLR_E_MODE, plr_filter_set_velocity(f, v, good)); /* no pose yet */
    make_filter(true);
    imu_rig_remember();
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_set_velocity(f, NULL, good));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_set_velocity(f, v, NULL));
    imu_rig_demand_refusal(PLR_E_NOT_FINITE, plr_filter_set_velocity(f, nan_v, good));
    imu_rig_demand_refusal(PLR_E_NOT_FINITE, plr_filter_set_velocity(f, v, infinite));
    imu_rig_demand_refusal(PLR_E_RANGE, plr_filter_set_velocity(f, fast, good));
    imu_rig_demand_refusal(PLR_E_RANGE, plr_filter_set_velocity(f, v, huge));
    imu_rig_demand_refusal(PLR_E_ARGUMENT, plr_filter_set_velocity(f, v, negative));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(f, v, good));
    TEST_ASSERT_FALSE(health_now().reasons & PLR_REASON_NOT_STARTED);
    imu_rig_readings(1);
    imu_rig_remember();
    imu_rig_demand_refusal(PLR_E_MODE, plr_filter_set_velocity(f, v, good)); /* it moves */
}

static void test_a_velocity_is_refused_where_there_are_landmarks_or_twists(void) {
    static const double v[3] = {1, 2, 3}, good[3] = {0.1, 0.1, 0.1};
    imu_rig_begin(IMU_RIG_GIVEN, 1);
    imu_rig_fly(2);
    TEST_ASSERT_TRUE(f->belief.count > 0);
    imu_rig_remember();
    imu_rig_demand_refusal(PLR_E_MODE, plr_filter_set_velocity(f, v, good));
    imu_rig.config.process = PLR_PROCESS_TWIST;
    make_filter(true);
    imu_rig_remember();
    imu_rig_demand_refusal(PLR_E_MODE, plr_filter_set_velocity(f, v, good));
}

static void test_a_given_velocity_and_its_covariance_are_the_estimate(void) {
    static const double v[3] = {1, -2, 3}, variance[3] = {0.01, 0.02, 0.03};
    double P_u[36];
    plr_twist got;
    make_filter(true);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(f, v, variance));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity(f, &got));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(f, P_u));
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL_DOUBLE(v[i], got.v_B_mps[i]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-8, variance[i], P_u[7 * i]);
    }
}
