// SPDX-License-Identifier: MIT
/* The noise of an IMU's readings as the filter takes it: as stated, or as they scatter; and what a doubt makes
 * of the velocity (docs/MATH.md 19). */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "process/imu_noise.h"
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
                9.81 * (double)f->belief.R_WB[6 + i] + swing * sin(s) + force * rng_normal(&chance);
            imu.w_B_radps[i] = 0.1 * swing * cos(s) + rate * rng_normal(&chance);
        }
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(f, begin + UINT64_C(2500000) * k, &imu));
    }
}

static double scatter(unsigned which) {
    return sqrt((double)f->source.inertial.scatter2[which]);
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

static void test_noise_is_as_stated_unless_the_readings_scatter_by_more(void) {
    const double stated = imu_rig.options.gyro_noise * sqrt(400);
    TEST_ASSERT_DOUBLE_WITHIN(0.25, 1.1, turned(stated));
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1, turned(0.1 * stated));
    TEST_ASSERT_DOUBLE_WITHIN(0.65, 2.6, turned(1.6 * stated));
    TEST_ASSERT_DOUBLE_WITHIN(25, 100, turned(10 * stated));
}

/* ---------------------------------------------------------------- two ways to carry it */

static void demand_same(const plr_real *a, const plr_real *b, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        TEST_ASSERT_TRUE(a[i] >= b[i] && a[i] <= b[i]);
}

static void test_blocks_and_whole_rows_carry_the_noise_to_the_same_numbers(void) {
    static plr_motion rows, blocks;
    plr_real F[PLR_CORE_MOVED * PLR_CORE_DIM], reading[2];
    feed(30, 0.3, 0.04, 2);
    rows = blocks = f->motion;
    for (unsigned step = 0; step < 20; step++) {
        for (unsigned i = 0; i < PLR_CORE_MOVED * PLR_CORE_DIM; i++)
            F[i] = (plr_real)(0.4 * rng_normal(&chance));
        reading[0] = (plr_real)rng_uniform(&chance, 0, 1);
        reading[1] = (plr_real)rng_uniform(&chance, 0, 1);
        plr_imu_carry_in_rows(&rows, F, reading);
        plr_imu_carry_by_blocks(&blocks, F, reading);
        demand_same(rows.Q, blocks.Q, PLR_POSE_SQUARE);
        demand_same(rows.core.Q_nc, blocks.core.Q_nc, PLR_POSE_DIM * PLR_REST_DIM);
        demand_same(rows.core.Q_cc, blocks.core.Q_cc, PLR_REST_DIM * PLR_REST_DIM);
    }
}
