// SPDX-License-Identifier: MIT
/* Patches: kernels beside their twins, and places that are known exactly. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "support/pictures.h"
#include "support/vision_twin.h"
#include "vision/patch.h"
#include "vision/pyramid.h"
#include "vision/track.h"

enum { W = 64, H = 48, U = 32, V = 24 }; /* and the middle */

static uint8_t first[W * H], second[W * H];
static texture scene;
static rng chance;

void setUp(void) {
    chance = rng_seeded(482);
    scene = texture_of(1);
}

static plr_image image_of(const uint8_t *pixels) {
    const plr_image image = {pixels, W, W, H};
    return image;
}

static void randomise(uint8_t *pixels, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        pixels[i] = (uint8_t)rng_uniform(&chance, 0, 256);
}

/* --- twins --- */

static void test_halving_is_sixteen_products_a_pixel_for_every_size(void) {
    static uint8_t fast[W * H], plain[W * H];
    randomise(first, W * H);
    for (unsigned width = 2; width <= W; width += width < 20 ? 1 : 5)
        for (unsigned height = 2; height < 12; height++) {
            const plr_image in = {first, W, (uint16_t)width, (uint16_t)height};
            memset(fast, 7, sizeof fast), memset(plain, 7, sizeof plain);
            plr_pyramid_halve(&in, fast);
            plain_halve(&in, plain);
            TEST_ASSERT_EQUAL_MEMORY(plain, fast, sizeof fast);
        }
}

static void test_halving_keeps_a_place_where_the_levels_say_that_it_is(void) {
    const view how = view_at(0, 0);
    render(first, W, H, W, &scene, &how, &chance);
    plr_levels l;
    const plr_picture picture = {first, W, W, H, 0};
    plr_pyramid_build(&l, &picture, 2, second);
    for (unsigned v = 4; v < 20; v += 3)
        for (unsigned u = 4; u < 28; u += 3) {
            double mean = 0; /* weights 1 3 3 1 about 2 u + 1/2 */
            static const double weight[4] = {1, 3, 3, 1};
            for (int j = 0; j < 4; j++)
                for (int i = 0; i < 4; i++)
                    mean += weight[j] * weight[i] / 64 *
                            (40 * texture_at(&scene, 2.0 * u - 1 + i, 2.0 * v - 1 + j) + 128);
            TEST_ASSERT_DOUBLE_WITHIN(1.2, mean, second[v * (W / 2) + u]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, 2 * u + 0.5, (double)plr_pyramid_up((plr_real)u, 1));
        }
}

static void test_sums_are_those_of_the_plain_twin(void) {
    uint8_t patch[PLR_PATCH_BYTES];
    randomise(first, W * H);
    const plr_image image = image_of(first);
    for (int run = 0; run < 2000; run++) {
        plr_template t;
        plr_grid g;
        plr_patch_sums fast, plain;
        randomise(patch, sizeof patch);
        if (run % 10 == 0) /* extremes: all that is summed at its largest */
            for (unsigned i = 0; i < sizeof patch; i++)
                patch[i] = first[i] = rng_below(&chance, 2) ? 255 : 0;
        TEST_ASSERT_TRUE(plr_template_make(&t, patch));
        const plr_real at[2] = {(plr_real)rng_uniform(&chance, -2, W + 2),
                                (plr_real)rng_uniform(&chance, -2, H + 2)};
        plr_real A[4];
        for (int i = 0; i < 4; i++)
            A[i] = (plr_real)rng_uniform(&chance, -1.5, 1.5);
        if (!plr_grid_place(&g, &image, at, A))
            continue;
        plr_patch_sum(&fast, &image, &g, &t);
        plain_patch_sum(&plain, &image, &g, &t);
        TEST_ASSERT_EQUAL_MEMORY(&plain, &fast, sizeof fast);
    }
}

/* --- places --- */

/* Finds the patch that is cut in the middle of the first picture in the second: the error in px. */
static double error_of(const view *how, const plr_real A[4], const double begin[2],
                       const double truth[2], plr_fit *fit) {
    uint8_t patch[PLR_PATCH_BYTES];
    plr_template t;
    const plr_real middle[2] = {U, V};
    const plr_image one = image_of(first), two = image_of(second);
    render(second, W, H, W, &scene, how, &chance);
    TEST_ASSERT_TRUE(plr_patch_cut(&one, middle, patch));
    TEST_ASSERT_TRUE(plr_template_make(&t, patch));
    fit->at[0] = (plr_real)begin[0], fit->at[1] = (plr_real)begin[1];
    plr_patch_fit(fit, &two, &t, A, 20);
    return hypot((double)fit->at[0] - truth[0], (double)fit->at[1] - truth[1]);
}

