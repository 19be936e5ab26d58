// SPDX-License-Identifier: MIT
/* Plain twins of the kernels of src/vision, by their definitions. */
#ifndef PELORUS_TESTS_VISION_TWIN_H
#define PELORUS_TESTS_VISION_TWIN_H

#include "vision/patch.h"
#include "vision/pyramid.h"

/* plr_pyramid_halve: sixteen products a pixel, edges repeated. */
void plain_halve(const plr_image *in, uint8_t *out);

/* plr_patch_sum: sample by sample, in 64 bits. */
void plain_patch_sum(plr_patch_sums *s, const plr_image *image, const plr_grid *g,
                     const plr_template *t);

#endif
