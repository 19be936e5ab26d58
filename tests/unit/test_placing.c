// SPDX-License-Identifier: MIT
/* The pose from known points in sight: known_map/placing.c. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "known_map/placing.h"
#include "math/small.h"
#include "math/so3.h"
#include "pelorus/filter.h"
#include "sensor/stereo.h"
#include "support/exact_camera.h"
#include "support/oracle.h"
#include "support/random.h"
#include "support/rigid.h"
#include "support/scene.h"

enum { RUNS = PELORUS_SHORT_FORM ? 40 : 300 };

static plr_filter f;
static rng chance;
static plr_seen_known seen[PLR_PLACING_MOST];
static double M[16]; /* from the world to the camera */

void setUp(void) {
    const plr_calibration calibration = scene_bare_camera(400, 320, 240, 0.2);
    plr_config config;
    plr_config_default(&config);
    exact_camera(&config);
    config.pixel_sigma_px = 1;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&f, &calibration, &config, NULL));
    chance = rng_seeded(17);
}

/* A pose anywhere within 20 m, turned in any way by up to half a turn. */
static void draw_pose(void) {
    double xi[6];
    for (unsigned i = 0; i < 6; i++)
        xi[i] = rng_uniform(&chance, -1, 1) * (i < 3 ? 20 : 1.7);
    rigid_exp(M, xi);
}

/* The point q of the camera: known in the world to `map_sigma` m, seen to `pixel_sigma` px. */
static void see(plr_seen_known *known, const double q[3], double map_sigma, double pixel_sigma) {
    double back[16], w[3], off[3], noise[4];
    const plr_real at[3] = {(plr_real)q[0], (plr_real)q[1], (plr_real)q[2]};
    plr_real z[3];
    memset(known, 0, sizeof *known);
    rigid_inverse(back, M);
    rigid_apply(w, back, q);
    rng_normals(&chance, map_sigma, off, 3);
    rng_normals(&chance, pixel_sigma, noise, 4);
    plr_stereo_project(z, &f.camera.given, at);
    for (unsigned i = 0; i < 3; i++) {
        known->w[i] = (plr_real)(w[i] + off[i]);
        known->P[4 * i] = (plr_real)(map_sigma * map_sigma);
        known->z[i] = z[i] + (plr_real)(i < 2 ? noise[i] : 0.5 * (noise[2] + noise[3]));
    }
    known->gap_d2 = (plr_real)((noise[2] - noise[3]) * (noise[2] - noise[3]) / 2);
}

/* Points in the picture, between 2 and 15 m. */
static void see_anywhere(unsigned count, double map_sigma, double pixel_sigma) {
    draw_pose();
    for (unsigned i = 0; i < count; i++) {
        const double z = rng_uniform(&chance, 2, 15);
        const double q[3] = {z * rng_uniform(&chance, -0.8, 0.8),
                             z * rng_uniform(&chance, -0.6, 0.6), z};
        see(&seen[i], q, map_sigma, pixel_sigma);
    }
}

/* e with Exp(e) placing = truth. */
static void error_of(const plr_placing *placing, double e[6]) {
    double found[16] = {0}, back[16], left[16];
    for (unsigned i = 0; i < 3; i++) {
        for (unsigned j = 0; j < 3; j++)
            found[4 * i + j] = (double)placing->R[3 * i + j];
        found[4 * i + 3] = (double)placing->t[i];
    }
    found[15] = 1;
    rigid_inverse(back, found);
    square_multiply(4, M, back, left);
    rigid_log(e, left);
}

static double squared_error(const plr_placing *placing) {
    double e[6], x[6], P[36], sum = 0;
    error_of(placing, e);
    memcpy(x, e, sizeof x);
    for (unsigned i = 0; i < 36; i++)
        P[i] = (double)placing->P_C[i];
    TEST_ASSERT_TRUE(oracle_solve_spd(6, 1, P, x));
    for (unsigned i = 0; i < 6; i++)
        sum += e[i] * x[i];
    return sum;
}

/* Its covariance is that of the error: the mean of RUNS chi-squares with 6 degrees of freedom has a
 * standard deviation of sqrt(12 / RUNS). */
static void check_covariance(unsigned count, double map_sigma) {
    double sum = 0;
    plr_placing placing;
    for (unsigned run = 0; run < RUNS; run++) {
        see_anywhere(count, map_sigma, 1);
        TEST_ASSERT_GREATER_OR_EQUAL_UINT(count - 2,
                                          plr_place(&f.camera, seen, count, NULL, &placing));
        sum += squared_error(&placing);
    }
    TEST_ASSERT_DOUBLE_WITHIN(4.5 * sqrt(12.0 / RUNS), 6, sum / RUNS);
}

static void test_the_covariance_is_that_of_the_error(void) {
    check_covariance(8, 0);
    check_covariance(20, 0.03);
    check_covariance(64, 0.1);
}

