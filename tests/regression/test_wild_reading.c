// SPDX-License-Identifier: MIT
/*
 * With twist timing `start` a reading is held only when the next one comes. One glitch of a gyro was
 * accepted, and then every later twist and frame was refused, because the glitch could not be held
 * until their time: until the gap grew too long and the map was lost.
 */
#include <unity.h>

#include "support/rig.h"

void setUp(void) {
    rig_set_up();
}

static void test_a_glitch_is_refused_and_the_drive_goes_on(void) {
    const plr_twist glitch = {{0}, {0, 0, 1e4}};
    rig_drive(5);
    rig_twist();
    rig_remember();
    rig_demand_refusal(PLR_E_RANGE, plr_filter_predict(&rig.filter, rig.world.t_ns, &glitch));
    scene_move(&rig.world, RIG_STEP_NS);
    rig_drive(5); /* demands PLR_OK of every twist and frame */
    TEST_ASSERT_GREATER_THAN_UINT(5, rig.report.used);
}

static void test_a_glitch_as_the_first_reading_is_refused_too(void) {
    const plr_twist glitch = {{1e30, 0, 0}, {0}};
    rig_remember();
    rig_demand_refusal(PLR_E_RANGE, plr_filter_predict(&rig.filter, rig.world.t_ns, &glitch));
    rig_drive(3);
}

/* But a quick turn after a pause is no glitch: it is held for as long as readings are. */
static void test_a_fast_reading_after_a_pause_is_taken(void) {
    const plr_twist turning = {{0}, {0, 0, 2.5}};
    rig_drive(3);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_predict(&rig.filter, rig.world.t_ns + 1900000000, &turning));
}
