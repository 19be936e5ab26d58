// SPDX-License-Identifier: MIT
/*
 * Pictures of half the size, a quarter, ...: weights 1 3 3 1 each way, rounded to 8 bits. The middle of
 * pixel i of a level lies at 2 i + 1/2 of the finer one. Level 0 is the caller's picture.
 */
#ifndef PLR_VISION_PYRAMID_H
#define PLR_VISION_PYRAMID_H

#include <stdint.h>

#include "pelorus/config.h"
#include "pelorus/vision.h"

/* A level of a picture. */
typedef struct plr_image {
    const uint8_t *pixels;
    uint32_t stride;
    uint16_t width, height;
} plr_image;

/* The levels of a picture, from the finest. */
typedef struct plr_levels {
    plr_image level[PLR_VISION_LEVELS];
    unsigned count;
} plr_levels;

/* How many levels a picture of this size has: none is narrower than some patches. */
unsigned plr_pyramid_levels(unsigned width, unsigned height);

/* out (width/2 x height/2, without gaps) <- in, halved. */
void plr_pyramid_halve(const plr_image *in, uint8_t *out);

/* All levels of a picture, the coarser ones into `store` (PLR_VISION_PIXELS / 3). */
void plr_pyramid_build(plr_levels *l, const plr_picture *picture, unsigned count, uint8_t *store);

/* A place of level 0 in a coarser level, and back. */
plr_real plr_pyramid_down(plr_real at, unsigned level);
plr_real plr_pyramid_up(plr_real at, unsigned level);

#endif
