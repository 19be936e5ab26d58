// SPDX-License-Identifier: MIT
/*
 * Two fifths of all points moved together, as those of a lorry that crosses. The gate rejected them, but Huber's function only
 * bounds the pull of a point on the search for the motion: theirs added up, moved the motion aside by a sigma of
 * each of the others, and the gate then rejected these as well.
 */
#include <math.h>
#include <unity.h>

#include "support/rig.h"

enum { FRAMES = 40 };

void setUp(void) {
    rig_set_up();
    rig.options.velocity_sigma_mps = 0.3;
    rig.options.gyro_sigma_radps = 0.05;
    for (int i = 0; i < 3; i++)
        rig.config.velocity_sigma[i] = 0.3, rig.config.gyro_sigma[i] = 0.05;
}

/* Moves the first `of_five` of every five points to the side, metres. */
static void move_points(unsigned of_five, double m) {
    for (unsigned i = 0; i < rig.options.landmarks; i++)
        if (i % 5 < of_five)
            rig.world.p_W[i][1] += m;
}

/* Frames with such points; returns the greatest error of the position, m. */
static double worst_error(unsigned of_five) {
    double worst = 0;
    rig_begin();
    rig_drive(10);
    for (int k = 0; k < FRAMES; k++) {
        move_points(of_five, 0.2);
        rig_drive(1);
        plr_pose pose, truth;
        TEST_ASSERT_EQUAL(PLR_OK, plr_filter_pose(&rig.filter, &pose));
        scene_pose(&rig.world, &truth);
        double e2 = 0;
        for (int i = 0; i < 3; i++)
            e2 += (pose.p[i] - truth.p[i]) * (pose.p[i] - truth.p[i]);
        worst = fmax(worst, sqrt(e2));
    }
    return worst;
}

static void test_points_that_move_alike_do_not_take_the_pose_along(void) {
    const double alone = worst_error(0), beside = worst_error(2);
    TEST_ASSERT_LESS_THAN_DOUBLE(1.4 * alone, beside); /* 1.7 times when their pulls counted */
}
