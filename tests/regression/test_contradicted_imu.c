// SPDX-License-Identifier: MIT
/* An IMU that is wrong for minutes on end, while the pictures show a body that stands. With each frame the
 * velocity's sigma grew about ten times, to 1e15 m/s and to no number at all. */
#include <math.h>
#include <stdio.h>
#include <unity.h>

#include "support/imu_rig.h"

enum { SECOND = 10 /* frames */, SECONDS = PELORUS_SHORT_FORM ? 30 : 120 };

static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_rig_set_up();
    imu_rig.options.rest_s = 2 * SECONDS;
    imu_rig.options.most_seen = 8;
}

/* Frames every `every` readings, of which each is wrong by this. */
static void stand(unsigned frames, unsigned every, const double a_mps2[3], double w_radps) {
    for (unsigned k = 1; k <= frames * every; k++) {
        imu_flight_move(&imu_rig.flight);
        plr_imu imu = imu_flight_read(&imu_rig.flight);
        for (int i = 0; i < 3; i++)
            imu.a_B_mps2[i] += a_mps2[i];
        imu.w_B_radps[1] += w_radps;
        (void)plr_filter_inertial(f, imu_rig.flight.t_ns, &imu);
        if (k % every == 0)
            imu_rig_frame();
    }
}

static void demand_finite(const double a_mps2[3], double w_radps, unsigned every) {
    static const double right[3] = {0};
    double worst = 0;
    imu_rig_begin(IMU_RIG_GIVEN, 1);
    stand(5 * SECOND, every, right, 0);
    for (unsigned k = 0; k < SECONDS * SECOND; k++) {
        double P[36];
        stand(1, every, a_mps2, w_radps);
        TEST_ASSERT_EQUAL_UINT32(0, f->totals.recoveries);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(f, P));
        worst = fmax(worst, sqrt(P[0] + P[7] + P[14]));
    }
    printf("wrong by %g m/s^2 and %g rad/s, a frame in %u readings: sigma of v up to %.3g m/s\n",
           a_mps2[0], w_radps, every, worst);
    TEST_ASSERT_TRUE(worst < 1000);
}

static void test_the_velocity_of_a_contradicted_imu_stays_a_number(void) {
    demand_finite((const double[]){2, 0, 0}, 0, 40);
    demand_finite((const double[]){5, 0, 0}, 0.5, 40);
    demand_finite((const double[]){5, 3, 0}, 2, 10);
}
