// SPDX-License-Identifier: MIT
/*
 * A saved state with a flipped bit was restored with PLR_OK where it held numbers that no filter can
 * have: a pose that is no rotation, after which every call found the filter damaged; a landmark so far
 * off that a question about it was answered with infinity. What a restore takes now stands the guard's
 * own checks, and no question is answered with a number that is not finite.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "support/matrices.h"
#include "support/rig.h"
#include "support/specimens.h"
#include "support/state_bytes.h"
#include "support/state_places.h"

enum { REAL = sizeof(plr_real) };

static plr_filter other;
static state_bytes state;

void setUp(void) {
    rig_set_up();
    rig.config.bias = 1;
    rig_begin();
    rig_drive(5);
    rig_twist();
    state_bytes_save(&state, &rig.filter);
}

/* Every question is refused or answered with finite numbers. */
static void ask_everything(const char *at) {
    plr_pose pose;
    plr_twist twist;
    plr_landmark landmark;
    double x[6], P[36];
    if (plr_filter_pose(&other, &pose) == PLR_OK)
        TEST_ASSERT_TRUE_MESSAGE(all_finite(pose.R, 9) && all_finite(pose.p, 3), at);
    if (plr_filter_velocity(&other, &twist) == PLR_OK)
        TEST_ASSERT_TRUE_MESSAGE(all_finite(twist.v_B_mps, 3) && all_finite(twist.w_B_radps, 3),
                                 at);
    if (plr_filter_pose_covariance(&other, P) == PLR_OK)
        TEST_ASSERT_TRUE_MESSAGE(all_finite(P, 36), at);
    if (plr_filter_velocity_covariance(&other, P) == PLR_OK)
        TEST_ASSERT_TRUE_MESSAGE(all_finite(P, 36), at);
    if (plr_filter_bias(&other, x, P) == PLR_OK)
        TEST_ASSERT_TRUE_MESSAGE(all_finite(x, 6) && all_finite(P, 36), at);
    TEST_ASSERT_TRUE_MESSAGE(isfinite(plr_filter_trace(&other)), at);
    for (unsigned slot = 0; slot < plr_filter_landmark_count(&other); slot++)
        if (plr_filter_landmark(&other, slot, &landmark) == PLR_OK)
            TEST_ASSERT_TRUE_MESSAGE(
                all_finite(landmark.p_W_m, 3) && all_finite(landmark.P_W_m2, 9), at);
}

/* Restores with one bit flipped. */
static plr_status restore_with(uint32_t bit) {
    char at[48];
    snprintf(at, sizeof at, "byte %u, bit %u", (unsigned)(bit / 8), (unsigned)(bit % 8));
    memcpy(&other, &rig.filter, sizeof other);
    state.bytes[bit / 8] ^= (uint8_t)(1U << bit % 8);
    const plr_status status = state_bytes_restore(&state, &other);
    state.bytes[bit / 8] ^= (uint8_t)(1U << bit % 8);
    TEST_ASSERT_TRUE_MESSAGE(status == PLR_OK || status == PLR_E_FOREIGN || status == PLR_E_CORRUPT,
                             at);
    if (status != PLR_OK)
        return status;
    const plr_twist still = {{0}, {0}};
    plr_pose pose;
    TEST_ASSERT_EQUAL_INT_MESSAGE(PLR_OK, plr_filter_pose(&other, &pose), at);
    ask_everything(at);
    TEST_ASSERT_NOT_EQUAL_INT_MESSAGE(
        PLR_E_DAMAGED, plr_filter_predict(&other, rig.filter.belief.t_ns + RIG_STEP_NS, &still),
        at);
    ask_everything(at);
    return status;
}

static unsigned refused_from(uint32_t from, uint32_t to, unsigned stride) {
    unsigned refused = 0;
    for (uint32_t bit = 8 * from; bit < 8 * to; bit += stride)
        refused += restore_with(bit) != PLR_OK;
    return refused;
}

static void test_what_a_restore_takes_the_next_call_does_not_find_damaged(void) {
    const uint32_t pose = state_place("pose", "R_WB"), position = state_place("pose", "p_WB");
    TEST_ASSERT_GREATER_THAN_UINT(9 * 8, refused_from(pose, position, 1));
    TEST_ASSERT_EQUAL_UINT(0, refused_from(position, position + 24 - 2, 64)); /* the lowest bits */
    (void)refused_from(state_place("count", "landmarks"), pose, 1);
    (void)refused_from(position, state_place("slot", "x"), 13);
}

static void test_no_question_is_answered_with_a_number_that_is_not_finite(void) {
    const uint32_t first = state_place("slot", "x");
    TEST_ASSERT_GREATER_THAN_UINT(4, plr_filter_landmark_count(&rig.filter));
    TEST_ASSERT_GREATER_THAN_UINT(2, refused_from(first, first + 3 * REAL, 1));
    (void)refused_from(first, state_place("slot", "end"), 1);
    (void)refused_from(state.length - 10 * REAL, state.length, 1); /* of S, the end */
    (void)refused_from(first, state.length, 211);
}

static void test_a_mirror_image_is_no_pose(void) {
    plr_real R[9];
    memcpy(R, rig.filter.belief.R_WB, sizeof R);
    for (unsigned i = 0; i < 9; i += 3)
        R[i] = -R[i];
    /* the tests run on little-endian machines */
    memcpy(state.bytes + state_place("pose", "R_WB"), R, sizeof R);
    memcpy(&other, &rig.filter, sizeof other);
    TEST_ASSERT_EQUAL_INT(PLR_E_CORRUPT, state_bytes_restore(&state, &other));
    TEST_ASSERT_EQUAL_MEMORY(&rig.filter, &other, sizeof other);
}

static void test_a_landmark_in_the_camera_is_none(void) {
    memset(state.bytes + state_place("slot", "x"), 0, 3 * REAL);
    memcpy(&other, &rig.filter, sizeof other);
    TEST_ASSERT_EQUAL_INT(PLR_E_CORRUPT, state_bytes_restore(&state, &other));
    TEST_ASSERT_EQUAL_MEMORY(&rig.filter, &other, sizeof other);
}
