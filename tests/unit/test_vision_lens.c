// SPDX-License-Identifier: MIT
/* Lenses: held against the formulas in double, and there and back. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/random.h"
#include "vision/lens.h"

static const double eps = (double)PLR_EPSILON;
static rng chance;

void setUp(void) {
    chance = rng_seeded(481);
}

static plr_optics optics_of(plr_lens_model model, const double k[8]) {
    plr_optics o;
    memset(&o, 0, sizeof o);
    o.model = (uint8_t)model;
    o.fx = PLR_R(458.654), o.fy = PLR_R(457.296), o.cx = PLR_R(367.215), o.cy = PLR_R(248.375);
    for (int i = 0; i < 8; i++)
        o.k[i] = (plr_real)k[i];
    return o;
}

/* EuRoC's left camera, a rational one, and a fisheye. */
static const double four[8] = {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05};
static const double eight[8] = {0.9, 0.12, 1e-4, -2e-4, 0.003, 1.2, 0.3, 0.02};
static const double fisheye[8] = {-0.0135, 0.0204, -0.0128, 0.0025};

static void radtan_in_double(const double k[8], double x, double y, double d[2]) {
    const double r2 = x * x + y * y;
    const double rad =
        (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
    d[0] = x * rad + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x);
    d[1] = y * rad + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y;
}

static void demand_pixel(const plr_optics *o, const plr_real ray[3], const double d[2]) {
    plr_real px[2];
    TEST_ASSERT_TRUE(plr_lens_pixel(o, ray, px));
    TEST_ASSERT_DOUBLE_WITHIN(4000 * eps, 458.654 * d[0] + 367.215, (double)px[0]);
    TEST_ASSERT_DOUBLE_WITHIN(4000 * eps, 457.296 * d[1] + 248.375, (double)px[1]);
}

static void demand_radtan(const double k[8]) {
    const plr_optics o = optics_of(PLR_LENS_RADTAN, k);
    for (int run = 0; run < 500; run++) {
        const double x = rng_uniform(&chance, -0.8, 0.8), y = rng_uniform(&chance, -0.5, 0.5);
        const double z = rng_uniform(&chance, 0.2, 20);
        const plr_real ray[3] = {(plr_real)(x * z), (plr_real)(y * z), (plr_real)z};
        double d[2];
        radtan_in_double(k, x, y, d);
        demand_pixel(&o, ray, d);
    }
}

static void test_radial_and_tangential_is_opencvs_formula(void) {
    demand_radtan(four);
    demand_radtan(eight);
}

static void test_equidistant_is_kalibrs_formula(void) {
    const plr_optics o = optics_of(PLR_LENS_EQUIDISTANT, fisheye);
    for (int run = 0; run < 500; run++) {
        const double theta = rng_uniform(&chance, 0, 1.8), phi = rng_uniform(&chance, -3, 3);
        const double r = sin(theta), t2 = theta * theta;
        const plr_real ray[3] = {(plr_real)(2 * r * cos(phi)), (plr_real)(2 * r * sin(phi)),
                                 (plr_real)(2 * cos(theta))};
        const double radius =
            theta *
            (1 + t2 * (fisheye[0] + t2 * (fisheye[1] + t2 * (fisheye[2] + t2 * fisheye[3]))));
        const double d[2] = {radius * cos(phi), radius * sin(phi)};
        demand_pixel(&o, ray, d);
    }
}

static void test_an_angle_is_that_of_the_mathematics_library(void) {
    for (int run = 0; run <= 1000; run++) {
        const double angle = run * 3.1415926 / 1000;
        TEST_ASSERT_DOUBLE_WITHIN(
            8 * eps, angle, (double)plr_lens_angle((plr_real)cos(angle), (plr_real)sin(angle)));
    }
}

static void test_a_pixels_direction_leads_back_to_it(void) {
    const plr_optics all[4] = {optics_of(PLR_LENS_NONE, four), optics_of(PLR_LENS_RADTAN, four),
                               optics_of(PLR_LENS_RADTAN, eight),
                               optics_of(PLR_LENS_EQUIDISTANT, fisheye)};
    for (int run = 0; run < 2000; run++) {
        const plr_real px[2] = {(plr_real)rng_uniform(&chance, 0, 751),
                                (plr_real)rng_uniform(&chance, 0, 479)};
        plr_real ray[3], back[2];
        TEST_ASSERT_TRUE(plr_lens_ray(&all[run % 4], px, ray));
        TEST_ASSERT_TRUE(plr_lens_pixel(&all[run % 4], ray, back));
        TEST_ASSERT_DOUBLE_WITHIN(2e-3, (double)px[0], (double)back[0]);
        TEST_ASSERT_DOUBLE_WITHIN(2e-3, (double)px[1], (double)back[1]);
    }
}

static void test_where_a_formula_folds_no_direction_is_told(void) {
    const double folding[8] = {-0.5};
    const plr_optics o = optics_of(PLR_LENS_RADTAN, folding);
    const plr_real far[2] = {PLR_R(1500), PLR_R(248)}, behind[3] = {0, 0, -1};
    plr_real ray[3], px[2];
    TEST_ASSERT_FALSE(plr_lens_ray(&o, far, ray));
    TEST_ASSERT_FALSE(plr_lens_pixel(&o, behind, px));
    const plr_real folded[3] = {PLR_R(1.2), 0, 1};
    TEST_ASSERT_FALSE(plr_lens_pixel(&o, folded, px));
}
