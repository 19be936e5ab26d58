// SPDX-License-Identifier: MIT
/* The cabin of a ship or a bus turns, and camera and IMU are in it: the pictures show the cabin alone, the gyro the turn,
 * too. Once the pictures had been followed, the gyro still said where the accelerometers point and the pose turns, and
 * what it was off went into the velocity: 5 to 90 m. */
#include <math.h>
#include <stdio.h>
#include <unity.h>

#include "support/imu_rig.h"

enum { SECOND = 10 /* frames */ };

static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_rig_set_up();
}

/* Flies so many frames in a cabin that turns about the vertical; returns the worst error of position, m. */
static double fly(unsigned frames, double rate_radps) {
    double worst = 0;
    for (unsigned k = 1; k <= frames * IMU_RIG_EVERY; k++) {
        double T_WB[16], v[3];
        imu_flight_move(&imu_rig.flight);
        imu_flight_truth(&imu_rig.flight, T_WB, v);
        plr_imu imu = imu_flight_read(&imu_rig.flight);
        for (int i = 0; i < 3; i++)
            imu.w_B_radps[i] += rate_radps * T_WB[8 + i];
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(f, imu_rig.flight.t_ns, &imu));
        if (k % IMU_RIG_EVERY != 0)
            continue;
        imu_rig_frame();
        worst = fmax(worst, imu_rig_errors_now().metres);
    }
    return worst;
}

static void demand_stays_in_the_cabin(double rate_radps, unsigned seconds, uint64_t seed) {
    imu_rig_begin(IMU_RIG_GIVEN, seed);
    (void)fly(10 * SECOND, 0);
    const double waiting = fly(SECOND, rate_radps); /* for 0.8 s the IMU is believed */
    const double turning = fly((seconds - 1) * SECOND, rate_radps), after = fly(10 * SECOND, 0);
    printf("%g rad/s for %u s: %.2f, %.2f and %.2f m\n", rate_radps, seconds, waiting, turning,
           after);
    TEST_ASSERT_TRUE(turning < 0.5 && after < 0.3);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, imu_rig.report.health);
    TEST_ASSERT_EQUAL_UINT32(0, f->totals.recoveries);
}

static void test_a_cabin_that_turns_leaves_the_pose_in_the_cabin_right_to_decimetres(void) {
    demand_stays_in_the_cabin(0.2, 8, 1);
    demand_stays_in_the_cabin(-0.4, 5, 2);
    demand_stays_in_the_cabin(0.7, 3, 3);
}
