// SPDX-License-Identifier: MIT
#include "support/vision_twin.h"

static unsigned clamped(int i, unsigned count) {
    return i < 0 ? 0 : (unsigned)i < count ? (unsigned)i : count - 1;
}

void plain_halve(const plr_image *in, uint8_t *out) {
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

/* Grey levels times 16 at a place in 1/65536 px, the weights of 6 bits. */
static int32_t bilinear(const plr_image *image, int32_t x, int32_t y) {
    const int32_t wx = x % 65536 / 1024, wy = y % 65536 / 1024;
    int32_t sum = 0;
    for (int j = 0; j < 2; j++)
        for (int i = 0; i < 2; i++)
            sum +=
                (i ? wx : 64 - wx) * (j ? wy : 64 - wy) *
                image
                    ->pixels[(uint32_t)(y / 65536 + j) * image->stride + (uint32_t)(x / 65536 + i)];
    return (sum + 128) / 256;
}

void plain_patch_sum(plr_patch_sums *s, const plr_image *image, const plr_grid *g,
                     const plr_template *t) {
    int64_t I = 0, II = 0, IT = 0, IJx = 0, IJy = 0;
    for (int k = 0; k < PLR_SAMPLES; k++) {
        const int32_t i = k % PLR_PATCH_SIDE - PLR_PATCH_SIDE / 2,
                      j = k / PLR_PATCH_SIDE - PLR_PATCH_SIDE / 2;
        const int32_t v =
            bilinear(image, g->x + g->A[0] * i + g->A[1] * j, g->y + g->A[2] * i + g->A[3] * j);
        I += v, II += (int64_t)v * v;
        IT += (int64_t)v * t->T[k], IJx += (int64_t)v * t->Jx[k], IJy += (int64_t)v * t->Jy[k];
    }
    s->I = (int32_t)I, s->II = (int32_t)II, s->IT = (int32_t)IT;
    s->IJx = (int32_t)IJx, s->IJy = (int32_t)IJy;
}
