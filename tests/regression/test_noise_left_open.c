// SPDX-License-Identifier: MIT
/*
 * A frame keeps its motion's noise outside of P until its observations are in. Where the filter diverged
 * in between, that noise stayed open in the workspace: after a new pose from outside the next frame put
 * it, and a correction of long ago, into an estimate that had nothing to do with it. A filter recovers
 * from divergence by itself now, in the same frame: it must leave nothing open either.
 */
#include <string.h>
#include <unity.h>

#include "math/packed.h"
#include "state/covariance.h"
#include "support/reseal.h"
#include "support/rig.h"

void setUp(void) {
    rig_set_up();
}

static void test_a_pose_set_after_divergence_is_kept_by_the_next_frame(void) {
    static const plr_pose there = {{0, -1, 0, 1, 0, 0, 0, 0, 1}, {5, -3, 2}};
    double P[36] = {0}, as_set[36], after[36];
    for (int bias = 0; bias < 2; bias++) {
        rig.config.bias = (uint8_t)bias;
        rig_begin();
        rig_drive(5);
        rig_twist();
        rig_twist();
        const unsigned row = plr_covariance_row(&rig.filter.belief, 0);
        rig.filter.belief.P[plr_packed_at(row, row)] = -1; /* found when the motion is applied */
        reseal(&rig.filter);
        plr_frame frame = scene_look(&rig.world);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
        TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_RECOVERED);
        TEST_ASSERT_EQUAL_UINT8(0, rig.filter.work.noise.open);

        for (int i = 0; i < 6; i++)
            P[7 * i] = 0.01;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&rig.filter, frame.t_ns, &there, P));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, as_set));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
        const plr_pose pose = pose_of(&rig.filter);
        TEST_ASSERT_EQUAL_MEMORY(&there, &pose, sizeof pose);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, after));
        for (int i = 0; i < 36; i++)
            TEST_ASSERT_EQUAL_DOUBLE(as_set[i], after[i]);
        for (int i = 0; i < 36; i++)
            TEST_ASSERT_DOUBLE_WITHIN(16 * (double)PLR_EPSILON * P[i], P[i], after[i]);
    }
}
