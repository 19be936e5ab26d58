// SPDX-License-Identifier: MIT
/*
 * Included by kernels.c: eight pixels at once, in the integer vectors of a Cortex-M55 (MVE, Helium). A patch's row of
 * nine is a vector of eight; the ninth column is a vector by itself, and the last pixel a number.
 *
 * Where even and odd lanes come apart (b, t: bottom and top) they are put together again by a narrowing shift.
 */
#ifndef PLR_VISION_KERNELS_MVE_H
#define PLR_VISION_KERNELS_MVE_H

#include <arm_mve.h>

enum { PLR_LANES = 8, PLR_LAST = PLR_PATCH_SIDE - 1 };

/* (64 top + wy (low - top) + 128) >> 8 */
static inline int16x8_t plr_between(int16x8_t top, int16x8_t low, int16x8_t wy) {
    const int16x8_t gap = vsubq_s16(low, top);
    const int32x4_t b = vaddq_s32(vshllbq_n_s16(top, 6), vmullbq_int_s16(gap, wy));
    const int32x4_t t = vaddq_s32(vshlltq_n_s16(top, 6), vmulltq_int_s16(gap, wy));
    return vrshrntq_n_s32(vrshrnbq_n_s32(vdupq_n_s16(0), b, 8), t, 8);
}

/* 64 p + wx (q - p) */
static inline int16x8_t plr_along(int16x8_t p, int16x8_t q, int16x8_t wx) {
    return vmlaq_n_s16(vmulq_s16(vsubq_s16(q, p), wx), p, 64);
}

static inline int16x8_t plr_load_eight(const uint8_t *p) {
    return vreinterpretq_s16_u16(vldrbq_u16(p));
}

static inline int16x8_t plr_gather_eight(const uint8_t *p, uint16x8_t offset) {
    return vreinterpretq_s16_u16(vldrbq_gather_offset_u16(p, offset));
}

/* --- cutting --- */

static inline void plr_sample_eight(const uint8_t *p, uint32_t stride, int16x8_t wx, int16x8_t wy,
                                    uint8_t *to) {
    const int16x8_t a = plr_load_eight(p), b = plr_load_eight(p + 1),
                    c = plr_load_eight(p + stride), d = plr_load_eight(p + stride + 1);
    const int16x8_t grey =
        vrshrq_n_s16(plr_between(plr_along(a, b, wx), plr_along(c, d, wx), wy), 4);
    vstrbq_u16(to, vreinterpretq_u16_s16(grey));
}

/* A row of eleven is two vectors, of which the second begins at the fourth pixel. */
void plr_patch_sample(const plr_image *image, int32_t x, int32_t y,
                      uint8_t patch[PLR_PATCH_BYTES]) {
    const uint8_t *p =
        image->pixels + (uint32_t)(y >> PLR_FRACTION) * image->stride + (x >> PLR_FRACTION);
    const int16x8_t wx = vdupq_n_s16((int16_t)(x >> (PLR_FRACTION - PLR_WEIGHT) & 63));
    const int16x8_t wy = vdupq_n_s16((int16_t)(y >> (PLR_FRACTION - PLR_WEIGHT) & 63));
    for (int j = 0; j < PLR_PATCH_KEPT; j++, p += image->stride, patch += PLR_PATCH_KEPT) {
        plr_sample_eight(p, image->stride, wx, wy, patch);
        plr_sample_eight(p + PLR_PATCH_KEPT - PLR_LANES, image->stride, wx, wy,
                         patch + PLR_PATCH_KEPT - PLR_LANES);
    }
}

/* --- templates --- */

static inline void plr_add_eight(plr_template_sums *s, int16x8_t T, int16x8_t x, int16x8_t y) {
    s->T = vaddvaq_s16(s->T, T), s->Jx = vaddvaq_s16(s->Jx, x), s->Jy = vaddvaq_s16(s->Jy, y);
    s->TT = vmladavaq_s16(s->TT, T, T);
    s->xT = vmladavaq_s16(s->xT, x, T), s->yT = vmladavaq_s16(s->yT, y, T);
    s->xx = vmladavaq_s16(s->xx, x, x), s->xy = vmladavaq_s16(s->xy, x, y);
    s->yy = vmladavaq_s16(s->yy, y, y);
}

