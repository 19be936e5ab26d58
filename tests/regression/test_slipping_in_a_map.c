// SPDX-License-Identifier: MIT
/*
 * Wheels that slip in localization: each known landmark was judged by itself from the pose that the wheels
 * told, so the gate rejected them all, and nothing said that the twists were contradicted. The motion is
 * searched for, as in slam.
 */
#include <unity.h>

#include "support/rig.h"

static bool source(void *context, uint32_t id, plr_landmark *landmark) {
    *landmark = scene_known(context, id, 0.02);
    return true;
}

void setUp(void) {
    rig_set_up();
    rig.map = (plr_map){.context = &rig.world, .source = source};
    rig_begin_with(PLR_MODE_LOCALIZATION, true);
    rig_drive(30);
}

static void test_the_map_contradicts_wheels_that_slip_and_the_covariance_covers_both(void) {
    for (int k = 0; k < 30; k++) {
        double e[6];
        rig_drive_told(1, 0.8);
        if (k < 4) /* told in the fourth frame, and covered from the next one on */
            continue;
        TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_TWIST_CONTRADICTED);
        TEST_ASSERT_LESS_THAN_DOUBLE(40, rig_squared_error(e));
    }
}

static void test_a_true_drive_is_as_it_was(void) {
    for (int k = 0; k < 60; k++) {
        double e[6];
        rig_drive(1);
        TEST_ASSERT_LESS_THAN_DOUBLE(30, rig_squared_error(e));
        TEST_ASSERT_FALSE(rig.report.reasons & PLR_REASON_TWIST_CONTRADICTED);
    }
}
