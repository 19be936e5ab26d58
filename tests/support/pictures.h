// SPDX-License-Identifier: MIT
/* Pictures for the tests of src/vision: a texture that is known between its pixels, too. */
#ifndef PELORUS_TESTS_PICTURES_H
#define PELORUS_TESTS_PICTURES_H

#include <stdint.h>

#include "pelorus/vision.h"
#include "support/random.h"

enum { TEXTURE_WAVES = 14 };

/* A sum of waves of 7 to 50 px, which no sampling or halving can mistake. */
typedef struct texture {
    double kx[TEXTURE_WAVES], ky[TEXTURE_WAVES], phase[TEXTURE_WAVES], share[TEXTURE_WAVES];
} texture;

/* How a texture is seen: pixel (u, v) shows it at at + A (u, v); grey = gain texture + offset, and noise. */
typedef struct view {
    double at[2], A[4], gain, offset, noise;
} view;

texture texture_of(uint64_t seed);

/* -1 to 1 or so. */
double texture_at(const texture *t, double x, double y);

/* As it lies: A = 1, mean 128, contrast of some 40 grey levels. */
view view_at(double x, double y);

/* Renders into pixels[height * stride]; what lies behind the width is left as it is. */
void render(uint8_t *pixels, unsigned width, unsigned height, unsigned stride, const texture *t,
            const view *how, rng *chance);

/* A rectified pair of this size: f = width, centre in the middle, baseline 0.1 m. */
plr_rig rectified_rig(unsigned width, unsigned height);

#endif
