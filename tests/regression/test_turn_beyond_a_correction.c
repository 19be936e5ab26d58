// SPDX-License-Identifier: MIT
/* A gyro that read 10 rad/s too much for half a minute left a covariance of dozens of radians. In it the search
 * for a frame's motion found a turn that the series of Exp cannot follow, the rotation was none any more,
 * and from then on every call said that the memory was damaged. Such a frame diverges now, and
 * the filter recovers. */
#include <string.h>
#include <unity.h>

#include "filter/guard.h"
#include "filter/predict.h"
#include "state/motion.h"
#include "support/specimens.h"

static plr_filter filter;
static plr_applied_motion found;

void setUp(void) {
    rng chance = rng_seeded(71);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, true, 4);
    specimen_motion(&filter, &chance, &filter.motion);
    plr_motion_prior(&filter.belief, &filter.motion, &filter.work.noise, 1, &found);
}

/* A motion of which only the turn about the third axis was found. */
static plr_status apply_turn(plr_real rad) {
    found.z[5] = rad / found.L[35];
    return plr_predict_apply(&filter, &found);
}

static void test_a_turn_that_can_be_applied_is(void) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, apply_turn(PLR_R(1)));
    TEST_ASSERT_TRUE(plr_guard_is_pose(filter.belief.R_WB, filter.belief.p_WB));
}

static void demand_divergence_at(plr_real rad) {
    plr_real R_WB[9];
    double p_WB[3];
    memcpy(R_WB, filter.belief.R_WB, sizeof R_WB);
    memcpy(p_WB, filter.belief.p_WB, sizeof p_WB);
    TEST_ASSERT_EQUAL_INT(PLR_E_DIVERGED, apply_turn(rad));
    TEST_ASSERT_EQUAL_UINT8(0, filter.motion.pending);
    TEST_ASSERT_EQUAL_MEMORY(R_WB, filter.belief.R_WB, sizeof R_WB);
    TEST_ASSERT_EQUAL_MEMORY(p_WB, filter.belief.p_WB, sizeof p_WB);
}

static void test_a_turn_beyond_it_diverges_and_leaves_the_pose(void) {
    demand_divergence_at(PLR_R(4));
}

static void test_a_turn_that_is_no_number_does_so_too(void) {
    demand_divergence_at(PLR_R(1e30));
}
