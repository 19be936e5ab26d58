// SPDX-License-Identifier: MIT
/*
 * A question once applied the motion that was still being accumulated: whoever asked for a landmark or
 * for the trace between two frames had other bits from there on than one who did not, and float32 was
 * rounded once more by each question. A question changes nothing; neither does a landmark that is asked
 * for and does not exist.
 */
#include <stdio.h>
#include <unity.h>

#include "support/rig.h"
#include "support/specimens.h"

enum { FRAMES = 30 };

static plr_filter quiet;

void setUp(void) {
    rig_set_up();
}

static void ask_everything(void) {
    plr_landmark landmark;
    TEST_ASSERT_TRUE(specimen_gives_finite_numbers(&rig.filter)); /* asks for all there is */
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT,
                          plr_filter_landmark(&rig.filter, rig.filter.belief.count, &landmark));
}

static void demand_same(unsigned frame) {
    char at[48];
    snprintf(at, sizeof at, "model %d, bias %d, frame %u", rig.config.model, rig.config.bias,
             frame);
    TEST_ASSERT_TRUE_MESSAGE(specimen_same_state(&quiet, &rig.filter), at);
}

static void drive_both(void) {
    rig_begin();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&quiet, &rig.calibration, &rig.config, &rig.map));
    for (unsigned frame = 0; frame < FRAMES; frame++) {
        for (unsigned i = 0; i < RIG_TWISTS; i++) {
            const plr_twist twist = scene_read(&rig.world);
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&quiet, rig.world.t_ns, &twist));
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, rig.world.t_ns, &twist));
            scene_move(&rig.world, RIG_STEP_NS);
            ask_everything();
            demand_same(frame);
        }
        const plr_frame seen = scene_look(&rig.world);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&quiet, &seen, NULL));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &seen, &rig.report));
        ask_everything();
        demand_same(frame);
    }
    TEST_ASSERT_GREATER_THAN_UINT(8, rig.report.used);
}

static void test_a_filter_that_is_asked_computes_the_bits_of_one_that_is_not(void) {
    for (int run = 0; run < 4; run++) {
        rig.config.model = (uint8_t)(run % 2);
        rig.config.bias = (uint8_t)(run / 2);
        drive_both();
    }
}
