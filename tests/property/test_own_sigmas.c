// SPDX-License-Identifier: MIT
/* Observations that say how sharp they are, and some of the left picture alone: does the filter know how
 * wrong it is, and is it better for being told? Every other point is blurred. */
#include <math.h>
#include <unity.h>

#include "support/axes.h"
#include "support/chi_square.h"
#include "support/rig.h"

enum { RUNS = 20, FRAMES = 100, DOF = 6 };

#define SHARP_PX 0.3

/* Over seeds, at the end of a drive: squared error per degree of freedom, and of the place, m^2. */
typedef struct errors {
    double nees, place2;
} errors;

static errors drive(double setting_px) {
    errors sum = {0, 0};
    double e[6];
    rig.config.pixel_sigma_px = setting_px;
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        rig.options.seed = seed;
        rig_begin();
        rig_drive(FRAMES);
        sum.nees += rig_squared_error(e) / (DOF * RUNS);
        sum.place2 += (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]) / RUNS;
    }
    return sum;
}

void setUp(void) {
    rig_set_up();
    each_axis(rig.config.velocity_sigma, rig.options.velocity_sigma_mps);
    each_axis(rig.config.gyro_sigma, rig.options.gyro_sigma_radps);
    rig.config.gate_d2 = 0; /* what a gate cuts off is missing in the errors */
    rig.options.landmarks = 300;
    rig.options.most_seen = 20;
    rig.options.pixel_sigma_px = SHARP_PX;
}

/* Whatever the setting is, which no observation uses. */
static void test_told_the_filter_knows_how_wrong_it_is(void) {
    rig.options.blur = 3;
    rig.options.tells_sigma = true;
    chi_square_demand("told", drive(1).nees, RUNS * DOF);
}

/* Twice as blurred: what is blurred more passes for points that move. */
static void test_not_told_and_taken_for_sharp_it_believes_too_much(void) {
    double low, high;
    rig.options.blur = 2;
    chi_square_bounds(RUNS * DOF, &low, &high);
    TEST_ASSERT_GREATER_THAN_DOUBLE(high, drive(SHARP_PX).nees);
}

/* The setting is their root mean square, the best that one number can say. */
static void test_told_it_is_better_than_by_their_mean(void) {
    rig.options.blur = 3;
    const errors mean = drive(SHARP_PX * sqrt((1 + 3 * 3) / 2.0));
    rig.options.tells_sigma = true;
    const errors told = drive(1);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.8 * mean.place2, told.place2);
}

static void test_with_left_pictures_alone_it_knows_how_wrong_it_is(void) {
    rig.options.blur = 3;
    rig.options.tells_sigma = true;
    rig.options.left_alone = 0.5;
    chi_square_demand("left alone", drive(1).nees, RUNS * DOF);
}
