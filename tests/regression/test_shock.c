// SPDX-License-Identifier: MIT
/* A hard landing: for a while the accelerometer reads what the body does not do, and the pictures are as good as
 * ever. The reading was believed, and with it a velocity and a bias that were wrong by more than any frame could
 * correct: the filter was metres off, and DEGRADED to the end. */
#include <stdio.h>
#include <unity.h>

#include "support/imu_rig.h"

enum { SECOND = 10 /* frames */, READINGS_PER_SECOND = 400 };
enum { SEEDS = PELORUS_SHORT_FORM ? 1 : 4 };

void setUp(void) {
    imu_rig_set_up();
}

/* So many frames; the first readings are off by this. */
static void fly(unsigned frames, const double hit_mps2[3], unsigned readings) {
    for (unsigned k = 0; k < frames * IMU_RIG_EVERY; k++) {
        imu_flight_move(&imu_rig.flight);
        plr_imu imu = imu_flight_read(&imu_rig.flight);
        for (int i = 0; i < 3 && k < readings; i++)
            imu.a_B_mps2[i] += hit_mps2[i];
        TEST_ASSERT_EQUAL_INT(PLR_OK,
                              plr_filter_inertial(&imu_rig.filter, imu_rig.flight.t_ns, &imu));
        if ((k + 1) % IMU_RIG_EVERY == 0)
            imu_rig_frame();
    }
}

/* What is left so many frames after a hit, and whether the filter is GOOD again. */
static void demand_recovery(const double hit_mps2[3], double seconds, unsigned after,
                            double most_m) {
    static const double none[3] = {0};
    char what[80];
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        imu_rig_begin(IMU_RIG_GIVEN, seed);
        fly(4 * SECOND, none, 0);
        const unsigned frames = (unsigned)(seconds * SECOND) + 1;
        fly(frames, hit_mps2, (unsigned)(seconds * READINGS_PER_SECOND));
        fly(after, none, 0);
        const imu_rig_errors e = imu_rig_errors_now();
        snprintf(what, sizeof what, "%g s, seed %u: %.3f m, %.3f m/s, health %u", seconds,
                 (unsigned)seed, e.metres, e.mps, imu_rig.report.health);
        TEST_ASSERT_TRUE_MESSAGE(e.metres < most_m, what);
        TEST_ASSERT_TRUE_MESSAGE(e.mps < 0.05, what);
        TEST_ASSERT_EQUAL_INT_MESSAGE(PLR_HEALTH_GOOD, imu_rig.report.health, what);
    }
}

static void test_after_a_shock_the_points_win_and_all_is_good_again(void) {
    demand_recovery((const double[]){0, 0, 46}, 0.15, SECOND, 0.05);
    demand_recovery((const double[]){-17, 9, 22}, 0.4, SECOND, 0.05);
    demand_recovery((const double[]){24, -11, 5}, 0.9, SECOND, 0.05);
}

/* Less than a body does: the pictures have to contradict it first. */
static void test_a_force_that_a_body_could_feel_is_contradicted_and_then_the_same(void) {
    demand_recovery((const double[]){5.5, 0, 3}, 0.35, 4 * SECOND, 0.3);
    demand_recovery((const double[]){0, -7, 0}, 0.8, 4 * SECOND, 0.3);
}
