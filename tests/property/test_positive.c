// SPDX-License-Identifier: MIT
/* P stays symmetric and positive through thousands of random frames: turns, outliers, evictions,
 * budgets, pauses. (Packed, P cannot be but symmetric; what comes out of it is looked at.) */
#include <stdio.h>
#include <unity.h>

#include "state/covariance.h"
#include "support/rig.h"

enum { FRAMES = PELORUS_SHORT_FORM ? 1000 : 3000, EVERY = 50 };

static rng chance;

void setUp(void) {
    chance = rng_seeded(58);
    rig_set_up();
}

/* A step of 2 to 60 ms, now and then a second. */
static void drive_some_way(void) {
    const unsigned steps = rng_below(&chance, 12);
    for (unsigned k = 0; k < steps; k++) {
        const plr_twist twist = scene_read(&rig.world);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, rig.world.t_ns, &twist));
        const unsigned ms = rng_below(&chance, 100) ? 2 + rng_below(&chance, 58) : 1000;
        scene_move(&rig.world, (plr_time_ns)ms * 1000000);
    }
}

static void run(void) {
    char at[48];
    rig.options.outliers = 0.05;
    rig.options.landmarks = 400;
    rig.config.slots = 25;
    rig_begin();
    for (unsigned k = 0; k < FRAMES; k++) {
        snprintf(at, sizeof at, "model %u, bias %u, frame %u", rig.config.model, rig.config.bias,
                 k);
        drive_some_way();
        plr_frame frame = scene_look(&rig.world);
        frame.budget = (uint16_t)(rng_below(&chance, 4) ? PLR_NO_BUDGET : rng_below(&chance, 20));
        TEST_ASSERT_EQUAL_INT_MESSAGE(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report),
                                      at);
        TEST_ASSERT_TRUE_MESSAGE(plr_covariance_is_positive(&rig.filter.belief), at);
        if (k % EVERY == EVERY - 1) {
            double P_xi[36];
            TEST_ASSERT_GREATER_THAN_DOUBLE(0, rig_smallest_correlation());
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P_xi));
            for (int i = 0; i < 36; i++)
                TEST_ASSERT_DOUBLE_WITHIN(0, P_xi[i], P_xi[6 * (i % 6) + i / 6]);
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT(100, rig.filter.totals.evicted);
    TEST_ASSERT_GREATER_THAN_UINT(100, rig.filter.totals.gated);
    TEST_ASSERT_GREATER_THAN_UINT(10000, rig.filter.totals.used);
}

static void test_body_stays_positive(void) {
    for (uint8_t bias = 0; bias < 2; bias++) {
        rig.config.bias = bias;
        run();
    }
}

static void test_world_stays_positive_in_double(void) {
    if (PLR_REAL == 32)
        TEST_IGNORE_MESSAGE("world is not for float32: docs/NUMERICS.md");
    rig.config.model = PLR_MODEL_WORLD;
    run();
}
