// SPDX-License-Identifier: MIT
/* What an outside harness found of flights with an IMU: landmarks of before a long darkness dragged
 * those of after it along when the first frames corrected the position by metres; and an IMU whose
 * readings no longer came was held on to until the pose had left for kilometres, with good pictures
 * all the while. */
#include <math.h>
#include <stdio.h>
#include <unity.h>

#include "support/imu_rig.h"

enum { SEEDS = PELORUS_SLOW_BUILD ? 1 : 3 };

void setUp(void) {
    imu_rig_set_up();
}

void tearDown(void) {
}

/* A frame of which nothing is seen. */
static void dark_frame(void) {
    const plr_frame frame = {imu_rig.flight.t_ns, PLR_NO_BUDGET, 0, NULL};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&imu_rig.filter, &frame, &imu_rig.report));
}

static void test_after_a_long_darkness_the_first_frames_find_the_velocity(void) {
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        imu_rig_begin(IMU_RIG_GIVEN, seed);
        imu_rig_fly(50);
        for (unsigned frame = 0; frame < 200; frame++) {
            imu_rig_readings(IMU_RIG_EVERY);
            dark_frame();
        }
        const double astray = imu_rig_errors_now().metres;
        imu_rig_fly(30);
        const imu_rig_errors e = imu_rig_errors_now();
        TEST_ASSERT_TRUE(e.position < 21 && e.orientation < 21 &&
                         e.velocity < 21); /* 1 in 10,000 */
        TEST_ASSERT_TRUE(e.mps < 0.1);
        TEST_ASSERT_TRUE(e.metres < astray + 0.5);
        TEST_ASSERT_EQUAL_UINT16(imu_rig.report.matched - imu_rig.report.gated,
                                 imu_rig.report.used);
        TEST_ASSERT_TRUE(4 * imu_rig.report.gated < imu_rig.report.matched);
    }
}

static void test_without_an_imu_the_pictures_lead_on(void) {
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        imu_rig_begin(IMU_RIG_GIVEN, seed);
        imu_rig_fly(50);
        for (unsigned frame = 0; frame < 150; frame++) {
            for (unsigned k = 0; k < IMU_RIG_EVERY; k++)
                imu_rig_lose();
            imu_rig_frame();
            TEST_ASSERT_TRUE(imu_rig.report.health != PLR_HEALTH_GOOD);
        }
        const imu_rig_errors e = imu_rig_errors_now();
        TEST_ASSERT_TRUE(e.metres < 0.5);
        TEST_ASSERT_TRUE(e.position < 21 && e.orientation < 21);
        imu_rig_fly(50); /* and it is taken up again where it comes back */
        TEST_ASSERT_TRUE(imu_rig_errors_now().metres < 0.5);
        TEST_ASSERT_FALSE(imu_rig.report.reasons & PLR_REASON_NO_TWISTS);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_after_a_long_darkness_the_first_frames_find_the_velocity);
    RUN_TEST(test_without_an_imu_the_pictures_lead_on);
    return UNITY_END();
}