static inline int16x8_t plr_half_grey(int16x8_t more, int16x8_t less) {
    return vshlq_n_s16(vsubq_s16(more, less), 3);
}

void plr_template_fill(plr_template *t, const uint8_t patch[PLR_PATCH_BYTES],
                       plr_template_sums *s) {
    plr_template_sums sums = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    const uint8_t *p = patch + PLR_PATCH_KEPT + 1;
    for (int k = 0; k < PLR_SAMPLES; k += PLR_PATCH_SIDE, p += PLR_PATCH_KEPT) {
        const int16x8_t T = vshlq_n_s16(plr_load_eight(p), 4),
                        x = plr_half_grey(plr_load_eight(p + 1), plr_load_eight(p - 1));
        const int16x8_t y =
            plr_half_grey(plr_load_eight(p + PLR_PATCH_KEPT), plr_load_eight(p - PLR_PATCH_KEPT));
        vst1q_s16(t->T + k, T), vst1q_s16(t->Jx + k, x), vst1q_s16(t->Jy + k, y);
        plr_add_eight(&sums, T, x, y);
    }
    const uint16x8_t rows = vmulq_n_u16(vidupq_n_u16(0, 1), PLR_PATCH_KEPT);
    const uint16x8_t places = vmulq_n_u16(vidupq_n_u16(0, 1), PLR_PATCH_SIDE);
    p = patch + PLR_PATCH_KEPT + 1 + PLR_LAST;
    const int16x8_t T = vshlq_n_s16(plr_gather_eight(p, rows), 4);
    const int16x8_t x = plr_half_grey(plr_gather_eight(p + 1, rows), plr_gather_eight(p - 1, rows));
    const int16x8_t y = plr_half_grey(plr_gather_eight(p + PLR_PATCH_KEPT, rows),
                                      plr_gather_eight(p - PLR_PATCH_KEPT, rows));
    vstrhq_scatter_shifted_offset_s16(t->T + PLR_LAST, places, T);
    vstrhq_scatter_shifted_offset_s16(t->Jx + PLR_LAST, places, x);
    vstrhq_scatter_shifted_offset_s16(t->Jy + PLR_LAST, places, y);
    plr_add_eight(&sums, T, x, y);
    plr_template_add(&sums, t, p + PLR_LAST * PLR_PATCH_KEPT, PLR_SAMPLES - 1);
    *s = sums;
}

/* --- sums --- */

/* Eight places of a picture, beside its corner of the grid: even and odd ones, 1/65536 px. */
typedef struct plr_places {
    uint32x4_t x[2], y[2];
} plr_places;

/* The picture, and where the corner of the grid is. */
typedef struct plr_grid_corner {
    const uint8_t *pixels;
    uint16_t stride;
} plr_grid_corner;

static inline int16x8_t plr_samples_at(const plr_grid_corner *c, const plr_places *at) {
    const uint16x8_t none = vdupq_n_u16(0), six = vdupq_n_u16(63);
    const uint16x8_t across = vshrntq_n_u32(vshrnbq_n_u32(none, at->x[0], 16), at->x[1], 16);
    const uint16x8_t down = vshrntq_n_u32(vshrnbq_n_u32(none, at->y[0], 16), at->y[1], 16);
    const uint16x8_t wx =
        vandq_u16(vshrntq_n_u32(vshrnbq_n_u32(none, at->x[0], 10), at->x[1], 10), six);
    const uint16x8_t wy =
        vandq_u16(vshrntq_n_u32(vshrnbq_n_u32(none, at->y[0], 10), at->y[1], 10), six);
    const uint16x8_t offset = vmlaq_n_u16(across, down, c->stride);
    const uint8_t *p = c->pixels, *q = p + c->stride;
    const int16x8_t w = vreinterpretq_s16_u16(wx);
    const int16x8_t top =
        plr_along(plr_gather_eight(p, offset), plr_gather_eight(p + 1, offset), w);
    const int16x8_t low =
        plr_along(plr_gather_eight(q, offset), plr_gather_eight(q + 1, offset), w);
    return plr_between(top, low, vreinterpretq_s16_u16(wy));
}

