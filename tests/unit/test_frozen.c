// SPDX-License-Identifier: MIT
/* A picture that is sent again and again (MATH 13): told where the body moves, and used where it stands. */
#include <math.h>
#include <unity.h>

#include "support/rig.h"

void setUp(void) {
    rig_set_up();
    rig.config.pixel_sigma_px = 1;
    rig_begin();
    rig_drive(20);
}

/* The picture of the last look, at another time. */
static void show_again(plr_frame frame) {
    frame.t_ns = rig.world.t_ns;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
}

static void test_a_picture_that_is_sent_again_does_not_hold_a_moving_body(void) {
    double e[6];
    const plr_frame frozen = scene_look(&rig.world);
    show_again(frozen);
    for (int k = 0; k < 10; k++) {
        rig_twists();
        show_again(frozen);
        if (k >= 1) {
            TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_FROZEN_IMAGE);
            TEST_ASSERT_EQUAL_UINT16(0, rig.report.used);
        }
    }
    (void)rig_squared_error(e);
    TEST_ASSERT_TRUE(hypot(hypot(e[0], e[1]), e[2]) < 0.4); /* of 2 m */
    rig_drive(1);                                           /* new pixels */
    TEST_ASSERT_FALSE(rig.report.reasons & PLR_REASON_FROZEN_IMAGE);
    TEST_ASSERT_GREATER_THAN_UINT(3, rig.report.used);
}

static void test_a_body_that_stands_may_see_the_same_picture(void) {
    const plr_frame same = scene_look(&rig.world);
    for (int k = 0; k < 10; k++) {
        rig_twists_in_place(0);
        show_again(same);
        TEST_ASSERT_FALSE(rig.report.reasons & PLR_REASON_FROZEN_IMAGE);
        TEST_ASSERT_GREATER_THAN_UINT(3, rig.report.used);
    }
}
