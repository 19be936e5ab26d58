// SPDX-License-Identifier: MIT
/* Two filters of different settings, called in turn, compute what each computes alone. */
#include <string.h>
#include <unity.h>

#include "support/rig.h"
#include "support/specimens.h"

enum { FRAMES = 20 };

static plr_filter together[2], alone[2];
static scene worlds[2];
static plr_config configs[2];

void setUp(void) {
    for (int which = 0; which < 2; which++) {
        plr_config_default(&configs[which]);
        configs[which].slots = which ? 8 : 30;
        configs[which].bias = (uint8_t)which;
        configs[which].model = (uint8_t)which;
    }
}

static void begin(plr_filter *f, int which) {
    scene_options options;
    scene_options_default(&options);
    options.seed = (uint64_t)which + 7;
    scene_start(&worlds[which], &options);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_init(f, &worlds[which].calibration, &configs[which], NULL));
}

/* One twist, and a frame at every tenth. */
static void step(plr_filter *f, int which, unsigned k) {
    scene *world = &worlds[which];
    const plr_twist twist = scene_read(world);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(f, world->t_ns, &twist));
    scene_move(world, RIG_STEP_NS);
    if (k % RIG_TWISTS == RIG_TWISTS - 1) {
        const plr_frame frame = scene_look(world);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(f, &frame, NULL));
    }
}

static void test_two_filters_do_not_influence_one_another(void) {
    for (int which = 0; which < 2; which++) {
        begin(&alone[which], which);
        for (unsigned k = 0; k < FRAMES * RIG_TWISTS; k++)
            step(&alone[which], which, k);
    }
    begin(&together[0], 0);
    begin(&together[1], 1);
    for (unsigned k = 0; k < FRAMES * RIG_TWISTS; k++) {
        step(&together[0], 0, k);
        step(&together[1], 1, k);
    }
    TEST_ASSERT_TRUE(specimen_same_state(&alone[0], &together[0]));
    TEST_ASSERT_TRUE(specimen_same_state(&alone[1], &together[1]));
    TEST_ASSERT_FALSE(alone[0].belief.count == alone[1].belief.count);
}
