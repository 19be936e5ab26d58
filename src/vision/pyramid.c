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

void plr_pyramid_halve_plain(const plr_image *in, uint8_t *out) {
    static const unsigned weight[4] = {1, 3, 3, 1};
    const unsigned width = in->width / 2U, height = in->height / 2U;
    for (unsigned y = 0; y < height; y++)
        for (unsigned x = 0; x < width; x++) {
            unsigned sum = 32;
            for (int j = 0; j < 4; j++)
                for (int i = 0; i < 4; i++)
                    sum += weight[j] * weight[i] *
                           in->pixels[clamped((int)(2 * y) - 1 + j, in->height) * in->stride +
                                      clamped((int)(2 * x) - 1 + i, in->width)];
            out[y * width + x] = (uint8_t)(sum / 64);
        }
}

/* Columns that are summed at once: so many that a row of sums stays near the processor. */
enum { STRIP = 64 };

/* Of columns first - 1 to first + 2 n of four rows, 1 3 3 1: sums of n + 1 pairs fit in 16 bits. */
static void sum_rows(const uint8_t *const row[4], unsigned width, int first, unsigned n,
                     uint16_t *sum) {
    for (unsigned i = 0; i < n; i++) {
        const unsigned x = clamped(first + (int)i, width);
        sum[i] = (uint16_t)(row[0][x] + row[3][x] + 3 * (row[1][x] + row[2][x]));
    }
}

/* The same where no column lies outside. */
static void sum_rows_inside(const uint8_t *const row[4], unsigned first, unsigned n,
                            uint16_t *restrict sum) {
    const uint8_t *a = row[0] + first, *b = row[1] + first, *c = row[2] + first,
                  *d = row[3] + first;
    for (unsigned i = 0; i < n; i++)
        sum[i] = (uint16_t)(a[i] + d[i] + 3 * (b[i] + c[i]));
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
            if (x > 0 && 2 * (x + n) + 1 <= in->width)
                sum_rows_inside(row, 2 * x - 1, 2 * n + 2, sum);
            else
                sum_rows(row, in->width, (int)(2 * x) - 1, 2 * n + 2, sum);
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
