// SPDX-License-Identifier: MIT
/* The accumulating test: chi-square of what it should be, in units of what is usual. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "math/dense.h"
#include "supervise/sum.h"
#include "support/random.h"

#define KEEP  0.9
#define FLOOR PLR_R(1e-3)

enum { RUNS = 3000, FRAMES = 60 };

static plr_sum sum;
static rng chance;

void setUp(void) {
    chance = rng_seeded(61);
    memset(&sum, 0, sizeof sum);
}

/* A frame's difference of that covariance: diagonal but for one direction that is oblique. */
static void add(const double variance[6], double times) {
    plr_real x[6], C[21] = {0};
    double z[6];
    rng_normals(&chance, times, z, 6);
    for (unsigned k = 0; k < 6; k++) {
        x[k] = (plr_real)(sqrt(variance[k]) * z[k]);
        C[plr_upper_row(6, k)] = (plr_real)variance[k];
    }
    x[5] += x[0] / 2; /* a turn looks like a way */
    C[5] = C[0] / 2;
    C[20] += C[0] / 4;
    plr_sum_add(&sum, PLR_R(KEEP), x, C);
}

/* Some directions are seen well, others hardly. */
static void demand_chi_square(double times, const plr_real *usual) {
    static const double seen[6] = {0.99, 0.9, 0.5, 0.1, 0.99, 0.05};
    double all = 0, squares = 0;
    unsigned beyond = 0;
    for (unsigned run = 0; run < RUNS; run++) {
        memset(&sum, 0, sizeof sum);
        for (unsigned k = 0; k < FRAMES; k++)
            add(seen, times);
        const double found = (double)plr_sum_statistic(&sum, usual, FLOOR);
        all += found / RUNS;
        squares += found * found / RUNS;
        beyond += found > 16.81; /* one in a hundred */
    }
    /* mean 6 and variance 12, to four sigmas of so many runs */
    TEST_ASSERT_DOUBLE_WITHIN(4 * sqrt(12.0 / RUNS) + 0.03, 6, all);
    TEST_ASSERT_DOUBLE_WITHIN(1.8, 12, squares - all * all);
    TEST_ASSERT_UINT_WITHIN(22, RUNS / 100, beyond);
}

static void test_under_noise_it_is_chi_square_of_six(void) {
    demand_chi_square(1, NULL);
}

static void test_noise_that_is_usual_is_chi_square_of_six_in_its_units(void) {
    static const plr_real usual[6] = {9, 9, 9, 9, 9, 9};
    demand_chi_square(3, usual);
}

static void test_directions_of_which_nothing_is_said_do_not_count(void) {
    const plr_real x[6] = {0, 0, 0, 0, PLR_R(1e-6), 0}, C[21] = {0};
    for (unsigned k = 0; k < FRAMES; k++)
        plr_sum_add(&sum, PLR_R(KEEP), x, C);
    TEST_ASSERT_LESS_THAN_DOUBLE(1e-6, (double)plr_sum_statistic(&sum, NULL, FLOOR));
}

/* s / V of a lasting difference is 1 + keep of it, however little of it the odometry lets through. */
static void test_the_difference_by_pictures_alone_is_what_lasts(void) {
    plr_real x[6] = {0}, C[21] = {0}, n[6];
    for (unsigned k = 0; k < 6; k++)
        C[plr_upper_row(6, k)] = PLR_R(0.01); /* a hundredth is told in a frame */
    x[1] = PLR_R(0.03);
    for (unsigned k = 0; k < 200; k++)
        plr_sum_add(&sum, PLR_R(KEEP), x, C);
    plr_sum_by_pictures(sum.sum, sum.variance, 0, n);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 3 * (1 + KEEP), (double)n[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, (double)n[0]);
}
