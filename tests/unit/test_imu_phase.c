// SPDX-License-Identifier: MIT
/* The start of an IMU from phase to phase: each arrow of docs/DESIGN.md, and no other. */
#include <unity.h>

#include "process/imu_phase.h"

static void test_every_trigger_leads_where_it_should_from_every_phase(void) {
    enum { ALIGNS, IN_WORLD, UNSETTLED, UNSETTLED_IN_WORLD, SETTLED, TRIGGERS = 5 };
    /* world given, starts at rest, moving, as told; anchors */
    static const uint8_t to[PLR_IMU_PHASES][TRIGGERS] = {
        [ALIGNS] = {IN_WORLD, SETTLED, UNSETTLED, SETTLED, ALIGNS},
        [IN_WORLD] = {IN_WORLD, SETTLED, UNSETTLED_IN_WORLD, SETTLED, IN_WORLD},
        [UNSETTLED] = {UNSETTLED_IN_WORLD, UNSETTLED, UNSETTLED, SETTLED, SETTLED},
        [UNSETTLED_IN_WORLD] = {UNSETTLED_IN_WORLD, UNSETTLED_IN_WORLD, UNSETTLED_IN_WORLD, SETTLED,
                                SETTLED},
        [SETTLED] = {SETTLED, SETTLED, SETTLED, SETTLED, SETTLED},
    };
    for (unsigned from = 0; from < PLR_IMU_PHASES; from++)
        for (unsigned trigger = 0; trigger < TRIGGERS; trigger++) {
            plr_inertial s = {.phase = (uint8_t)from};
            plr_imu_phase_change(&s, (plr_imu_trigger)trigger);
            TEST_ASSERT_EQUAL_UINT8(to[from][trigger], s.phase);
        }
}
