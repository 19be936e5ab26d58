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

static unsigned clamped(int i, unsigned count) {
    return i < 0 ? 0 : (unsigned)i < count ? (unsigned)i : count - 1;
}

/* Columns of a level that are made at once: their sums stay near the processor. */
enum { STRIP = 64 };

/* sum[i] <- 1 3 3 1 down column first + i, n of them; beyond the edges the last one is repeated. */
static void sum_columns(const uint8_t *const row[4], int width, int first, int n, uint16_t *sum) {
    const uint8_t *a = row[0], *b = row[1], *c = row[2], *d = row[3];
    const int begin = first < 0 ? -first : 0, end = first + n > width ? width - first : n;
    for (int i = begin; i < end; i++)
        sum[i] = (uint16_t)(a[first + i] + d[first + i] + 3 * (b[first + i] + c[first + i]));
    for (int i = 0; i < begin; i++)
        sum[i] = sum[begin];
    for (int i = end; i < n; i++)
        sum[i] = sum[end - 1];
}

void plr_pyramid_halve(const plr_image *in, uint8_t *out) {
    const unsigned width = in->width / 2U, height = in->height / 2U;
    uint16_t sum[2 * STRIP + 2];
    for (unsigned y = 0; y < height; y++) {
        const uint8_t *row[4];
        for (int j = 0; j < 4; j++)
            row[j] = in->pixels + clamped((int)(2 * y) - 1 + j, in->height) * in->stride;
        for (unsigned x = 0; x < width; x += STRIP) {
            const unsigned n = width - x < STRIP ? width - x : STRIP;
            sum_columns(row, in->width, (int)(2 * x) - 1, (int)(2 * n + 2), sum);
            for (unsigned i = 0; i < n; i++) {
                const uint16_t *s = sum + 2 * i;
                out[y * width + x + i] =
                    (uint8_t)((s[0] + s[3] + 3U * ((unsigned)s[1] + s[2]) + 32U) >> 6);
            }
        }
    }
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
