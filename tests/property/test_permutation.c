// SPDX-License-Identifier: MIT
/* The order in which a frame's observations arrive changes no bit. */
#include <string.h>
#include <unity.h>

#include "support/rig.h"
#include "support/specimens.h"

enum { FRAMES = 40 };

static plr_filter shuffled;
static plr_report reports[2];
static plr_observation order[SCENE_MAX_SEEN];
static rng chance;

void setUp(void) {
    chance = rng_seeded(56);
    rig_set_up();
}

static void shuffle(plr_observation *x, unsigned n) {
    for (unsigned i = n; i > 1; i--) {
        const unsigned j = rng_below(&chance, i);
        const plr_observation swapped = x[i - 1];
        x[i - 1] = x[j];
        x[j] = swapped;
    }
}

static void run(void) {
    rig_begin();
    memcpy(&shuffled, &rig.filter, sizeof shuffled);
    for (unsigned k = 0; k < FRAMES; k++) {
        for (unsigned i = 0; i < RIG_TWISTS; i++) {
            const plr_twist twist = scene_read(&rig.world);
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, rig.world.t_ns, &twist));
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&shuffled, rig.world.t_ns, &twist));
            scene_move(&rig.world, RIG_STEP_NS);
        }
        plr_frame frame = scene_look(&rig.world);
        frame.budget = k % 3 == 2 ? 7 : PLR_NO_BUDGET;
        if (k % 5 == 4) { /* doubled and malformed ones among them */
            rig.world.seen[3].id = rig.world.seen[1].id;
            rig.world.seen[2].vL_px = 1e9F;
        }
        memcpy(order, frame.observations, frame.count * sizeof *order);
        shuffle(order, frame.count);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &reports[0]));
        frame.observations = order;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&shuffled, &frame, &reports[1]));
        TEST_ASSERT_EQUAL_MEMORY(&reports[0], &reports[1], sizeof reports[0]);
        TEST_ASSERT_TRUE(specimen_same_state(&rig.filter, &shuffled));
    }
    TEST_ASSERT_GREATER_THAN_UINT(0, rig.filter.totals.evicted);
    TEST_ASSERT_GREATER_THAN_UINT(0, rig.filter.totals.gated);
}

static void test_shuffled_observations_give_the_same_bits(void) {
    rig.options.outliers = 0.1;
    rig.config.slots = 12;
    for (int kind = 0; kind < 4; kind++) {
        rig.config.model = (uint8_t)(kind % 2);
        rig.config.bias = (uint8_t)(kind / 2);
        run();
    }
}

/* New ids too: which of them find a slot does not hang on their place in the frame. */
static void test_shuffled_new_ids_take_the_same_slots(void) {
    rig.config.slots = 5;
    rig_begin();
    memcpy(&shuffled, &rig.filter, sizeof shuffled);
    plr_frame frame = scene_look(&rig.world);
    memcpy(order, frame.observations, frame.count * sizeof *order);
    shuffle(order, frame.count);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, NULL));
    frame.observations = order;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&shuffled, &frame, NULL));
    TEST_ASSERT_EQUAL_UINT(5, rig.filter.belief.count);
    TEST_ASSERT_TRUE(specimen_same_state(&rig.filter, &shuffled));
}
