// SPDX-License-Identifier: MIT
#include "vision/pyramid.h"

#include "pelorus/assertions.h"

/* The shorter side of the coarsest level, px: three patches. */
enum { LEAST_SIDE = 27 };

unsigned plr_pyramid_levels(unsigned width, unsigned height) {
    const unsigned side = width < height ? width : height;
    unsigned count = 1;
    while (count < PLR_VISION_LEVELS && side >> count >= LEAST_SIDE)
        count++;
    return count;
}

void plr_pyramid_build(plr_levels *l, const plr_picture *picture, unsigned count, uint8_t *store) {
    PLR_ASSERT(count >= 1 && count <= PLR_VISION_LEVELS);
    l->count = count;
    l->level[0].pixels = picture->pixels;
    l->level[0].stride = picture->stride;
    l->level[0].width = picture->width_px;
    l->level[0].height = picture->height_px;
    for (unsigned k = 1; k < count; k++) {
        plr_image *image = &l->level[k];
        plr_pyramid_halve(&l->level[k - 1], store);
        image->pixels = store;
        image->width = l->level[k - 1].width / 2U;
        image->height = l->level[k - 1].height / 2U;
        image->stride = image->width;
        store += (uint32_t)image->width * image->height;
    }
}

plr_real plr_pyramid_down(plr_real at, unsigned level) {
    const plr_real by = (plr_real)(1U << level);
    return (at + PLR_R(0.5)) / by - PLR_R(0.5);
}

plr_real plr_pyramid_up(plr_real at, unsigned level) {
    const plr_real by = (plr_real)(1U << level);
    return (at + PLR_R(0.5)) * by - PLR_R(0.5);
}
