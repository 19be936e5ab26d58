// SPDX-License-Identifier: MIT
/* Where landmarks are linearised whose range is poorly known. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "filter/linearisation.h"
#include "math/packed.h"
#include "pelorus/filter.h"
#include "state/covariance.h"
#include "support/matrices.h"
#include "support/random.h"

enum { SLOTS = 20, RUNS = 100 };

static plr_filter filter;
static rng chance;

void setUp(void) {
    plr_calibration calibration;
    plr_config config;
    memset(&calibration, 0, sizeof calibration);
    calibration.fx_px = calibration.fy_px = 500;
    calibration.cx_px = 320;
    calibration.cy_px = 240;
    calibration.baseline_m = 0.2;
    for (int i = 0; i < 3; i++)
        calibration.T_CB.R[4 * i] = 1;
    plr_config_default(&config);
    config.slots = SLOTS;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &calibration, &config, NULL));
    chance = rng_seeded(83);
}

/* A landmark straight ahead of an inverse range that may be negative. */
static void put(double inverse_range, double sigma) {
    const unsigned slot = filter.belief.count++;
    const unsigned row = plr_covariance_row(&filter.belief, slot) + 2;
    memset(&filter.belief.slots[slot], 0, sizeof filter.belief.slots[slot]);
    filter.belief.slots[slot].x[2] = 500;
    filter.belief.slots[slot].beyond = (plr_real)(inverse_range - 1.0 / 500);
    filter.belief.P[plr_packed_at(row, row)] = (plr_real)(sigma * sigma);
}

/* A twentieth above it, since twenty points that scatter as much as they are worth settle no more. */
static void test_well_known_inverse_ranges_have_their_mean(void) {
    for (unsigned i = 0; i < SLOTS; i++)
        put(0.02 + 0.001 * i, 1e-5);
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, 0.0295, (double)plr_linearisation_usual(&filter));
}

/* One pixel says 0.03 of an inverse range of 0.006; twenty of them more. */
static void test_noise_averages_out_and_what_is_well_known_counts_more(void) {
    double worst = 0, mean = 0;
    for (int run = 0; run < RUNS; run++) {
        filter.belief.count = 0;
        for (unsigned i = 0; i < SLOTS; i++) {
            const double sigma = i % 2 ? 0.03 : 0.003;
            put(0.006 + sigma * rng_normal(&chance), sigma);
        }
        const double usual = (double)plr_linearisation_usual(&filter);
        worst = fmax(worst, fabs(usual - 0.006));
        mean += usual / RUNS;
    }
    TEST_ASSERT_LESS_THAN_DOUBLE(0.009, worst);
    TEST_ASSERT_DOUBLE_WITHIN(1.5e-3, 0.006, mean);
}

/* Whatever noise makes of the mean, points have a place; and one that is not at infinity, for there no
 * motion could be seen. */
static void test_it_is_positive_and_not_below_what_is_certain(void) {
    for (unsigned i = 0; i < SLOTS; i++)
        put(-0.01, 0.03);
    const double usual = (double)plr_linearisation_usual(&filter);
    TEST_ASSERT_GREATER_THAN_DOUBLE(0.001, usual);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.01, usual);
    filter.belief.count = 0;
    for (unsigned i = 0; i < SLOTS; i++)
        put(-0.01, 1e-6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1e-5, (double)plr_linearisation_usual(&filter)); /* max-range */
    filter.belief.count = 0;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1e-5, (double)plr_linearisation_usual(&filter));
}

static void test_a_landmark_goes_to_the_usual_place_but_not_further_than_two_sigmas(void) {
    const plr_real usual = PLR_R(0.01), change = PLR_R(0.002);
    put(0.03, 0);
    const plr_slot *slot = &filter.belief.slots[0];
    const struct {
        double sigma, expected;
    } cases[] = {{0.02, -0.02}, {0.012, -0.02}, {0.005, 0.002 - 0.01}, {0, 0.002}};
    for (unsigned i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const double sigma = cases[i].sigma;
        const plr_real got =
            plr_linearisation_offset(slot, usual, change, (plr_real)(sigma * sigma));
        TEST_ASSERT_DOUBLE_WITHIN(1e-7, cases[i].expected, (double)got);
    }
    const plr_real rounded = plr_linearisation_offset(slot, usual, change, PLR_R(-1e-12));
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0.002, (double)rounded);
    const plr_real nearer = plr_linearisation_offset(slot, PLR_R(0.1), change, PLR_R(1e-4));
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0.022, (double)nearer);
}
