// SPDX-License-Identifier: MIT
/*
 * Localization under the course's gate of fixed pixels. Once the pose was off by more than the gate,
 * every known landmark was turned away, and so was it after each unlocking: the gate knew nothing of
 * the growing covariance. On Starry Night the filter was blind from 8.7 s on, to the end.
 */
#include <math.h>
#include <unity.h>

#include "support/rig.h"

enum { LOCK_FRAMES = 10 };

static bool scene_as_map(void *context, uint32_t id, plr_landmark *landmark) {
    (void)context;
    *landmark = scene_known(&rig.world, id, 0.1);
    return true;
}

void setUp(void) {
    rig_set_up();
    rig.config.mode = PLR_MODE_LOCALIZATION;
    rig.config.gate_residual_px = 20;
    rig.map.source = scene_as_map;
}

/* The filter believes in a place beside the true one and looks 0.12 rad past it, which moves every
 * point by more than the gate; it knows by how much it may be wrong. */
static void start_beside_the_place(void) {
    const double sigma = 0.15;
    plr_pose beside = {{0.9928, -0.1197, 0, 0.1197, 0.9928, 0, 0, 0, 1}, {0.2, -0.1, 0.1}};
    double P[36] = {0};
    beside.R[0] = beside.R[4] = sqrt(1 - beside.R[3] * beside.R[3]);
    for (int i = 0; i < 6; i++)
        P[7 * i] = sigma * sigma;
    rig_begin();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&rig.filter, rig.world.t_ns, &beside, P));
}

static void check_is_at_its_place(void) {
    const plr_pose pose = pose_of(&rig.filter);
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(0.2, rig.world.T_WB[4 * i + 3], pose.p[i]);
}

static void check_comes_back(uint8_t model) {
    rig.config.model = model;
    start_beside_the_place();
    rig_drive(LOCK_FRAMES); /* the gate of 20 px turns away nearly all */
    TEST_ASSERT_TRUE(rig.report.reasons & (PLR_REASON_GATE_LOCKED | PLR_REASON_NO_OBSERVATIONS));
    rig_drive(1);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(3, rig.report.used);
    rig_drive(2 * LOCK_FRAMES);
    check_is_at_its_place();
    TEST_ASSERT_GREATER_THAN_UINT(rig.report.gated, rig.report.used);
}

static void test_a_locked_gate_of_fixed_pixels_opens_for_known_landmarks(void) {
    check_comes_back(PLR_MODEL_WORLD);
}

/* Few matches say nothing about a gate: it is the frames without one used that count. */
static void test_it_opens_where_few_are_seen(void) {
    rig.options.most_seen = 4;
    check_comes_back(PLR_MODEL_WORLD);
}

/* They tell the pose before the gate judges by a wrong one (filter/relocate.h). */
static void test_body_finds_its_place_before_the_gate_can_lock(void) {
    for (unsigned seen = 3; seen <= 24; seen += 7) {
        rig.options.most_seen = seen;
        start_beside_the_place();
        rig_drive(1);
        check_is_at_its_place();
        TEST_ASSERT_GREATER_OR_EQUAL_UINT(seen < 10 ? seen : 10, rig.report.used);
    }
}
