// SPDX-License-Identifier: MIT
/*
 * The loops over pixels in which most of a pair's instructions are spent. Integers alone, so that any order of them
 * has the same bits: those of a Cortex-M55's vectors (kernels_mve.h) and those of C (kernels_in_c.h), which call the
 * plain twins.
 */
#ifndef PLR_VISION_KERNELS_H
#define PLR_VISION_KERNELS_H

#include "vision/patch.h"
#include "vision/pyramid.h"

enum {
    PLR_FRACTION = 16,
    PLR_WEIGHT = 6
}; /* bits of a place below the pixel, and of those that weigh */

/* The sample at a place in 1/65536 px: grey levels times 16. */
static inline int32_t plr_sample(const plr_image *image, int32_t x, int32_t y) {
    const uint8_t *p =
        image->pixels + (uint32_t)(y >> PLR_FRACTION) * image->stride + (x >> PLR_FRACTION);
    const uint8_t *q = p + image->stride;
    const int32_t wx = (x >> (PLR_FRACTION - PLR_WEIGHT)) & 63;
    const int32_t wy = (y >> (PLR_FRACTION - PLR_WEIGHT)) & 63;
    const int32_t top = 64 * p[0] + wx * (p[1] - p[0]), low = 64 * q[0] + wx * (q[1] - q[0]);
    return (64 * top + wy * (low - top) + 128) >> 8;
}

/* What a template's 81 samples add up to. */
typedef struct plr_template_sums {
    int32_t T, Jx, Jy, TT, xT, yT, xx, xy, yy;
} plr_template_sums;

/* patch <- the 11 x 11 px of which the first lies at (x, y), 1/65536 px. */
void plr_patch_sample(const plr_image *image, int32_t x, int32_t y, uint8_t patch[PLR_PATCH_BYTES]);
void plr_patch_sample_plain(const plr_image *image, int32_t x, int32_t y,
                            uint8_t patch[PLR_PATCH_BYTES]);

/* T, Jx and Jy of a template, and their sums. */
void plr_template_fill(plr_template *t, const uint8_t patch[PLR_PATCH_BYTES], plr_template_sums *s);
void plr_template_fill_plain(plr_template *t, const uint8_t patch[PLR_PATCH_BYTES],
                             plr_template_sums *s);

/* The twins of plr_patch_sum (patch.h) and plr_pyramid_halve (pyramid.h). */
void plr_patch_sum_plain(plr_patch_sums *s, const plr_image *image, const plr_grid *g,
                         const plr_template *t);
void plr_pyramid_halve_plain(const plr_image *in, uint8_t *out);

#endif