static inline void plr_add_samples(plr_patch_sums *s, int16x8_t v, int16x8_t T, int16x8_t Jx,
                                   int16x8_t Jy) {
    s->I = vaddvaq_s16(s->I, v), s->II = vmladavaq_s16(s->II, v, v);
    s->IT = vmladavaq_s16(s->IT, v, T);
    s->IJx = vmladavaq_s16(s->IJx, v, Jx), s->IJy = vmladavaq_s16(s->IJy, v, Jy);
}

static int32_t plr_least(int32_t a, int32_t b) {
    return a < b ? a : b;
}

/* x_k = from + k by, k = 0 .. 7 */
static inline void plr_spread(uint32x4_t x[2], uint32_t from, uint32_t by) {
    const uint32x4_t even = vidupq_n_u32(0, 2);
    x[0] = vaddq_n_u32(vmulq_n_u32(even, by), from);
    x[1] = vaddq_n_u32(x[0], by);
}

static inline void plr_move_places(uint32x4_t x[2], uint32_t by) {
    x[0] = vaddq_n_u32(x[0], by), x[1] = vaddq_n_u32(x[1], by);
}

void plr_patch_sum(plr_patch_sums *s, const plr_image *image, const plr_grid *g,
                   const plr_template *t) {
    enum { REST = (1 << PLR_FRACTION) - 1 };
    const int32_t *A = g->A, half = PLR_PATCH_SIDE / 2;
    const uint32_t stride = image->stride;
    const int32_t x0 = g->x - half * (A[0] + A[1]), y0 = g->y - half * (A[2] + A[3]);
    const int32_t left =
        (x0 + plr_least(0, PLR_LAST * A[0]) + plr_least(0, PLR_LAST * A[1])) & ~REST;
    const int32_t top =
        (y0 + plr_least(0, PLR_LAST * A[2]) + plr_least(0, PLR_LAST * A[3])) & ~REST;
    const int32_t right = 2 * g->x - left, low = 2 * g->y - top; /* or a pixel less */
    if (stride > UINT16_MAX || (uint32_t)((low - top) >> PLR_FRACTION) * stride +
                                       (uint32_t)((right - left) >> PLR_FRACTION) >
                                   UINT16_MAX) { /* offsets have 16 bits */
        plr_patch_sum_plain(s, image, g, t);
        return;
    }
    const plr_grid_corner c = {image->pixels + (uint32_t)(top >> PLR_FRACTION) * stride +
                                   (left >> PLR_FRACTION),
                               (uint16_t)stride};
    const uint32_t x = (uint32_t)(x0 - left), y = (uint32_t)(y0 - top);
    plr_patch_sums sums = {0, 0, 0, 0, 0};
    plr_places at;
    plr_spread(at.x, x, (uint32_t)A[0]), plr_spread(at.y, y, (uint32_t)A[2]);
    for (int k = 0; k < PLR_SAMPLES; k += PLR_PATCH_SIDE) {
        plr_add_samples(&sums, plr_samples_at(&c, &at), vld1q_s16(t->T + k), vld1q_s16(t->Jx + k),
                        vld1q_s16(t->Jy + k));
        plr_move_places(at.x, (uint32_t)A[1]), plr_move_places(at.y, (uint32_t)A[3]);
    }
    plr_spread(at.x, x + PLR_LAST * (uint32_t)A[0], (uint32_t)A[1]);
    plr_spread(at.y, y + PLR_LAST * (uint32_t)A[2], (uint32_t)A[3]);
    const uint16x8_t column = vmulq_n_u16(vidupq_n_u16(0, 1), PLR_PATCH_SIDE);
    plr_add_samples(&sums, plr_samples_at(&c, &at),
                    vldrhq_gather_shifted_offset_s16(t->T + PLR_LAST, column),
                    vldrhq_gather_shifted_offset_s16(t->Jx + PLR_LAST, column),
                    vldrhq_gather_shifted_offset_s16(t->Jy + PLR_LAST, column));
    plr_sums_add(&sums, t, PLR_SAMPLES - 1,
                 plr_sample(image, x0 + PLR_LAST * (A[0] + A[1]), y0 + PLR_LAST * (A[2] + A[3])));
    *s = sums;
}