static const plr_real one_to_one[4] = {1, 0, 0, 1};

static void test_shifts_below_a_pixel_are_found_to_a_twentieth_of_one(void) {
    const view as_is = view_at(0, 0);
    render(first, W, H, W, &scene, &as_is, &chance);
    double worst = 0, sum2 = 0;
    for (int run = 0; run < 100; run++) {
        const double x = rng_uniform(&chance, -1.5, 1.5), y = rng_uniform(&chance, -1.5, 1.5);
        const double truth[2] = {U - x, V - y}, begin[2] = {U, V};
        const view how = view_at(x, y);
        plr_fit fit;
        const double error = error_of(&how, one_to_one, begin, truth, &fit);
        TEST_ASSERT_TRUE(fit.inside && fit.ended);
        worst = fmax(worst, error), sum2 += error * error;
    }
    TEST_ASSERT_LESS_THAN_DOUBLE(0.1, worst);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.05, sqrt(sum2 / 100));
}

static void test_gain_and_offset_of_the_exposure_do_not_move_a_place(void) {
    const view as_is = view_at(0, 0);
    render(first, W, H, W, &scene, &as_is, &chance);
    for (int run = 0; run < 40; run++) {
        view how = view_at(0.4, -0.3);
        how.gain = rng_uniform(&chance, 20, 60), how.offset = rng_uniform(&chance, 100, 150);
        const double truth[2] = {U - 0.4, V + 0.3}, begin[2] = {U, V};
        plr_fit fit;
        TEST_ASSERT_LESS_THAN_DOUBLE(0.08, error_of(&how, one_to_one, begin, truth, &fit));
        TEST_ASSERT_GREATER_THAN_DOUBLE(0.98, (double)fit.likeness);
    }
}

static void test_a_warp_that_is_told_is_followed_and_one_that_is_not_shows(void) {
    const view as_is = view_at(0, 0);
    render(first, W, H, W, &scene, &as_is, &chance);
    /* the second picture is larger by 1.25 and turned by 0.2 rad about the middle */
    const double c = cos(0.2) / 1.25, s = sin(0.2) / 1.25;
    view how = view_at(U - c * U + s * V, V - s * U - c * V);
    how.A[0] = how.A[3] = c, how.A[1] = -s, how.A[2] = s;
    const plr_real A[4] = {(plr_real)(1.25 * cos(0.2)), (plr_real)(1.25 * sin(0.2)),
                           (plr_real)(-1.25 * sin(0.2)), (plr_real)(1.25 * cos(0.2))};
    const double truth[2] = {U, V}, begin[2] = {U + 0.7, V - 0.5};
    plr_fit told, untold;
    TEST_ASSERT_LESS_THAN_DOUBLE(0.08, error_of(&how, A, begin, truth, &told));
    (void)error_of(&how, one_to_one, begin, truth, &untold);
    TEST_ASSERT_GREATER_THAN_DOUBLE(0.99, (double)told.likeness);
    TEST_ASSERT_LESS_THAN_DOUBLE((double)told.likeness - 0.01, (double)untold.likeness);
}

/* A thin cross: a step by central differences leads twice as far as it should. */
static void test_sharp_lines_are_found_without_swinging(void) {
    for (int run = 0; run < 20; run++) {
        const double x = rng_uniform(&chance, -0.9, 0.9), y = rng_uniform(&chance, -0.9, 0.9);
        for (int v = 0; v < H; v++)
            for (int u = 0; u < W; u++) {
                const double by[2] = {fmax(0, 1 - abs(u - U)), fmax(0, 1 - abs(v - V))};
                const double to[2] = {fmax(0, 1 - fabs(u - U - x)), fmax(0, 1 - fabs(v - V - y))};
                first[v * W + u] = (uint8_t)(40 + 100 * (by[0] + by[1]));
                second[v * W + u] = (uint8_t)lrint(40 + 100 * (to[0] + to[1]));
            }
        uint8_t patch[PLR_PATCH_BYTES];
        plr_template t;
        plr_fit fit = {.at = {U, V}};
        const plr_real middle[2] = {U, V};
        const plr_image one = image_of(first), two = image_of(second);
        TEST_ASSERT_TRUE(plr_patch_cut(&one, middle, patch));
        TEST_ASSERT_TRUE(plr_template_make(&t, patch));
        plr_patch_fit(&fit, &two, &t, one_to_one, 10);
        TEST_ASSERT_TRUE(fit.inside && fit.ended);
        TEST_ASSERT_DOUBLE_WITHIN(0.06, U + x, (double)fit.at[0]);
        TEST_ASSERT_DOUBLE_WITHIN(0.06, V + y, (double)fit.at[1]);
    }
}

