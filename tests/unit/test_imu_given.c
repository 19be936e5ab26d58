// SPDX-License-Identifier: MIT
/* After a start from a state that is given nobody has averaged readings at rest: what does not fit
 * gravity is found in their mean (process/alignment.h). */
#include <unity.h>

#include "support/imu_rig.h"

enum { PER_FRAME = 40 };

static unsigned per_frame;

static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    per_frame = PER_FRAME;
    imu_rig_set_up();
}

static void start(void) {
    static const plr_pose pose = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {1, 2, 3}};
    static const double still[3] = {0}, variance[3] = {0.01, 0.01, 0.01};
    imu_flight_start(&imu_rig.flight, &imu_rig.options);
    const plr_calibration calibration = imu_rig.flight.calibration;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(f, &calibration, &imu_rig.config, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(f, 1000000000, &pose, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(f, still, variance));
}

/* Readings about these means at 400 Hz, and a frame without observations after each `per_frame`. */
static uint32_t reasons_after(unsigned frames, const double a[3], const double w[3]) {
    rng chance = rng_seeded(411);
    plr_report report = {0};
    const plr_time_ns begin = plr_filter_time(f);
    for (unsigned n = 1; n <= frames * per_frame; n++) {
        const plr_time_ns t_ns = begin + n * UINT64_C(2500000);
        plr_imu imu;
        for (int i = 0; i < 3; i++) {
            imu.a_B_mps2[i] = a[i] + 0.02 * rng_normal(&chance);
            imu.w_B_radps[i] = w[i] + 0.002 * rng_normal(&chance);
        }
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(f, t_ns, &imu));
        const plr_frame frame = {.t_ns = t_ns, .budget = PLR_NO_BUDGET};
        if (n % per_frame == 0)
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(f, &frame, &report));
    }
    return report.reasons;
}

static void demand(plr_imu_fault fault, const double a[3], const double w[3]) {
    start();
    (void)reasons_after(9, a, w);
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_NONE, plr_filter_imu_fault(f));
    start();
    const uint32_t reasons = reasons_after(20, a, w);
    TEST_ASSERT_EQUAL_INT(fault, plr_filter_imu_fault(f));
    TEST_ASSERT_EQUAL_INT(fault != PLR_IMU_FAULT_NONE, (reasons & PLR_REASON_IMU_FAULT) != 0);
}

static const double slow[3] = {0.1, 0, 0};

static void test_an_accelerometer_in_g_is_told(void) {
    demand(PLR_IMU_FAULT_IN_G, (const double[]){0.1, 0, 1}, slow);
}

static void test_a_force_that_is_not_gravity_is_told(void) {
    demand(PLR_IMU_FAULT_NOT_GRAVITY, (const double[]){0, 0, 0.5 * 9.81}, slow);
    demand(PLR_IMU_FAULT_NOT_GRAVITY, (const double[]){0, 0, 3 * 9.81}, slow);
}

/* It was a shock. */
static void test_a_force_that_is_gravity_again_is_no_fault_any_more(void) {
    const double hit[3] = {11, -7, 33}, up[3] = {0, 0, 9.81};
    demand(PLR_IMU_FAULT_NOT_GRAVITY, hit, slow);
    TEST_ASSERT_TRUE(reasons_after(6, up, slow) & PLR_REASON_IMU_FAULT);
    TEST_ASSERT_FALSE(reasons_after(20, up, slow) & PLR_REASON_IMU_FAULT);
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_NONE, plr_filter_imu_fault(f));
}

static void test_a_wrong_sign_is_told(void) {
    demand(PLR_IMU_FAULT_UPSIDE_DOWN, (const double[]){0.5, 0, -9.81}, slow);
}

static void test_swapped_axes_are_told(void) {
    demand(PLR_IMU_FAULT_TILT, (const double[]){9.81, 0, 0.3}, slow);
}

/* 80 frames a second: what lasts for half a second is a motion, and no fault, however many frames it
 * has. */
static void test_a_fault_lasts_for_a_second_at_any_rate_of_frames(void) {
    const double sideways[3] = {9.81, 0, 0.3};
    per_frame = 5;
    start();
    (void)reasons_after(65, sideways, slow); /* the mean has turned after some 0.3 s */
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_NONE, plr_filter_imu_fault(f));
    start();
    (void)reasons_after(150, sideways, slow);
    TEST_ASSERT_EQUAL_INT(PLR_IMU_FAULT_TILT, plr_filter_imu_fault(f));
}

static void test_a_gyro_in_degrees_is_told(void) {
    demand(PLR_IMU_FAULT_TURNS, (const double[]){0.5, 0.2, 9.81}, (const double[]){6, 3, 12});
}

static void test_thrust_and_a_fall_and_a_spin_are_no_faults(void) {
    demand(PLR_IMU_FAULT_NONE, (const double[]){3, 2, 9.81}, slow);
    demand(PLR_IMU_FAULT_NONE, (const double[]){0, 0, 0.1}, slow);
    demand(PLR_IMU_FAULT_NONE, (const double[]){0, 0, 9.81}, (const double[]){0, 0, 5});
}
