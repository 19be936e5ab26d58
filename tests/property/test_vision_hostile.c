// SPDX-License-Identifier: MIT
/* Pictures, sizes, strides, lenses and expectations by chance and by malice: nothing is read beyond a picture
 * (sanitizers look on), the work is bounded, and what is handed out is finite. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "support/pictures.h"

enum { PAIRS = PELORUS_SHORT_FORM ? 300 : 2000, PAIRS_OF_A_RIG = 8 };

static plr_vision eyes;
static rng chance, speeds;
static texture scene;

void setUp(void) {
    chance = rng_seeded(484);
    speeds = rng_seeded(7);
    scene = texture_of(3);
}

static plr_rig any_rig(void) {
    const unsigned width = 48 + rng_below(&chance, 130), height = 48 + rng_below(&chance, 100);
    plr_rig rig = rectified_rig(width, height);
    rig.tracks = (uint16_t)(1 + rng_below(&chance, 40));
    for (int side = 0; side < 2; side++) {
        plr_lens *lens = side ? &rig.right : &rig.left;
        lens->model = (uint8_t)rng_below(&chance, 3);
        for (int i = 0; i < 4; i++)
            lens->k[i] = rng_normal(&chance) * (rng_below(&chance, 4) ? 0.05 : 2);
    }
    const double a = rng_normal(&chance) * 0.3;
    rig.T_RL.R[0] = rig.T_RL.R[4] = cos(a), rig.T_RL.R[1] = -sin(a), rig.T_RL.R[3] = sin(a);
    rig.row_time_s = rng_below(&chance, 2) ? 3e-5 : 0;
    return rig;
}

/* Noise, texture, checks of full contrast, one grey level, or a picture of zeros and a spot. */
static void fill(uint8_t *pixels, unsigned width, unsigned height, unsigned stride) {
    const unsigned kind = rng_below(&chance, 5), side = 1 + rng_below(&chance, 9);
    const view how = view_at(rng_uniform(&chance, 0, 9), rng_uniform(&chance, 0, 9));
    if (kind == 0)
        render(pixels, width, height, stride, &scene, &how, &chance);
    for (unsigned v = 0; v < height && kind > 0; v++)
        for (unsigned u = 0; u < width; u++)
            pixels[v * stride + u] =
                (uint8_t)(kind == 1   ? rng_below(&chance, 256)
                          : kind == 2 ? (u / side + v / side) % 2 * 255U
                          : kind == 3 ? side * 20
                                      : (u / 7 == side && v / 5 == side) * 255U);
}

static plr_expected any_expected(plr_depth *depths) {
    plr_expected e;
    const double a = rng_normal(&chance) * (rng_below(&chance, 5) ? 0.05 : 3);
    memset(&e, 0, sizeof e);
    e.motion.R[0] = e.motion.R[8] = cos(a), e.motion.R[2] = -sin(a), e.motion.R[6] = sin(a);
    e.motion.R[4] = 1;
    for (int i = 0; i < 3; i++)
        e.motion.p[i] =
            rng_below(&chance, 3) ? rng_normal(&chance) * 0.2 : rng_uniform(&chance, -100, 100);
    e.velocity_known = rng_below(&speeds, 2);
    for (int i = 0; i < 3; i++) {
        e.v_C_mps[i] = rng_uniform(&speeds, -1000, 1000) * (rng_below(&speeds, 3) ? 1e-3 : 1);
        e.w_C_radps[i] = rng_uniform(&speeds, -100, 100) * (rng_below(&speeds, 3) ? 1e-2 : 1);
    }
    for (unsigned i = 0; i < 20; i++) {
        static const float odd[5] = {0, -1, 1e-30F, 1e30F, 2};
        depths[i].id = rng_below(&chance, 100);
        depths[i].z_m = odd[rng_below(&chance, 5)];
    }
    e.depths = depths, e.depth_count = 20;
    return e;
}

static void demand_sound(const plr_frame *frame) {
    TEST_ASSERT_LESS_OR_EQUAL(eyes.wanted, frame->count);
    TEST_ASSERT_LESS_OR_EQUAL(eyes.wanted, eyes.track_count);
    for (unsigned i = 0; i < frame->count; i++) {
        const plr_observation *o = &frame->observations[i];
        TEST_ASSERT_TRUE(isfinite(o->uL_px) && isfinite(o->vL_px) && isfinite(o->uR_px) &&
                         isfinite(o->vR_px));
        TEST_ASSERT_TRUE(isfinite(eyes.sights[i].sigma_px) && eyes.sights[i].sigma_px > 0);
        TEST_ASSERT_TRUE(i == 0 || o->id > o[-1].id);
    }
    /* two fits a track, and two a try of a birth, on four levels */
    TEST_ASSERT_LESS_OR_EQUAL(eyes.wanted * (2 + 2 * 3) * 25 + 8 * 25, eyes.report.steps);
}

static void test_whatever_comes_in_what_goes_out_is_finite_and_bounded(void) {
    unsigned taken = 0, seen = 0;
    for (int pair = 0; pair < PAIRS;) {
        const plr_rig rig = any_rig();
        if (plr_vision_init(&eyes, &rig) != PLR_OK) {
            pair++;
            continue;
        }
        const unsigned width = rig.left.width_px, height = rig.left.height_px;
        const unsigned stride = width + rng_below(&chance, 9), end = stride * (height - 1) + width;
        for (int k = 0; k < PAIRS_OF_A_RIG; k++, pair++) {
            uint8_t *l = malloc(end), *r = malloc(end); /* to the byte, for the sanitizer */
            TEST_ASSERT_TRUE(l && r);
            fill(l, width, height, stride);
            if (rng_below(&chance, 3))
                memcpy(r, l, end);
            else
                fill(r, width, height, stride);
            plr_depth depths[20];
            const plr_expected e = any_expected(depths);
            const plr_time_ns t = 1000U + (unsigned)k * 50000000U;
            const plr_picture_pair both = {
                {l, stride, (uint16_t)width, (uint16_t)height, t},
                {r, stride, (uint16_t)width, (uint16_t)height, t + rng_below(&chance, 1000)}};
            plr_frame frame;
            TEST_ASSERT_EQUAL(
                PLR_OK, plr_vision_track(&eyes, &both, rng_below(&chance, 2) ? &e : NULL, &frame));
            demand_sound(&frame);
            taken++, seen += frame.count;
            free(l), free(r);
        }
    }
    TEST_ASSERT_GREATER_THAN(PAIRS / 3, taken);
    TEST_ASSERT_GREATER_THAN(PAIRS / 3, seen);
}
