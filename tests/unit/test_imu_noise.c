// SPDX-License-Identifier: MIT
/* The noise of an IMU's readings as the filter takes it: as stated, or as they scatter; and what a doubt makes
 * of the velocity (docs/MATH.md 19). */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "state/motion.h"
#include "support/imu_rig.h"

static plr_filter *const f = &imu_rig.filter;
static rng chance;

void setUp(void) {
    imu_rig_set_up();
    chance = rng_seeded(431);
    imu_rig_begin(IMU_RIG_GIVEN, 7);
}

/* So many readings of a body that stands, with white noise of these sigmas and a slow swing. */
static void feed(unsigned count, double force, double rate, double swing) {
    const plr_time_ns begin = plr_filter_time(f);
    for (unsigned k = 1; k <= count; k++) {
        plr_imu imu;
        const double s = 2 * 3.14159265 * 1.5 * k / 400;
        for (int i = 0; i < 3; i++) {
            imu.a_B_mps2[i] =
                9.81 * (double)f->R_WB[6 + i] + swing * sin(s) + force * rng_normal(&chance);
            imu.w_B_radps[i] = 0.1 * swing * cos(s) + rate * rng_normal(&chance);
        }
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(f, begin + UINT64_C(2500000) * k, &imu));
    }
}

static double scatter(unsigned which) {
    return sqrt((double)f->inertial.scatter2[which]);
}

static void test_scatter_is_the_noise_of_a_reading_and_not_the_motion(void) {
    feed(400, 0.3, 0.04, 2);
    TEST_ASSERT_DOUBLE_WITHIN(0.25 * 0.3, 0.3, scatter(0));
    TEST_ASSERT_DOUBLE_WITHIN(0.25 * 0.04, 0.04, scatter(1));
    feed(800, 1e-4, 1e-5, 2);
    TEST_ASSERT_TRUE(scatter(0) < 0.02 && scatter(1) < 0.002);
}

/* The variance that the rate's noise gives the turn in a while, beside what is stated. */
static double turned(double rate) {
    imu_rig_begin(IMU_RIG_GIVEN, 7);
    feed(300, 0.01, rate, 0);
    const double before = (double)f->motion.Q[21];
    feed(40, 0.01, rate, 0);
    const double density = imu_rig.options.gyro_noise * imu_rig.options.gyro_noise;
    return ((double)f->motion.Q[21] - before) / (0.1 * density);
}

static void test_noise_is_as_stated_unless_the_readings_scatter_by_more_than_twice_that(void) {
    const double stated = imu_rig.options.gyro_noise * sqrt(400);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1, turned(stated));
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1, turned(0.1 * stated));
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1, turned(1.6 * stated));
    TEST_ASSERT_DOUBLE_WITHIN(6, 25, turned(10 * stated));
}

/* ---------------------------------------------------------------- a doubt */

enum { JOINT = 9 };

/* The joint covariance of n and v, 9 x 9. */
static void joint(double C[JOINT * JOINT]) {
    const plr_core_motion *m = &f->core_motion;
    for (int i = 0; i < JOINT; i++)
        for (int j = 0; j < JOINT; j++) {
            const int r = i < j ? i : j, c = i < j ? j : i;
            C[JOINT * i + j] = c < 6   ? (double)f->motion.Q[6 * r + c]
                               : r < 6 ? (double)m->Q_nc[PLR_REST_DIM * r + c - 6]
                                       : (double)m->Q_cc[PLR_REST_DIM * (r - 6) + c - 6];
        }
}

static void test_a_doubt_of_the_way_is_one_of_the_velocity(void) {
    double before[JOINT * JOINT], after[JOINT * JOINT];
    const double weight = 30;
    feed(20, 0.1, 0.01, 0);
    joint(before);
    const plr_real bias = f->core_motion.Q_cc[(PLR_REST_DIM + 1) * 4];
    plr_motion_weigh_velocity(f, 1);
    joint(after);
    TEST_ASSERT_EQUAL_MEMORY(before, after, sizeof after);
    plr_motion_weigh_velocity(f, (plr_real)weight);
    joint(after);
    for (int i = 6; i < JOINT; i++)
        TEST_ASSERT_TRUE(after[(JOINT + 1) * i] >= weight * weight * before[(JOINT + 1) * i]);
    TEST_ASSERT_EQUAL_MEMORY(&bias, &f->core_motion.Q_cc[(PLR_REST_DIM + 1) * 4], sizeof bias);
}

/* White noise that makes 0.3 m of the way leaves a quarter of the velocity's variance when the way is known. */
static void test_an_open_way_tells_three_quarters_of_the_velocity(void) {
    double C[JOINT * JOINT];
    const double seconds = 20 * 0.0025;
    feed(20, 0.01, 0.001, 0);
    memset(f->inertial.velocity, 0, sizeof f->inertial.velocity); /* what a turn makes of it */
    plr_motion_open_velocity(f);
    f->motion.Q[0] += PLR_R(0.09);
    joint(C);
    const double v2 = C[(JOINT + 1) * 6];
    TEST_ASSERT_DOUBLE_WITHIN(0.2 * 0.27, 0.27, v2 * seconds * seconds);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0.25, 1 - C[6] * C[6] / (C[0] * v2));
}