/* A corner two pixels beside the middle: about it, and not about the middle, the patch can grow. */
static void test_the_centre_of_a_patch_is_the_corner_in_it(void) {
    for (int v = 0; v < H; v++)
        for (int u = 0; u < W; u++)
            first[v * W + u] = u >= U + 2 && v >= V - 1 ? 200 : 60;
    uint8_t patch[PLR_PATCH_BYTES];
    plr_template t;
    plr_real centre[2];
    const plr_real middle[2] = {U, V};
    const plr_image image = image_of(first);
    TEST_ASSERT_TRUE(plr_patch_cut(&image, middle, patch));
    TEST_ASSERT_TRUE(plr_template_make(&t, patch));
    plr_template_centre(&t, centre);
    TEST_ASSERT_DOUBLE_WITHIN(0.3, 1.5, (double)centre[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.3, -1.5, (double)centre[1]);
}

/* The second picture shows the first one sheared along its rows, as the other eye sees a floor. */
static void test_a_slope_is_read_from_what_a_fit_leaves_over(void) {
    double sum2 = 0;
    for (int run = 0; run < 60; run++) {
        const view as_is = view_at(run * 11.0, 3);
        render(first, W, H, W, &scene, &as_is, &chance);
        const double slope[2] = {rng_uniform(&chance, -0.1, 0.1), rng_uniform(&chance, -0.1, 0.1)};
        view how = as_is; /* o in the first is at o - (slope o, 0) in the second */
        how.A[0] = 1 / (1 - slope[0]), how.A[1] = slope[1] / (1 - slope[0]);
        how.at[0] += U - how.A[0] * U - how.A[1] * V;
        const double truth[2] = {U, V};
        plr_fit fit;
        (void)error_of(&how, one_to_one, truth, truth, &fit);
        TEST_ASSERT_TRUE(fit.inside && fit.ended);
        uint8_t patch[PLR_PATCH_BYTES];
        plr_template t;
        const plr_real middle[2] = {U, V}, c[2] = {-1, 0};
        plr_real change[2], info[3];
        const plr_image one = image_of(first), two = image_of(second);
        TEST_ASSERT_TRUE(plr_patch_cut(&one, middle, patch) && plr_template_make(&t, patch));
        TEST_ASSERT_TRUE(plr_patch_slope(&two, &t, fit.at, one_to_one, c, change, info));
        sum2 += pow((double)change[0] - slope[0], 2) + pow((double)change[1] - slope[1], 2);
        TEST_ASSERT_GREATER_THAN_DOUBLE(0, (double)(info[0] * info[2] - info[1] * info[1]));
    }
    TEST_ASSERT_LESS_THAN_DOUBLE(0.035, sqrt(sum2 / 120)); /* those of the slopes are 0.058 */
}

/* The told covariance is that of the errors, where noise is all that is wrong. */
/* (prior I + sum k^age F)^-1 sum k^age F m, summed anew over all fits. */
static void slope_twin(double slope[2], double prior, double (*fit)[3], double (*measured)[2],
                       int n) {
    double a = prior, b = 0, c = prior, x = 0, y = 0;
    for (int i = 0; i < n; i++) {
        const double w = pow(0.9, n - 1 - i), *F = fit[i], *m = measured[i];
        a += w * F[0], b += w * F[1], c += w * F[2];
        x += w * (F[0] * m[0] + F[1] * m[1]), y += w * (F[1] * m[0] + F[2] * m[1]);
    }
    const double det = a * c - b * b;
    slope[0] = (c * x - b * y) / det, slope[1] = (a * y - b * x) / det;
}

static void test_a_slope_is_the_mean_of_all_fits_and_of_a_prior_that_stays(void) {
    enum { FITS = 30 };
    for (int round = 0; round < 50; round++) {
        double fits[FITS][3], told[FITS][2], twin[2];
        plr_real slope[2] = {0, 0}, info[3] = {0, 0, 0};
        const double prior = rng_uniform(&chance, 1, 100);
        for (int n = 0; n < FITS; n++) {
            const double p = rng_normal(&chance), q = rng_normal(&chance), s = rng_normal(&chance);
            fits[n][0] = 50 * p * p, fits[n][1] = 50 * p * q, fits[n][2] = 50 * (q * q + s * s);
            told[n][0] = 0.3 * rng_normal(&chance), told[n][1] = 0.3 * rng_normal(&chance);
            const plr_real fit[3] = {(plr_real)fits[n][0], (plr_real)fits[n][1],
                                     (plr_real)fits[n][2]};
            const plr_real measured[2] = {(plr_real)told[n][0], (plr_real)told[n][1]};
            plr_track_weigh_slope(slope, info, (plr_real)prior, measured, fit);
            slope_twin(twin, prior, fits, told, n + 1);
            for (int i = 0; i < 2 && fabs(twin[0]) < 0.9 && fabs(twin[1]) < 0.9; i++)
                TEST_ASSERT_DOUBLE_WITHIN(1e-4, twin[i], (double)slope[i]);
        }
    }
}

static void test_a_slope_that_fits_tell_no_more_tends_to_that_of_a_facing_surface(void) {
    plr_real slope[2] = {PLR_R(0.8), PLR_R(-0.5)}, info[3] = {40, 0, 40};
    const plr_real nothing[3] = {0, 0, 0}, nowhere[2] = {0, 0};
    double last = (double)slope[0];
    for (int pair = 0; pair < 60; pair++) {
        plr_track_weigh_slope(slope, info, 10, nowhere, nothing);
        TEST_ASSERT_TRUE((double)slope[0] < last && slope[0] > 0);
        last = (double)slope[0];
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0, (double)slope[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0, (double)slope[1]);
}

static void test_the_told_uncertainty_is_that_of_the_errors(void) {
    double squares = 0, worst = 0;
    const int runs = 300;
    for (int run = 0; run < runs; run++) {
        view as_is = view_at(run * 11.0, 0), how = as_is;
        as_is.noise = how.noise = 4;
        how.at[0] += 0.3, how.at[1] -= 0.6;
        render(first, W, H, W, &scene, &as_is, &chance);
        const double truth[2] = {U - 0.3, V + 0.6}, begin[2] = {U, V};
        plr_fit fit;
        const double error = error_of(&how, one_to_one, begin, truth, &fit);
        const double d2 = error * error / (double)(fit.cov[0] + fit.cov[2]);
        squares += d2 / runs, worst = fmax(worst, d2);
    }
    TEST_ASSERT_GREATER_THAN_DOUBLE(0.7, squares);
    TEST_ASSERT_LESS_THAN_DOUBLE(1.4, squares);
    TEST_ASSERT_LESS_THAN_DOUBLE(25, worst);
}

static void test_what_lies_outside_is_said_and_not_read(void) {
    const plr_image image = image_of(first);
    uint8_t patch[PLR_PATCH_BYTES];
    const plr_real edges[6][2] = {{PLR_R(4.9), V}, {U, PLR_R(4.9)}, {W - 6, V},
                                  {U, H - 6},      {-1000, -1000},  {PLR_R(1e9), PLR_R(1e9)}};
    for (int i = 0; i < 6; i++)
        TEST_ASSERT_FALSE(plr_patch_cut(&image, edges[i], patch));
    const plr_real nan[2] = {(plr_real)NAN, V}, huge[4] = {PLR_R(1e30), 0, 0, 1};
    const plr_real middle[2] = {U, V};
    plr_grid g;
    TEST_ASSERT_FALSE(plr_patch_cut(&image, nan, patch));
    TEST_ASSERT_FALSE(plr_grid_place(&g, &image, nan, one_to_one));
    TEST_ASSERT_FALSE(plr_grid_place(&g, &image, middle, huge));
    TEST_ASSERT_TRUE(plr_patch_cut(&image, middle, patch));
}

static void test_a_patch_without_contrast_in_both_directions_is_refused(void) {
    uint8_t patch[PLR_PATCH_BYTES];
    plr_template t;
    memset(patch, 90, sizeof patch);
    TEST_ASSERT_FALSE(plr_template_make(&t, patch));
    for (unsigned i = 0; i < sizeof patch; i++) /* an edge */
        patch[i] = i % PLR_PATCH_KEPT < 5 ? 40 : 200;
    TEST_ASSERT_FALSE(plr_template_make(&t, patch));
    patch[60] = 0, patch[61] = 0, patch[71] = 0;
    TEST_ASSERT_TRUE(plr_template_make(&t, patch));
}
