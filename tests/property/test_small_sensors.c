// SPDX-License-Identifier: MIT
/* Wheel, standstill and position: with noise as it is told, errors stay within the covariance, and
 * each makes the estimate better. Simulated drives, normalised squared errors against chi-square. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/axes.h"
#include "support/chi_square.h"
#include "support/oracle.h"
#include "support/reseal.h"
#include "support/rig.h"
#include "support/rigid.h"
#include "support/small_sensors.h"
#include "support/specimens.h"

/* In the short form fewer drives, and with them wider bounds. */
enum { RUNS = PELORUS_SHORT_FORM ? 2 : 20, DOF = 6 };

typedef struct helpers {
    unsigned wheel_every, standstill_every, position_every; /* in steps of 10 ms; 0: none */
    uint8_t axes;
    bool camera;
    double wheel_sigma, position_sigma;
} helpers;

void setUp(void) {
    small_sensors_set_up();
}

/* A step of 10 ms: a twist at its start, and what else is read then. */
static void step(const helpers *with, unsigned k) {
    const plr_twist twist = scene_read(&rig.world);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, rig.world.t_ns, &twist));
    if (with->wheel_every && k % with->wheel_every == 0)
        measure(wheel(with->axes, with->wheel_sigma));
    if (with->standstill_every && k % with->standstill_every == 0)
        measure(reading_of(PLR_SENSOR_STANDSTILL, 3, 0.002));
    scene_move(&rig.world, RIG_STEP_NS);
    if (with->position_every && (k + 1) % with->position_every == 0)
        measure(position(with->axes, with->position_sigma));
    if (with->camera && (k + 1) % RIG_TWISTS == 0)
        rig_frame();
}

/* The same of the biases, as rig_squared_error of the pose. */
static double squared_error_of_biases(void) {
    double P[36], b[6], e[6], weighted[6], sum = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
    for (int i = 0; i < 6; i++)
        e[i] = weighted[i] = rig.options.bias[i] - b[i];
    TEST_ASSERT_TRUE(oracle_solve_spd(6, 1, P, weighted));
    for (int i = 0; i < 6; i++)
        sum += e[i] * weighted[i];
    return sum;
}

typedef struct outcome {
    double nees_pose, nees_bias; /* per degree of freedom */
    double metres;               /* root mean square at the end */
} outcome;

static outcome drive(const helpers *with, unsigned steps) {
    outcome sum = {0};
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        double e[6];
        small_sensors_chance = rng_seeded(seed + 500);
        rig.options.seed = seed;
        rng_normals(&small_sensors_chance, rig.config.bias_velocity_sigma_mps, rig.options.bias, 3);
        rng_normals(&small_sensors_chance, rig.config.bias_gyro_sigma_radps, rig.options.bias + 3,
                    3);
        rig_begin();
        for (unsigned k = 0; k < steps; k++)
            step(with, k);
        sum.nees_pose += rig_squared_error(e) / (DOF * RUNS);
        sum.nees_bias += squared_error_of_biases() / (DOF * RUNS);
        sum.metres += (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]) / RUNS;
    }
    sum.metres = sqrt(sum.metres);
    return sum;
}

static void check(const helpers *with, unsigned steps, double better_by) {
    const helpers without = {.camera = with->camera};
    const outcome got = drive(with, steps), before = drive(&without, steps);
    chi_square_demand("pose", got.nees_pose, RUNS * DOF);
    chi_square_demand("biases", got.nees_bias, RUNS * DOF);
    TEST_ASSERT_LESS_THAN_DOUBLE(before.metres / better_by, got.metres);
}

static void test_a_wheel_on_three_axes_improves_dead_reckoning(void) {
    const helpers with = {.wheel_every = 1, .axes = 7, .wheel_sigma = 0.05};
    check(&with, 1500, 1.4);
}

static void test_a_slower_wheel_on_one_axis_too(void) {
    const helpers with = {.wheel_every = 5, .axes = 1, .wheel_sigma = 0.03};
    check(&with, 1500, 1.02);
}

static void test_a_wheel_beside_a_camera(void) {
    const helpers with = {.wheel_every = 2, .axes = 3, .wheel_sigma = 0.02, .camera = true};
    check(&with, 1000, 1.05);
}

static void test_in_dead_reckoning_a_wheel_finds_the_biases(void) {
    const helpers with = {.wheel_every = 1, .axes = 7, .wheel_sigma = 0.02, .camera = true};
    rig.config.mode = PLR_MODE_DEAD_RECKONING;
    check(&with, 1000, 1.5);
    double P[36], b[6];
    const double prior = rig.config.bias_velocity_sigma_mps;
    drive(&with, 1000);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_LESS_THAN_DOUBLE(0.3 * prior, sqrt(P[7 * i]));
}

static void test_a_standstill_holds_the_pose_and_finds_the_biases(void) {
    const helpers with = {.standstill_every = 10};
    rig.options.speed_mps = rig.options.turn_radps = rig.options.sway = 0;
    check(&with, 1500, 20);
}

static void test_positions_bound_the_error(void) {
    const helpers with = {.position_every = 20, .axes = 7, .position_sigma = 0.05};
    check(&with, 2000, 4);
}

static void test_a_height_alone(void) {
    const helpers with = {.position_every = 50, .axes = 4, .position_sigma = 0.05, .camera = true};
    check(&with, 1000, 1.0);
}

static void test_positions_without_biases_too(void) {
    const helpers with = {.position_every = 100, .axes = 7, .position_sigma = 0.3};
    double nees = 0, e[6];
    rig.config.bias = 0;
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        small_sensors_chance = rng_seeded(seed + 900);
        rig.options.seed = seed;
        rig_begin();
        for (unsigned k = 0; k < 1500; k++)
            step(&with, k);
        nees += rig_squared_error(e) / (DOF * RUNS);
    }
    chi_square_demand("pose", nees, RUNS * DOF);
}

/* ---------------------------------------------------------------- standing is detected */

static uint32_t readings_after(unsigned frames) {
    rig_begin();
    rig_drive(frames);
    return rig.filter.totals.readings - rig.filter.totals.readings_gated;
}

static void test_standing_is_detected_from_the_pixels_and_only_if_asked_for(void) {
    rig.options.speed_mps = rig.options.turn_radps = rig.options.sway = 0;
    TEST_ASSERT_EQUAL_UINT32(0, readings_after(50));
    rig.config.standstill_sigma_mps = 0.02;
    TEST_ASSERT_GREATER_THAN_UINT32(30, readings_after(50));
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, rig.report.health);
    double P[36], b[6];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_LESS_THAN_DOUBLE(rig.config.bias_velocity_sigma_mps, 2 * sqrt(P[7 * i]));
}

static void test_creeping_is_not_standing(void) {
    rig.options.speed_mps = 0.1;
    rig.options.turn_radps = rig.options.sway = 0;
    rig.config.standstill_sigma_mps = 0.02;
    TEST_ASSERT_EQUAL_UINT32(0, readings_after(100));
}

static void test_turning_wheels_before_a_still_picture_are_not_standing(void) {
    rig.options.speed_mps = rig.options.turn_radps = rig.options.sway = 0;
    rig.config.standstill_sigma_mps = 0.02;
    rig.config.gate_d2 = 13;
    rig.options.bias[0] = 1.5; /* they spin on ice */
    TEST_ASSERT_EQUAL_UINT32(0, readings_after(40));
}
