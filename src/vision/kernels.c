// SPDX-License-Identifier: MIT
#include "vision/kernels.h"

/* Adds sample k of a template: its px is p. */
static inline void plr_template_add(plr_template_sums *s, plr_template *t, const uint8_t *p,
                                    int k) {
    const int32_t T = PLR_GREY * p[0], x = PLR_GREY / 2 * (p[1] - p[-1]);
    const int32_t y = PLR_GREY / 2 * (p[PLR_PATCH_KEPT] - p[-PLR_PATCH_KEPT]);
    t->T[k] = (int16_t)T, t->Jx[k] = (int16_t)x, t->Jy[k] = (int16_t)y;
    s->T += T, s->Jx += x, s->Jy += y;
    s->TT += T * T, s->xT += x * T, s->yT += y * T;
    s->xx += x * x, s->xy += x * y, s->yy += y * y;
}

/* Adds sample k of a picture. */
static inline void plr_sums_add(plr_patch_sums *s, const plr_template *t, int k, int32_t v) {
    s->I += v, s->II += v * v;
    s->IT += v * t->T[k], s->IJx += v * t->Jx[k], s->IJy += v * t->Jy[k];
}

static unsigned clamped(int i, unsigned count) {
    return i < 0 ? 0 : (unsigned)i < count ? (unsigned)i : count - 1;
}

/* The four rows of which row y of the halved picture is made. */
static void plr_rows_of(const plr_image *in, unsigned y, const uint8_t *row[4]) {
    for (int j = 0; j < 4; j++)
        row[j] = in->pixels + clamped((int)(2 * y) - 1 + j, in->height) * in->stride;
}

/* Columns of a level that are made at once: their sums stay near the processor. */
enum { PLR_HALVED_AT_ONCE = 64 };

/* --- the plain twins --- */

void plr_patch_sample_plain(const plr_image *image, int32_t x, int32_t y,
                            uint8_t patch[PLR_PATCH_BYTES]) {
    const plr_image here =
        *image; /* bytes of a patch might be its own, for all that a compiler knows */
    for (int j = 0; j < PLR_PATCH_KEPT; j++)
        for (int i = 0; i < PLR_PATCH_KEPT; i++) {
            const int32_t s =
                plr_sample(&here, x + i * (1 << PLR_FRACTION), y + j * (1 << PLR_FRACTION));
            patch[PLR_PATCH_KEPT * j + i] = (uint8_t)((s + PLR_GREY / 2) / PLR_GREY);
        }
}

void plr_template_fill_plain(plr_template *t, const uint8_t patch[PLR_PATCH_BYTES],
                             plr_template_sums *s) {
    plr_template_sums sums = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    for (int j = 0, k = 0; j < PLR_PATCH_SIDE; j++)
        for (int i = 0; i < PLR_PATCH_SIDE; i++, k++)
            plr_template_add(&sums, t, patch + PLR_PATCH_KEPT * (j + 1) + i + 1, k);
    *s = sums;
}

/* Sums in 32 bits: 81 times the largest product, 4080^2, is 1.35e9. */
void plr_patch_sum_plain(plr_patch_sums *s, const plr_image *image, const plr_grid *g,
                         const plr_template *t) {
    enum { HALF = PLR_PATCH_SIDE / 2 };
    const plr_image here = *image;
    plr_patch_sums sums = {0, 0, 0, 0, 0};
    int32_t x0 = g->x - HALF * (g->A[0] + g->A[1]), y0 = g->y - HALF * (g->A[2] + g->A[3]);
    for (int j = 0, k = 0; j < PLR_PATCH_SIDE; j++, x0 += g->A[1], y0 += g->A[3]) {
        int32_t x = x0, y = y0;
        for (int i = 0; i < PLR_PATCH_SIDE; i++, k++, x += g->A[0], y += g->A[2])
            plr_sums_add(&sums, t, k, plr_sample(&here, x, y));
    }
    *s = sums;
}

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

void plr_pyramid_halve_plain(const plr_image *in, uint8_t *out) {
    enum { STRIP = PLR_HALVED_AT_ONCE };
    const unsigned width = in->width / 2U, height = in->height / 2U;
    uint16_t sum[2 * STRIP + 2];
    for (unsigned y = 0; y < height; y++) {
        const uint8_t *row[4];
        plr_rows_of(in, y, row);
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

/* --- what is used --- */

#include PLR_PIXELS_FILE
