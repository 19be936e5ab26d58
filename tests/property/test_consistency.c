// SPDX-License-Identifier: MIT
/* Does the filter know how wrong it is? Normalised squared errors of the pose over simulated drives,
 * against chi-square: `body` within the bounds, `world` (which believes more than it knows) not. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "support/axes.h"
#include "support/chi_square.h"
#include "support/oracle.h"
#include "support/rig.h"
#include "support/rigid.h"

/* In a slow build fewer drives, and with them wider bounds. */
enum { RUNS = PELORUS_SLOW_BUILD ? 4 : 20, FRAMES = 150, DOF = 6 };

void setUp(void) {
    rig_set_up();
}

void tearDown(void) {
}

/* e^T P^-1 e, e = Log(T^^-1 T): chi-square with six degrees of freedom, if P is right. */
static double squared_error(void) {
    plr_pose pose;
    double P[36], T[16], inverse[16], E[16], e[6], weighted[6], sum = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose(&rig.filter, &pose));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    rigid_from_pose(T, &pose);
    rigid_inverse(inverse, T);
    square_multiply(4, inverse, rig.world.T_WB, E);
    rigid_log(e, E);
    memcpy(weighted, e, sizeof e);
    TEST_ASSERT_TRUE(oracle_solve_spd(6, 1, P, weighted));
    for (int i = 0; i < 6; i++)
        sum += e[i] * weighted[i];
    return sum;
}

/* Mean squared error per degree of freedom at the end of a drive, over seeds. */
static double mean_squared_error(plr_model_kind model, bool bias) {
    double sum = 0;
    rig.config.model = (uint8_t)model;
    rig.config.bias = bias;
    rig.config.pixel_sigma_px = rig.options.pixel_sigma_px;
    each_axis(rig.config.velocity_sigma, rig.options.velocity_sigma_mps);
    each_axis(rig.config.gyro_sigma, rig.options.gyro_sigma_radps);
    rig.config.gate_d2 = 25; /* wide: what it cuts off is missing in the errors */
    rig.options.landmarks = 300;
    rig.options.most_seen = 20;
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        rng chance = rng_seeded(seed + 1000);
        rig.options.seed = seed;
        rng_normals(&chance, bias ? rig.config.bias_velocity_sigma_mps : 0, rig.options.bias, 3);
        rng_normals(&chance, bias ? rig.config.bias_gyro_sigma_radps : 0, rig.options.bias + 3, 3);
        rig_begin();
        rig_drive(FRAMES);
        sum += squared_error();
    }
    return sum / (DOF * RUNS);
}

static void demand_consistent(double mean) {
    char message[80];
    double low, high;
    chi_square_bounds(RUNS * DOF, &low, &high);
    snprintf(message, sizeof message, "NEES %.3f per degree of freedom, %.3f to %.3f is due", mean,
             low, high);
    TEST_ASSERT_TRUE_MESSAGE(mean > low && mean < high, message);
}

static void test_body_knows_how_wrong_it_is(void) {
    demand_consistent(mean_squared_error(PLR_MODEL_BODY, false));
}

static void test_body_with_biases_knows_how_wrong_it_is(void) {
    demand_consistent(mean_squared_error(PLR_MODEL_BODY, true));
}

static void test_world_believes_more_than_it_knows(void) {
    double low, high;
    if (PLR_REAL == 32)
        TEST_IGNORE_MESSAGE("world is not for float32: docs/NUMERICS.md");
    chi_square_bounds(RUNS * DOF, &low, &high);
    TEST_ASSERT_GREATER_THAN_DOUBLE(1.2 * high, mean_squared_error(PLR_MODEL_WORLD, false));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_body_knows_how_wrong_it_is);
    RUN_TEST(test_body_with_biases_knows_how_wrong_it_is);
    RUN_TEST(test_world_believes_more_than_it_knows);
    return UNITY_END();
}