static void test_wrong_points_change_nothing(void) {
    plr_placing placing;
    unsigned lost = 0;
    for (unsigned run = 0; run < RUNS; run++) {
        see_anywhere(20, 0.03, 1);
        for (unsigned i = 0; i < 8; i++) { /* two in five lie elsewhere */
            seen[2 * i].w[run % 3] += PLR_R(3) + (plr_real)rng_uniform(&chance, 0, 1);
        }
        const unsigned agreeing = plr_place(&f.camera, seen, 20, NULL, &placing);
        lost += agreeing < 10;
        if (agreeing >= 10)
            TEST_ASSERT_LESS_THAN_DOUBLE(40, squared_error(&placing));
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT(RUNS / 40, lost);
}

static void test_those_that_agree_are_marked(void) {
    plr_placing placing;
    see_anywhere(12, 0, 0.1);
    seen[3].w[0] += 5;
    seen[7].gap_d2 = 100;
    TEST_ASSERT_EQUAL_UINT(10, plr_place(&f.camera, seen, 12, NULL, &placing));
    for (unsigned i = 0; i < 12; i++)
        TEST_ASSERT_EQUAL(i != 3 && i != 7, seen[i].agrees);
}

/* A pose of points at random is found by chance: by as many as there are degrees of freedom, never
 * by three fifths. */
static void test_points_of_another_map_agree_on_nothing(void) {
    plr_placing placing;
    for (unsigned run = 0; run < RUNS; run++) {
        see_anywhere(20, 0.03, 1);
        plr_real first[3];
        memcpy(first, seen[0].w, sizeof first);
        for (unsigned i = 0; i + 1 < 20; i++)
            memcpy(seen[i].w, seen[i + 1].w, sizeof first);
        memcpy(seen[19].w, first, sizeof first);
        TEST_ASSERT_LESS_THAN_UINT(8, plr_place(&f.camera, seen, 20, NULL, &placing));
    }
}

static void test_too_few_tell_nothing(void) {
    plr_placing placing;
    see_anywhere(20, 0, 0.1);
    for (unsigned count = 0; count < PLR_PLACING_LEAST; count++)
        TEST_ASSERT_EQUAL_UINT(0, plr_place(&f.camera, seen, count, NULL, &placing));
}

/* On a line the turn about it is open. */
static void test_points_on_a_line_tell_nothing(void) {
    plr_placing placing;
    draw_pose();
    for (unsigned i = 0; i < 20; i++) {
        const double q[3] = {-2 + 0.2 * i, 0.5, 5 + 0.1 * i};
        see(&seen[i], q, 0, 0.1);
    }
    TEST_ASSERT_EQUAL_UINT(0, plr_place(&f.camera, seen, 20, NULL, &placing));
}

/* With disparities of a pixel the depth of three points tells no pose. */
static void test_distant_points_tell_nothing(void) {
    plr_placing placing;
    draw_pose();
    for (unsigned i = 0; i < 20; i++) {
        const double z = 80, q[3] = {z * rng_uniform(&chance, -0.8, 0.8),
                                     z * rng_uniform(&chance, -0.6, 0.6), z};
        see(&seen[i], q, 0, 1);
    }
    TEST_ASSERT_EQUAL_UINT(0, plr_place(&f.camera, seen, 20, NULL, &placing));
}

/* What the likeliest pose has least of: squared residuals of the points, and of the prior. In double. */
static double cost_of(const double T[16], unsigned count, const double T_prior[16],
                      const double sigma[6]) {
    double back[16], gap[16], xi[6], sum = 0;
    rigid_inverse(back, T);
    square_multiply(4, T_prior, back, gap);
    rigid_log(xi, gap);
    for (unsigned k = 0; k < 6; k++)
        sum += pow(xi[k] / sigma[k], 2);
    for (unsigned i = 0; i < count; i++) {
        const double w[3] = {(double)seen[i].w[0], (double)seen[i].w[1], (double)seen[i].w[2]};
        double q[3];
        rigid_apply(q, T, w);
        const double z[3] = {400 * q[0] / q[2] + 320, 400 * (q[0] - 0.2) / q[2] + 320,
                             400 * q[1] / q[2] + 240};
        for (unsigned row = 0; row < 3; row++)
            sum += pow((double)seen[i].z[row] - z[row], 2) * (row == 2 ? 2 : 1);
    }
    return sum;
}

/* One to three points, exact in the map, and a prior of 0.3 m and 0.1 rad: no pose near the one that was found
 * is likelier. */
static void test_few_points_and_a_prior_give_the_likeliest_pose(void) {
    static const double sigma[6] = {0.3, 0.3, 0.3, 0.1, 0.1, 0.1};
    unsigned disagreeing = 0;
    for (unsigned run = 0; run < RUNS; run++) {
        const unsigned count = 1 + run % 3;
        double xi[6], off[16], T_prior[16], T[16] = {0};
        plr_placing prior = {.R = {0}}, placing;
        see_anywhere(count, 0, 1);
        for (unsigned k = 0; k < 6; k++) {
            xi[k] = sigma[k] * rng_normal(&chance);
            prior.P_C[7 * k] = (plr_real)(sigma[k] * sigma[k]);
        }
        rigid_exp(off, xi);
        square_multiply(4, off, M, T_prior);
        for (unsigned i = 0; i < 3; i++) {
            for (unsigned j = 0; j < 3; j++)
                prior.R[3 * i + j] = (plr_real)T_prior[4 * i + j];
            prior.t[i] = (plr_real)T_prior[4 * i + 3];
        }
        if (plr_place_by_prior(&f.camera, seen, count, &prior, &placing) < count) {
            disagreeing++;
            continue;
        }
        for (unsigned i = 0; i < 3; i++) {
            for (unsigned j = 0; j < 3; j++)
                T[4 * i + j] = (double)placing.R[3 * i + j];
            T[4 * i + 3] = (double)placing.t[i];
        }
        T[15] = 1;
        const double least = cost_of(T, count, T_prior, sigma);
        TEST_ASSERT_LESS_THAN_DOUBLE(cost_of(M, count, T_prior, sigma) + 0.05, least);
        for (unsigned k = 0; k < 6; k++)
            for (int sign = -1; sign < 2; sign += 2) {
                double step[6] = {0}, D[16], beside[16];
                step[k] = sign * 0.3 * sigma[k];
                rigid_exp(D, step);
                square_multiply(4, D, T, beside);
                TEST_ASSERT_LESS_THAN_DOUBLE(cost_of(beside, count, T_prior, sigma) + 0.05, least);
            }
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT(RUNS / 20, disagreeing);
}
