// SPDX-License-Identifier: MIT
/*
 * A camera that is turned by a degree beside what T_CB says, and the turn was learnt: a pose that is found
 * anew from known landmarks was off by that degree, since it came by T_CB as it was told.
 */
#include <unity.h>

#include "known_map/find.h"
#include "support/rig.h"
#include "support/rigid.h"

#define TURNED_RAD  0.0175
#define MAP_SIGMA_M 0.02

static bool scene_as_map(void *context, uint32_t id, plr_landmark *landmark) {
    (void)context;
    *landmark = scene_known(&rig.world, id, MAP_SIGMA_M);
    return true;
}

void setUp(void) {
    const double turn[6] = {0, 0, 0, 0, TURNED_RAD, 0};
    double E[16], T[16], told[16];
    rig_set_up();
    rigid_exp(E, turn);
    rigid_from_pose(T, &rig.calibration.T_CB);
    square_multiply(4, E, T, told);
    rigid_to_pose(&rig.calibration.T_CB, told);
    rig.config.calibrate = PLR_CALIBRATE_TURN;
    rig.config.camera_turn_sigma_rad = 0.02;
    rig.config.known_map = 1;
    rig.map.source = scene_as_map;
    rig_begin();
}

static void test_a_pose_is_found_by_the_camera_as_it_is_estimated(void) {
    plr_found_pose found;
    rig_drive(100);
    TEST_ASSERT_DOUBLE_WITHIN(0.002, -TURNED_RAD,
                              (double)rig.filter.camera.estimate.moved[1]); /* y */
    rig_twists();
    const plr_frame frame = scene_look(&rig.world);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
    /* the rows of that frame, which is still here */
    TEST_ASSERT_TRUE(plr_find_pose(&rig.filter.belief, &rig.filter.camera, &rig.filter.map,
                                   rig.filter.work.Vt, &rig.filter.work.sightings, false, &found));
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(0.05, rig.world.T_WB[4 * i + 3], found.p_WB[i]);
        for (int j = 0; j < 3; j++)
            TEST_ASSERT_DOUBLE_WITHIN(0.004, rig.world.T_WB[4 * i + j],
                                      (double)found.R_WB[3 * i + j]);
    }
}
