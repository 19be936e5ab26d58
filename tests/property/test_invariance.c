// SPDX-License-Identifier: MIT
/* `body` does not know where the world's frame lies: the same data from another start give the same
 * landmarks and the same covariance, to the bit. `world` does know. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "state/covariance.h"
#include "support/matrices.h"
#include "support/rig.h"
#include "support/rigid.h"

enum { FRAMES = 40 };

static plr_filter moved;

void setUp(void) {
    rig_set_up();
}

/* Drives two filters by the same data, one from identity and one from `start`. */
static void drive(const plr_pose *start) {
    double P[36] = {0};
    for (int i = 0; i < 6; i++)
        P[7 * i] = 1e-4;
    rig_begin();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&moved, &rig.calibration, &rig.config, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_set_pose(&rig.filter, rig.world.t_ns, &rig_identity, P));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&moved, rig.world.t_ns, start, P));
    for (unsigned k = 0; k < FRAMES; k++) {
        for (unsigned i = 0; i < RIG_TWISTS; i++) {
            const plr_twist twist = scene_read(&rig.world);
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, rig.world.t_ns, &twist));
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&moved, rig.world.t_ns, &twist));
            scene_move(&rig.world, RIG_STEP_NS);
        }
        const plr_frame frame = scene_look(&rig.world);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, NULL));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&moved, &frame, NULL));
    }
}

static void some_start(plr_pose *start) {
    rng chance = rng_seeded(57);
    random_rotation(&chance, start->R);
    rng_normals(&chance, 500, start->p, 3);
}

static bool same_covariance(void) {
    const unsigned n = plr_covariance_dim(&rig.filter.belief);
    return moved.belief.count == rig.filter.belief.count &&
           same_bits(rig.filter.belief.P, moved.belief.P, n * (n + 1) / 2);
}

static void check_body(bool bias) {
    plr_pose start;
    some_start(&start);
    rig.config.bias = bias;
    drive(&start);
    TEST_ASSERT_GREATER_THAN_UINT(10, rig.filter.belief.count);
    TEST_ASSERT_TRUE(same_covariance());
    for (unsigned slot = 0; slot < moved.belief.count; slot++)
        TEST_ASSERT_TRUE(same_bits(rig.filter.belief.slots[slot].x, moved.belief.slots[slot].x, 3));
    TEST_ASSERT_TRUE(same_bits(rig.filter.belief.bias, moved.belief.bias, 6));

    /* and the poses are the same drive, seen from another frame */
    double A[16], B[16], G[16], GA[16];
    const plr_pose a = pose_of(&rig.filter);
    const plr_pose b = pose_of(&moved);
    rigid_from_pose(A, &a);
    rigid_from_pose(B, &b);
    rigid_from_pose(G, &start);
    square_multiply(4, G, A, GA);
    TEST_ASSERT_DOUBLE_WITHIN(2000 * REAL_EPSILON + 1e-12, 0, largest_difference(GA, B, 16));
}

static void test_body_is_the_same_from_every_start(void) {
    check_body(false);
    check_body(true);
}

/* So that the test above is one: the other model computes with world coordinates. */
static void test_world_is_not(void) {
    plr_pose start;
    some_start(&start);
    rig.config.model = PLR_MODEL_WORLD;
    drive(&start);
    TEST_ASSERT_FALSE(same_covariance());
}