/* --- halving --- */

/* sum[i] <- 1 3 3 1 down a column, n of them; the last eight may be done twice. */
static void plr_sum_columns_inside(const uint8_t *const row[4], unsigned n, uint16_t *sum) {
    for (unsigned i = 0; i < n; i += PLR_LANES) {
        const unsigned k = i + PLR_LANES <= n ? i : n - PLR_LANES;
        const uint16x8_t outer = vaddq_u16(vldrbq_u16(row[0] + k), vldrbq_u16(row[3] + k));
        const uint16x8_t inner = vaddq_u16(vldrbq_u16(row[1] + k), vldrbq_u16(row[2] + k));
        vst1q_u16(sum + k, vmlaq_n_u16(outer, inner, 3));
    }
}

/* The same along the sums, of which every second begins one. */
static void plr_halve_row(const uint16_t *sum, unsigned n, uint8_t *out) {
    for (unsigned i = 0; i < n; i += PLR_LANES) {
        const unsigned k = i + PLR_LANES <= n ? i : n - PLR_LANES;
        const uint16x8x2_t first = vld2q_u16(sum + 2 * k), second = vld2q_u16(sum + 2 * k + 2);
        const uint16x8_t outer = vaddq_u16(first.val[0], second.val[1]);
        const uint16x8_t inner = vaddq_u16(first.val[1], second.val[0]);
        vstrbq_u16(out + k, vrshrq_n_u16(vmlaq_n_u16(outer, inner, 3), 6));
    }
}

/* A strip of n columns from x on, of one row. */
static void plr_halve_strip(const uint8_t *const row[4], unsigned width, unsigned x, unsigned n,
                            uint8_t *out) {
    uint16_t sum[2 * PLR_HALVED_AT_ONCE + 2];
    const unsigned first = x == 0, behind = 2 * (x + n) < width ? 0 : 2 * (x + n) + 1 - width;
    const uint8_t *inside[4];
    for (int j = 0; j < 4; j++)
        inside[j] = row[j] + 2 * x + first - 1;
    sum[1] = sum[2 * n] = 0; /* gcc does not see that vectors are stored there */
    plr_sum_columns_inside(inside, 2 * n + 2 - first - behind, sum + first);
    if (first)
        sum[0] = sum[1];
    if (behind)
        sum[2 * n + 1] = sum[2 * n];
    plr_halve_row(sum, n, out + x);
}

/* Both edges are repeated; what does not fill a strip is done twice. */
void plr_pyramid_halve(const plr_image *in, uint8_t *out) {
    const unsigned width = in->width / 2U, height = in->height / 2U;
    const unsigned n = width < PLR_HALVED_AT_ONCE ? width : PLR_HALVED_AT_ONCE;
    if (width < PLR_LANES) {
        plr_pyramid_halve_plain(in, out);
        return;
    }
    for (unsigned y = 0; y < height; y++, out += width) {
        const uint8_t *row[4];
        plr_rows_of(in, y, row);
        for (unsigned x = 0; x < width; x += n)
            plr_halve_strip(row, in->width, x + n <= width ? x : width - n, n, out);
    }
}

#endif
