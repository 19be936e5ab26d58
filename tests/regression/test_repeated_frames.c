// SPDX-License-Identifier: MIT
/* A camera that repeats a frame now and then. Each repeated one was left out, and put the pose in doubt for the next 15
 * frames: GOOD in 17 of 778. */
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "support/imu_rig.h"

enum { FRAMES = 300 };

static plr_filter *const f = &imu_rig.filter;
static plr_observation last[PLR_MAX_OBSERVATIONS];
static uint16_t count;

void setUp(void) {
    imu_rig_set_up();
}

static void look(bool repeats) {
    const plr_frame seen = imu_flight_look(&imu_rig.flight);
    const plr_frame old = {seen.t_ns, PLR_NO_BUDGET, count, last};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(f, repeats ? &old : &seen, &imu_rig.report));
    if (repeats)
        return;
    count = seen.count;
    memcpy(last, seen.observations, count * sizeof *last);
}

/* Returns how many of the frames that are new are GOOD; every `every`th repeats the one before. */
static unsigned good_of_new(unsigned every, uint64_t seed) {
    unsigned good = 0, left_out = 0, repeated = 0;
    imu_rig_begin(IMU_RIG_GIVEN, seed);
    imu_rig_fly(60);
    for (unsigned k = 1; k <= FRAMES; k++) {
        const bool repeats = k % every == 0;
        imu_rig_readings(IMU_RIG_EVERY);
        look(repeats);
        repeated += repeats;
        left_out += repeats && (imu_rig.report.reasons & PLR_REASON_FROZEN_IMAGE) != 0;
        good += !repeats && imu_rig.report.health == PLR_HEALTH_GOOD;
    }
    printf("every %uth repeats: %u of %u new frames GOOD, %u of %u left out, %.3f m\n", every, good,
           FRAMES - repeated, left_out, repeated, imu_rig_errors_now().metres);
    TEST_ASSERT_EQUAL_UINT(repeated, left_out);
    TEST_ASSERT_TRUE(imu_rig_errors_now().metres < 0.2);
    return good;
}

static void test_a_repeated_frame_is_left_out_and_the_next_one_is_good(void) {
    TEST_ASSERT_TRUE(good_of_new(12, 1) > 270);
    TEST_ASSERT_TRUE(good_of_new(5, 2) > 230);
}
