// SPDX-License-Identifier: MIT
/*
 * Localization from a pose that was only roughly known: the predicted pixels of every known landmark
 * had a sigma beyond a focal length, the gate took them for no basis of a linearisation, and nothing
 * was left that could have told the pose.
 */
#include <unity.h>

#include "support/rig.h"
#include "support/rigid.h"

/* float32 does not hold a start known to a radian beside a map known to a centimetre:
 * docs/NUMERICS.md. */
#define MAP_SIGMA_M 0.1

static bool scene_as_map(void *context, uint32_t id, plr_landmark *landmark) {
    (void)context;
    *landmark = scene_known(&rig.world, id, MAP_SIGMA_M);
    return true;
}

void setUp(void) {
    rig_set_up();
}

/* The filter believes in a pose that is off by xi, to sigma m and rad. */
static void start_off_by(const double xi[6], double sigma) {
    double M[16], P[36] = {0};
    plr_pose rough;
    rigid_exp(M, xi);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            rough.R[3 * i + j] = M[4 * i + j];
        rough.p[i] = M[4 * i + 3];
    }
    for (int i = 0; i < 36; i += 7)
        P[i] = sigma * sigma;
    rig.config.mode = PLR_MODE_LOCALIZATION;
    rig.map.source = scene_as_map;
    rig_begin();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&rig.filter, rig.world.t_ns, &rough, P));
}

static void check_finds_its_place(const double xi[6], double sigma) {
    start_off_by(xi, sigma);
    rig_frame();
    TEST_ASSERT_TRUE(rig.report.used > 10);
    rig_drive(30);
    const plr_pose pose = pose_of(&rig.filter);
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(0.2, rig.world.T_WB[4 * i + 3], pose.p[i]);
        for (int j = 0; j < 3; j++)
            TEST_ASSERT_DOUBLE_WITHIN(0.02, rig.world.T_WB[4 * i + j], pose.R[3 * i + j]);
    }
}

static void test_a_map_tells_a_pose_that_was_known_to_radians(void) {
    const double xi[6] = {0.5, -0.3, 0.2, 0.05, -0.04, 0.15};
    check_finds_its_place(xi, 1.5);
    check_finds_its_place(xi, 2);
}
