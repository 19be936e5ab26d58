// SPDX-License-Identifier: MIT
/*
 * While twists are contradicted, a frame takes their noise for larger. A frame that used nothing left
 * the motion pending with that larger noise, and the next one enlarged it again: a camera that went dark
 * in the middle of a contradiction made the pose's covariance grow without end, and within seconds it
 * was no number.
 */
#include <unity.h>

#include "support/rig.h"

enum { DARK_FRAMES = 300 };

void setUp(void) {
    rig_set_up();
}

static void test_the_dark_after_a_contradiction_widens_by_the_twists_noise_alone(void) {
    rig.config.bias = 0;
    rig_begin();
    rig_drive(30);
    rig_drive_told(10, 0.5); /* the wheels slip */
    TEST_ASSERT_EQUAL_UINT8(PLR_DOUBT_CONTRADICTED, rig.filter.supervisor.doubt);
    const double before = rig_sigma_m();
    for (unsigned k = 0; k < DARK_FRAMES; k++) {
        rig_twists();
        const plr_frame dark = {.t_ns = rig.world.t_ns, .budget = 1};
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &dark, &rig.report));
        TEST_ASSERT_EQUAL_UINT32(0, rig.filter.totals.recoveries);
    }
    /* half a minute at 0.05 m/s and 0.01 rad/s, each reading on its own, on a way of 60 m */
    TEST_ASSERT_LESS_THAN_DOUBLE(2 * before + 2, rig_sigma_m());
}
