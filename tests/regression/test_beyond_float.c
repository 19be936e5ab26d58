// SPDX-License-Identifier: MIT
/*
 * Numbers that a double holds and a float does not passed every check for finiteness and became
 * infinite inside: in a bias, a covariance, a landmark, the baseline. The filter then gave out
 * infinities with status PLR_OK.
 */
#include <unity.h>

#include "support/rig.h"
#include "support/specimens.h"

static const double huge[] = {1e300, 1e38, 1e20};

enum { KINDS = sizeof huge / sizeof *huge };

void setUp(void) {
    rig_set_up();
    rig.config.bias = 1;
    rig_begin();
}

static void demand_sane(void) {
    rig_drive(3);
    TEST_ASSERT_TRUE(specimen_gives_finite_numbers(&rig.filter));
}

static void test_a_bias_or_its_variance_beyond_float_is_refused(void) {
    for (int kind = 0; kind < KINDS; kind++) {
        const double zero[6] = {0}, x[6] = {0, huge[kind]};
        TEST_ASSERT_EQUAL_INT(PLR_E_RANGE, plr_filter_set_bias(&rig.filter, x, zero));
        TEST_ASSERT_EQUAL_INT(PLR_E_RANGE, plr_filter_set_bias(&rig.filter, zero, x));
    }
    demand_sane();
}

static void test_a_pose_covariance_beyond_float_is_refused(void) {
    for (int kind = 0; kind < KINDS; kind++) {
        double P[36] = {0};
        for (int i = 0; i < 6; i++)
            P[7 * i] = huge[kind];
        TEST_ASSERT_EQUAL_INT(PLR_E_RANGE, plr_filter_set_pose(&rig.filter, 1, &rig_identity, P));
    }
    demand_sane();
}

static void test_a_known_landmark_beyond_float_is_refused(void) {
    for (int kind = 0; kind < KINDS; kind++) {
        plr_landmark known = {.id = 1, .p_W_m = {5, 0, 0}, .P_W_m2 = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
        known.P_W_m2[4] = huge[kind];
        TEST_ASSERT_EQUAL_INT(PLR_E_RANGE, plr_filter_insert_known(&rig.filter, &known));
        known.P_W_m2[4] = 1;
        known.p_W_m[1] = huge[kind];
        TEST_ASSERT_EQUAL_INT(PLR_E_RANGE, plr_filter_insert_known(&rig.filter, &known));
    }
    demand_sane();
}

static void test_a_camera_beyond_float_is_refused(void) {
    for (int kind = 0; kind < KINDS; kind++) {
        plr_calibration c = rig.calibration;
        c.baseline_m = 1 / huge[kind];
        TEST_ASSERT_EQUAL_INT(PLR_E_CALIBRATION,
                              plr_filter_init(&rig.filter, &c, &rig.config, NULL));
        c = rig.calibration;
        c.fx_px = huge[kind];
        TEST_ASSERT_EQUAL_INT(PLR_E_CALIBRATION,
                              plr_filter_init(&rig.filter, &c, &rig.config, NULL));
    }
}
