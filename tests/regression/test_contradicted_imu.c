// SPDX-License-Identifier: MIT
/* Pictures that say for minutes what an IMU does not: all that is seen swings to and fro before a body that
 * stands. With each frame the velocity's sigma grew ten times, to 1e15 m/s and to no number at all. */
#include <math.h>
#include <stdio.h>
#include <unity.h>

#include "support/imu_rig.h"

enum { SECOND = 10 /* frames */, SECONDS = PELORUS_SHORT_FORM ? 30 : 120 };
static const double TURN = 1.5; /* of the swing, rad/s */

static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_rig_set_up();
    imu_rig.options.rest_s = 2 * SECONDS;
}

static void swing(unsigned frame, double speed_mps) {
    const double step_m = speed_mps / SECOND * cos(TURN * frame / SECOND);
    for (unsigned i = 0; i < IMU_FLIGHT_POINTS; i++)
        imu_rig.flight.p_W[i][1] += step_m;
}

static void demand_finite(double speed_mps) {
    double worst = 0;
    imu_rig_begin(IMU_RIG_GIVEN, 1);
    imu_rig_fly(5 * SECOND);
    for (unsigned k = 0; k < SECONDS * SECOND; k++) {
        double P[36];
        swing(k, speed_mps);
        imu_rig_fly(1);
        TEST_ASSERT_EQUAL_UINT32(0, f->totals.recoveries);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(f, P));
        worst = fmax(worst, sqrt(P[0] + P[7] + P[14]));
    }
    printf("a scene at %g m/s: sigma of v up to %.3g m/s, GOOD at the end: %u\n", speed_mps, worst,
           imu_rig.report.health == PLR_HEALTH_GOOD);
    TEST_ASSERT_TRUE(worst < 100);
}

static void test_the_velocity_of_a_contradicted_imu_stays_a_number(void) {
    demand_finite(0.3);
    demand_finite(1);
    demand_finite(3);
}
