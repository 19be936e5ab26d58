// SPDX-License-Identifier: MIT
/*
 * Odometry fell silent, and the body drove on by its camera. The last twist went on being held, vision
 * contradicted it, and the pose by that twist, which nobody claimed any more, counted as one that the
 * true one could be: after half a minute the covariance said 84 m where the pose was 0.4 m off.
 */
#include <unity.h>

#include "support/rig.h"

enum { SILENT_FRAMES = 300, AGAIN_FRAMES = 100 };

void setUp(void) {
    rig_set_up();
}

static void test_a_twist_that_nobody_sends_any_more_is_no_rival_of_vision(void) {
    double e[6];
    rig_begin();
    rig_drive(30);
    rig.world.is.speed_mps /= 2; /* the last twist that came said otherwise */
    for (unsigned k = 0; k < SILENT_FRAMES; k++) {
        scene_move(&rig.world, RIG_TWISTS * RIG_STEP_NS);
        rig_frame();
        TEST_ASSERT_TRUE(k < 3 || rig.report.health != PLR_HEALTH_GOOD);
    }
    TEST_ASSERT_GREATER_THAN_UINT32(0, rig.filter.totals.contradictions);
    TEST_ASSERT_LESS_THAN_DOUBLE(1.5, rig_sigma_m());
    TEST_ASSERT_LESS_THAN_DOUBLE(6 * 5 * 5, rig_squared_error(e));
    rig_drive(AGAIN_FRAMES);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, rig.report.health);
    TEST_ASSERT_LESS_THAN_DOUBLE(1.5, rig_sigma_m());
}
