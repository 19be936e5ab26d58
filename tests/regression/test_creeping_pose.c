// SPDX-License-Identifier: MIT
/*
 * A robot that stood for a day went astray by half a metre, with health GOOD. What a frame corrects there is
 * the camera's motion, which all landmarks share, and most of it is what earlier frames have left; but
 * no more than this frame's own share was applied as a rigid motion. The rest went to each landmark through
 * its chart, where it is right to first order only: landmarks and pose moved apart by a micrometre
 * a frame, always the same way.
 */
#include <unity.h>

#include "support/axes.h"
#include "support/rig.h"

enum { LANDMARKS = 12, SETTLE = 3000, FRAMES = 20000 };

void setUp(void) {
    rig_set_up();
    rig.options.speed_mps = rig.options.turn_radps = rig.options.sway = 0;
    rig.options.most_seen = LANDMARKS;
}

/* Where the landmarks stand in the world, in the mean. */
static void centre(double p[3]) {
    const unsigned count = plr_filter_landmark_count(&rig.filter);
    TEST_ASSERT_EQUAL_UINT(LANDMARKS, count);
    p[0] = p[1] = p[2] = 0;
    for (unsigned slot = 0; slot < count; slot++) {
        plr_landmark landmark;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&rig.filter, slot, &landmark));
        for (int i = 0; i < 3; i++)
            p[i] += landmark.p_W_m[i] / count;
    }
}

/* With bad twists, and told to be so, the corrections are large, and what they leave to second order shows in
 * half an hour: 4 cm. The pixels are exact, or the ranges would still be settling. */
static void test_landmarks_and_pose_do_not_move_apart(void) {
    double before[3], after[3];
    rig.options.velocity_sigma_mps = 0.3;
    rig.options.gyro_sigma_radps = 0.03;
    rig.options.range_m = 15;
    rig.options.pixel_sigma_px = 0;
    each_axis(rig.config.velocity_sigma, 0.3);
    each_axis(rig.config.gyro_sigma, 0.03);
    rig.config.pixel_sigma_px = 5;
    rig.config.bias = 0;
    rig_begin();
    rig_stand(SETTLE);
    centre(before);
    rig_stand(FRAMES);
    centre(after);
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(0.015, before[i], after[i]);
}
