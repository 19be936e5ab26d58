// SPDX-License-Identifier: MIT
/* Where the two models must agree: they differ in where they linearise, so at one linearisation
 * point, and without motion, they are one filter. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/matrices.h"
#include "support/rig.h"
#include "support/specimens.h"

static plr_filter filters[2]; /* body, world */

void setUp(void) {
    rig_set_up();
    rig.config.start_sigma = 0.02;
}

static void begin_both(void) {
    rig_begin();
    for (uint8_t model = 0; model < 2; model++) {
        rig.config.model = model;
        TEST_ASSERT_EQUAL_INT(
            PLR_OK, plr_filter_init(&filters[model], &rig.calibration, &rig.config, NULL));
    }
}

static void look(plr_report reports[2]) {
    const plr_frame frame = scene_look(&rig.world);
    for (int model = 0; model < 2; model++)
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filters[model], &frame, &reports[model]));
}

/* Landmarks of the two in the world: places within so many metres, covariances within that part. */
static void demand_same_landmarks(double metres, double part) {
    const unsigned count = plr_filter_landmark_count(&filters[0]);
    TEST_ASSERT_GREATER_THAN_UINT(8, count);
    TEST_ASSERT_EQUAL_UINT(count, plr_filter_landmark_count(&filters[1]));
    for (unsigned slot = 0; slot < count; slot++) {
        plr_landmark a, b;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&filters[0], slot, &a));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&filters[1], slot, &b));
        TEST_ASSERT_EQUAL_UINT32(a.id, b.id);
        TEST_ASSERT_DOUBLE_WITHIN(metres, 0, largest_difference(a.p_W_m, b.p_W_m, 3));
        TEST_ASSERT_DOUBLE_WITHIN(part, 0, specimen_gap(3, a.P_W_m2, b.P_W_m2));
    }
}

static void demand_same_poses(double metres, double radians, double part) {
    plr_pose pose[2];
    double P[2][36];
    for (int model = 0; model < 2; model++) {
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose(&filters[model], &pose[model]));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&filters[model], P[model]));
    }
    TEST_ASSERT_DOUBLE_WITHIN(metres, 0, largest_difference(pose[0].p, pose[1].p, 3));
    TEST_ASSERT_DOUBLE_WITHIN(radians, 0, largest_difference(pose[0].R, pose[1].R, 9));
    TEST_ASSERT_DOUBLE_WITHIN(part, 0, specimen_gap(6, P[0], P[1]));
}

static void test_after_the_first_frame_landmarks_are_the_same(void) {
    plr_report reports[2];
    begin_both();
    look(reports);
    TEST_ASSERT_EQUAL_UINT16(reports[0].created, reports[1].created);
    demand_same_landmarks(1e-12 + 200 * REAL_EPSILON, 1e-10 + 1000 * REAL_EPSILON);
    demand_same_poses(0, 0, 0);
}

/* The second frame is linearised at the very estimate that the first has left. What is of second
 * order in the correction stays small by pixels that agree to a ten-thousandth (and are float). */
static void test_without_motion_a_second_frame_changes_both_alike(void) {
    plr_report reports[2];
    rig.options.pixel_sigma_px = 1e-4;
    begin_both();
    look(reports);
    look(reports);
    TEST_ASSERT_GREATER_THAN_UINT(8, reports[0].used);
    TEST_ASSERT_EQUAL_UINT16(reports[0].used, reports[1].used);
    const double rounding = PLR_REAL == 32 ? 3e-2 : 0; /* of `world`, docs/NUMERICS.md */
    demand_same_landmarks(1e-5 + 100 * REAL_EPSILON, 1e-3 + rounding);
    demand_same_poses(1e-6 + 100 * REAL_EPSILON, 1e-6 + 100 * REAL_EPSILON, 1e-4 + rounding);
}

/* Drives blindly, then has the birth of a landmark apply the motion. */
static void drive_blindly(void) {
    plr_report reports[2];
    begin_both();
    look(reports);
    for (int k = 0; k < 100; k++) {
        const plr_twist twist = scene_read(&rig.world);
        for (int model = 0; model < 2; model++)
            TEST_ASSERT_EQUAL_INT(PLR_OK,
                                  plr_filter_predict(&filters[model], rig.world.t_ns, &twist));
        scene_move(&rig.world, RIG_STEP_NS);
    }
    demand_same_poses(0, 0, 0);
    const plr_observation unknown = {99, 400, 300, 390, 300, 0};
    const plr_frame frame = {plr_filter_time(&filters[0]), 1, 1, &unknown};
    for (int model = 0; model < 2; model++) {
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filters[model], &frame, NULL));
        TEST_ASSERT_EQUAL_UINT8(0, filters[model].motion.pending);
    }
}

/* Motion alone is the same for both: the pose's block does not know the landmarks. */
static void test_by_prediction_alone_poses_are_the_same(void) {
    rig.config.bias = 0;
    drive_blindly();
    demand_same_poses(0, 2 * REAL_EPSILON, 1e-12 + 100 * REAL_EPSILON);
    demand_same_landmarks(1e-12 + 2000 * REAL_EPSILON, 1e-9 + 1e4 * REAL_EPSILON);
}

/* With biases, `body` charges a ten-thousandth of what they make of the motion as noise besides. */
static void test_by_prediction_with_biases_poses_differ_by_the_share_that_is_charged(void) {
    rig.config.bias = 1;
    drive_blindly();
    demand_same_poses(0, 2 * REAL_EPSILON, 1e-4 + 100 * REAL_EPSILON);
    demand_same_landmarks(1e-12 + 2000 * REAL_EPSILON, 1e-4 + 1e4 * REAL_EPSILON);
}
