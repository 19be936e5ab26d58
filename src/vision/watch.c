// SPDX-License-Identifier: MIT
#include "vision/watch.h"

#include <string.h>

#include "math/leaky.h"
#include "math/small.h"

/* Grey levels of a picture in which nothing is seen. */
enum { DARK = 6, BRIGHT = 249, LEAST_VARIANCE = 2, LEAST_TRACKS = 8 };

/* A pair's weight falls to a half in some hundred pairs. */
#define KEEP PLR_R(0.993)
/* Less tells nothing of a delay: rows that move by a few px per second, in all. */
#define LEAST_RATE2 PLR_R(100)

/* FNV-1a of a level's words. */
static uint32_t hash_of(const plr_image *image) {
    uint32_t hash = 2166136261U;
    for (unsigned y = 0; y < image->height; y++) {
        const uint8_t *row = image->pixels + y * image->stride;
        unsigned x = 0;
        for (; x + 4 <= image->width; x += 4) {
            const uint32_t word = (uint32_t)row[x] | (uint32_t)row[x + 1] << 8 |
                                  (uint32_t)row[x + 2] << 16 | (uint32_t)row[x + 3] << 24;
            hash = (hash ^ word) * 16777619U;
            hash ^= hash >> 15;
        }
        for (; x < image->width; x++)
            hash = (hash ^ row[x]) * 16777619U;
    }
    return hash;
}

/* Of the coarsest level: its mean and variance are the picture's, less its noise. */
static uint8_t light(const plr_image *image) {
    uint32_t sum = 0;
    uint64_t squares = 0;
    for (unsigned y = 0; y < image->height; y++)
        for (unsigned x = 0; x < image->width; x++) {
            const uint32_t grey = image->pixels[y * image->stride + x];
            sum += grey, squares += grey * grey;
        }
    const uint64_t n = (uint64_t)image->width * image->height, mean = sum / n;
    const uint64_t variance = (squares - (uint64_t)sum * sum / n) / n;
    if (variance >= LEAST_VARIANCE * 8)
        return 0;
    if (mean < DARK)
        return PLR_PICTURE_DARK;
    if (mean > BRIGHT)
        return PLR_PICTURE_BRIGHT;
    return variance < LEAST_VARIANCE ? PLR_PICTURE_FLAT : 0;
}

uint8_t plr_watch_picture(const plr_levels *l, uint32_t *hash, bool first) {
    const uint32_t now = hash_of(&l->level[l->count > 1 ? 1 : 0]);
    uint8_t faults = light(&l->level[l->count - 1]);
    if (!first && now == *hash)
        faults |= PLR_PICTURE_REPEATED;
    *hash = now;
    return faults;
}

/* The means over n observations: px by which the right row is lower, and px/s by which it moves. */
static void rows_of(const plr_vision *v, const plr_expected_motion *m, unsigned n, plr_real *gap,
                    plr_real *rate) {
    *gap = *rate = 0;
    for (unsigned i = 0; i < n; i++) {
        const plr_observation *o = &v->observations[i];
        const plr_real by = 1 / plr_rig_depth(v, (plr_real)(o->uL_px - o->uR_px));
        const plr_real down = (plr_real)o->vL_px - v->cy;
        const plr_real ray[3] = {((plr_real)o->uL_px - v->cx) / v->fx, down / v->fy, 1};
        plr_real turn[3];
        plr_cross3(turn, m->w, ray);
        *gap += (plr_real)(o->vR_px - o->vL_px);
        *rate +=
            PLR_FMA(v->fy, PLR_FMA(m->u[1], by, turn[1]), -(down * PLR_FMA(m->u[2], by, turn[2])));
    }
    *gap /= (plr_real)n, *rate /= (plr_real)n;
}

/* Later by s, the right rows differ by s times their rate, beside what the calibration makes constant. */
static void tell_delay(plr_vision *v) {
    const plr_row_gaps *g = &v->gaps;
    const plr_real rate2 = PLR_FMA(-g->rate, g->rate / g->count, g->rate2);
    const plr_real gap_rate = PLR_FMA(-g->rate, g->gap / g->count, g->gap_rate);
    const plr_real gap2 = PLR_FMA(-g->gap, g->gap / g->count, g->gap2);
    if (!(g->count > 10) || !(rate2 > LEAST_RATE2))
        return;
    const plr_real delay = gap_rate / rate2, rest = PLR_FMA(-delay, gap_rate, gap2);
    v->report.halves_apart_s = (float)delay;
    v->report.halves_sigma_s = (float)PLR_SQRT((rest > 0 ? rest : 0) / (g->count - 2) / rate2);
}

void plr_watch_rows(plr_vision *v, const plr_expected_motion *m, unsigned n) {
    plr_row_gaps *g = &v->gaps;
    if (m->known && n >= LEAST_TRACKS) {
        plr_real gap, rate;
        rows_of(v, m, n, &gap, &rate);
        g->count = plr_leaky_sum(g->count, KEEP, PLR_R(1));
        g->rate = plr_leaky_sum(g->rate, KEEP, rate);
        g->gap = plr_leaky_sum(g->gap, KEEP, gap);
        g->rate2 = plr_leaky_sum(g->rate2, KEEP, rate * rate);
        g->gap_rate = plr_leaky_sum(g->gap_rate, KEEP, gap * rate);
        g->gap2 = plr_leaky_sum(g->gap2, KEEP, gap * gap);
    }
    tell_delay(v);
}
