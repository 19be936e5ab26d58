// SPDX-License-Identifier: MIT
/*
 * Wheels whose encoders are dead were contradicted, and still shortened the way by 3 %: their noise was
 * taken for larger by too little. And in dead reckoning plr_filter_health said for ever that too few
 * observations are used.
 */
#include <math.h>
#include <unity.h>

#include "support/rig.h"

void setUp(void) {
    rig_set_up();
}

static double error_m(void) {
    double sum = 0;
    const plr_pose pose = pose_of(&rig.filter);
    for (int i = 0; i < 3; i++)
        sum += pow(pose.p[i] - rig.world.T_WB[4 * i + 3], 2);
    return sqrt(sum);
}

static void test_dead_wheels_do_not_shorten_the_way(void) {
    rig.options.most_seen = 20;
    rig.options.pixel_sigma_px = rig.config.pixel_sigma_px = 2;
    rig_begin();
    rig_drive(30);
    rig_drive_told(200, 0); /* 40 m; it was 2.2 m */
    TEST_ASSERT_LESS_THAN_DOUBLE(1.5, error_m());
}

static void test_dead_reckoning_is_good_without_observations(void) {
    rig.config.mode = PLR_MODE_DEAD_RECKONING;
    rig_begin();
    rig_drive(20);
    plr_health_state health;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_health(&rig.filter, rig.world.t_ns, &health));
    TEST_ASSERT_EQUAL_HEX32(0, health.reasons);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, health.health);
}
