// SPDX-License-Identifier: MIT
/* While the twists were contradicted, with a noise made wide for it, each frame still drew a little
 * of the contradiction into the velocity bias. Of half a minute of slipping wheels 1.5 sigma remained,
 * of a scene that drifted by at 0.15 m/s 5.5 sigma, and the filter told of a bias that there was not
 * for half a minute after it. A scene that moves by little contradicts the twists by turns, and between
 * them the biases were drawn again. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/rig.h"

void setUp(void) {
    rig_set_up();
    rig.config.bias = true;
    rig.config.pixel_sigma_px = 1;
    rig_begin();
    rig_drive(40);
}

/* A frame of a body that stands, while its wheels turn at `speed`. */
static void frame_in_place(double speed) {
    rig_twists_in_place(speed);
    rig_frame();
}

static void biases(double b[6], double P[36]) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
}

static bool is_contradicted(void) {
    return rig.filter.supervisor.doubt == PLR_DOUBT_CONTRADICTED;
}

static void slip_until_told(void) {
    for (int k = 0; k < 10 && !is_contradicted(); k++)
        frame_in_place(1);
    TEST_ASSERT_TRUE(is_contradicted());
}

static void test_what_contradicts_the_twists_becomes_no_bias(void) {
    double b[6], P[36], b_later[6], P_later[36];
    slip_until_told();
    biases(b, P);
    for (int k = 0; k < 100; k++)
        frame_in_place(1);
    biases(b_later, P_later);
    for (int i = 0; i < 6; i++) {
        TEST_ASSERT_EQUAL_DOUBLE(b[i], b_later[i]);
        /* nothing was learnt, and in 20 s a bias may walk */
        TEST_ASSERT_GREATER_THAN_DOUBLE(P[7 * i], P_later[7 * i]);
        TEST_ASSERT_LESS_THAN_DOUBLE(P[7 * i] + 60 * (i < 3 ? 1e-8 : 1e-10), P_later[7 * i]);
    }
}

/* Less of a slip than is called a contradiction: until fifteen such frames settle it, it is no bias. */
static void test_until_it_is_settled_no_bias_is_learnt(void) {
    double b[6], P[36], b_later[6], P_later[36];
    slip_until_told();
    biases(b, P);
    for (int k = 0; k < 14; k++)
        frame_in_place(0.08);
    TEST_ASSERT_NOT_EQUAL_UINT8(PLR_DOUBT_NONE, rig.filter.supervisor.doubt);
    biases(b_later, P_later);
    for (int i = 0; i < 6; i++)
        TEST_ASSERT_EQUAL_DOUBLE(b[i], b_later[i]);
}

static void test_a_contradiction_that_is_over_lets_the_biases_be_found_again(void) {
    double b[6], P[36], P_later[36];
    slip_until_told();
    biases(b, P);
    for (int k = 0; k < 100; k++)
        frame_in_place(0);
    TEST_ASSERT_FALSE(is_contradicted());
    biases(b, P_later);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.9 * P[0], P_later[0]);
}
