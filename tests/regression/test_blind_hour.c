// SPDX-License-Identifier: MIT
/*
 * An hour of twists without a used observation: the rotation was made one again only after a
 * correction, so that float32 steps bent it, and the motion accumulated for the landmarks, by a
 * hundredth. The map came back a hundredth larger.
 */
#include <math.h>
#include <unity.h>

#include "support/rig.h"

enum { HOUR = 360000 };

void setUp(void) {
    rig_set_up();
}

/* A robot that turns on the spot in the dark, at 100 Hz. */
static void turn_for_an_hour(void) {
    const plr_twist turning = {{0}, {0.1, -0.3, 0.5}};
    plr_time_ns t_ns = plr_filter_time(&rig.filter);
    for (int k = 0; k < HOUR; k++) {
        t_ns += RIG_STEP_NS;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, t_ns, &turning));
    }
}

static void test_the_rotation_is_one_after_an_hour_in_the_dark(void) {
    turn_for_an_hour();
    const plr_pose pose = pose_of(&rig.filter);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double dot = 0;
            for (int k = 0; k < 3; k++)
                dot += pose.R[3 * i + k] * pose.R[3 * j + k];
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, i == j, dot);
        }
}

static double distance_of_first_landmark(void) {
    double sum = 0;
    for (int i = 0; i < 3; i++)
        sum += (double)rig.filter.belief.slots[0].x[i] * (double)rig.filter.belief.slots[0].x[i];
    return sqrt(sum);
}

static void test_landmarks_are_as_far_away_as_before(void) {
    /* the camera in the body's origin: turning leaves every distance as it is */
    for (int i = 0; i < 3; i++)
        rig.calibration.T_CB.p[i] = 0;
    rig_begin();
    rig_frame();
    const double before = distance_of_first_landmark();
    turn_for_an_hour();
    /* a new point needs the map where the body is: it applies the hour, and tells nothing of it */
    const plr_observation point = {1, 400, 300, 380, 300};
    const plr_frame frame = {plr_filter_time(&rig.filter), PLR_NO_BUDGET, 1, &point};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
    TEST_ASSERT_EQUAL_UINT16(1, rig.report.created);
    TEST_ASSERT_EQUAL_UINT8(0, rig.filter.motion.pending);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4 * before, before, distance_of_first_landmark());
}
