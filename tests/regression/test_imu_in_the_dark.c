// SPDX-License-Identifier: MIT
/* What an outside harness found of flights with an IMU: landmarks of before a long darkness dragged
 * those of after it along when the first frames corrected the position by metres; and an IMU whose
 * readings no longer came was held on to until the pose had left for kilometres, with good pictures
 * all the while. */
#include <math.h>
#include <stdio.h>
#include <unity.h>

#include "support/imu_rig.h"

enum {
    SEEDS = PELORUS_SHORT_FORM ? 1 : 3,
    RETURNS = PELORUS_SHORT_FORM ? 1 : 8,
    BEFORE = PELORUS_SHORT_FORM ? 100 : 250 /* frames */
};

void setUp(void) {
    imu_rig_set_up();
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

/* Half a minute without a picture, metres of drift, and then points of before, by their ids. Some were
 * used where no projection is linear, and others pulled those along that the frame saw for the first
 * time: one flight in two ended a hundred sigma off, and GOOD. */
static void test_points_of_before_a_long_darkness_do_not_mislead(void) {
    for (uint64_t seed = 1; seed <= RETURNS; seed++) {
        imu_rig_begin(IMU_RIG_GIVEN, seed);
        imu_rig_fly(BEFORE);
        imu_rig_readings(250 * IMU_RIG_EVERY);
        for (unsigned frame = 0; frame < 60; frame++) {
            imu_rig_fly(1);
            TEST_ASSERT_TRUE(imu_rig.report.health != PLR_HEALTH_GOOD ||
                             imu_rig_errors_now().position < 32); /* 1 in 2 million */
        }
        const imu_rig_errors e = imu_rig_errors_now();
        TEST_ASSERT_TRUE(e.position < 21 && e.orientation < 21 && e.velocity < 21);
    }
}

/* The same, but what was seen before comes into sight a second after other points: then the drift is no
 * more in the motion of one frame but in the landmarks. */
static void test_points_of_before_that_come_late_do_not_mislead(void) {
    static plr_observation seen[PLR_MAX_OBSERVATIONS];
    for (uint64_t seed = 1; seed <= RETURNS; seed++) {
        imu_rig_begin(IMU_RIG_GIVEN, seed);
        imu_rig_fly(BEFORE);
        const uint32_t first_new = imu_rig.flight.next_id;
        imu_rig_readings(200 * IMU_RIG_EVERY);
        for (unsigned frame = 0; frame < 60; frame++) {
            imu_rig_readings(IMU_RIG_EVERY);
            plr_frame look = imu_flight_look(&imu_rig.flight);
            uint16_t count = 0;
            for (unsigned i = 0; i < look.count; i++)
                if (frame >= 10 || look.observations[i].id >= first_new)
                    seen[count++] = look.observations[i];
            look.count = count;
            look.observations = seen;
            TEST_ASSERT_EQUAL_INT(PLR_OK,
                                  plr_filter_update(&imu_rig.filter, &look, &imu_rig.report));
            TEST_ASSERT_TRUE(imu_rig.report.health != PLR_HEALTH_GOOD ||
                             imu_rig_errors_now().position < 32);
        }
    }
}
