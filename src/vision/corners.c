// SPDX-License-Identifier: MIT
#include "vision/corners.h"

#include <string.h>

#include "math/small.h"

enum {
    CELLS_LONG = 19, /* along the longer side */
    WIDEST = 400, /* px of the level in which corners are looked for, if there is a coarser one */
    MOST_COLUMNS =
        32,    /* of a cell, every second px, with its margin; of a larger cell the left part */
    BOX = 4,   /* samples each way, of every second px: 7 x 7 px */
    BORDER = 6 /* px of the level beside which no patch fits */
};

/* A corner's place is then sure to half a pixel beside a noise of one grey level: 16 samples of Sobel's
 * gradients, which are 8 times those of a px. */
#define WEAKEST PLR_R(64.0 * 4)

plr_cells plr_cells_of(unsigned width, unsigned height) {
    const unsigned longer = width > height ? width : height;
    plr_cells c;
    c.side_px = (uint16_t)((longer + CELLS_LONG - 1) / CELLS_LONG);
    c.across = (uint16_t)((width + c.side_px - 1) / c.side_px);
    c.down = (uint16_t)((height + c.side_px - 1) / c.side_px);
    return c;
}

plr_real plr_smaller_eigenvalue(plr_real a, plr_real b, plr_real c) {
    const plr_real half = (a - c) / 2;
    return (a + c) / 2 - PLR_SQRT(PLR_FMA(half, half, b * b));
}

/* Products of gradients at a pixel, by Sobel's 3 x 3. */
typedef struct tensor {
    int32_t xx, xy, yy;
} tensor;

static inline tensor at_pixel(const uint8_t *p, uint32_t stride) {
    const uint8_t *a = p - stride, *b = p + stride;
    const int32_t x = a[1] - a[-1] + 2 * (p[1] - p[-1]) + b[1] - b[-1];
    const int32_t y = b[-1] - a[-1] + 2 * (b[0] - a[0]) + b[1] - a[1];
    const tensor t = {x * x, x * y, y * y};
    return t;
}

/* The part of a level that belongs to a cell. */
typedef struct window {
    int32_t u, v, u_end, v_end; /* first px, and behind the last */
} window;

/* sums <- the sum of four rows of products, kept in a ring of four. */
static void add_row(tensor *sums, tensor *ring, const uint8_t *p, uint32_t stride, int32_t n) {
    for (int32_t i = 0; i < n; i++) {
        const tensor t = at_pixel(p + 2 * i, stride);
        sums[i].xx += t.xx - ring[i].xx;
        sums[i].xy += t.xy - ring[i].xy;
        sums[i].yy += t.yy - ring[i].yy;
        ring[i] = t;
    }
}

/* The best box of a row of columns' sums: lambda > best is asked without a root. */
static void best_of_row(const tensor *sums, int32_t n, plr_real *best, int32_t *where) {
    tensor box = {0, 0, 0};
    for (int32_t i = 0; i < n; i++) {
        const tensor in = sums[i], zero = {0, 0, 0}, out = i >= BOX ? sums[i - BOX] : zero;
        box.xx += in.xx - out.xx, box.xy += in.xy - out.xy, box.yy += in.yy - out.yy;
        if (i < BOX - 1)
            continue;
        const plr_real a = (plr_real)box.xx, b = (plr_real)box.xy, c = (plr_real)box.yy;
        if (a > *best && c > *best && PLR_FMA(a - *best, c - *best, -(b * b)) > 0) {
            *best = plr_smaller_eigenvalue(a, b, c);
            *where = i - (BOX - 1);
        }
    }
}

/* The best corner of a window, if there is one: false where all is flat. */
static bool best_corner(const plr_image *image, const window *w, plr_corner *corner) {
    tensor ring[BOX][MOST_COLUMNS], sums[MOST_COLUMNS];
    const int32_t first = w->u - BOX + 1, wide = (w->u_end - w->u) / 2 + BOX - 1;
    const int32_t n = wide < MOST_COLUMNS ? wide : MOST_COLUMNS;
    memset(ring, 0, sizeof ring);
    memset(sums, 0, sizeof sums);
    plr_real best = WEAKEST;
    int32_t u = -1, v = -1;
    unsigned row = 0;
    for (int32_t y = w->v - BOX + 1; y < w->v_end + BOX - 1; y += 2, row++) {
        const uint8_t *p = image->pixels + (uint32_t)y * image->stride + first;
        add_row(sums, ring[row % BOX], p, image->stride, n);
        int32_t where = -1;
        if (row >= BOX - 1)
            best_of_row(sums, n, &best, &where);
        if (where >= 0)
            u = first + 2 * where + BOX - 1, v = y - BOX + 1;
    }
    corner->score = best;
    corner->u = (uint16_t)(u < 0 ? 0 : u), corner->v = (uint16_t)(v < 0 ? 0 : v);
    return u >= 0;
}

/* The window of a cell in a level; false where nothing of it is inside the border. */
static bool window_of(window *w, const plr_cells *c, unsigned cell, const plr_image *image,
                      unsigned level) {
    const int32_t side = c->side_px;
    const int32_t u = (int32_t)(cell % c->across) * side, v = (int32_t)(cell / c->across) * side;
    const int32_t right = image->width - BORDER, low = image->height - BORDER;
    w->u = u >> level, w->v = v >> level;
    w->u_end = (u + side) >> level, w->v_end = (v + side) >> level;
    w->u = w->u < BORDER ? BORDER : w->u;
    w->v = w->v < BORDER ? BORDER : w->v;
    w->u_end = w->u_end > right ? right : w->u_end;
    w->v_end = w->v_end > low ? low : w->v_end;
    return w->u + 1 < w->u_end && w->v < w->v_end;
}

static void mark_taken(const plr_vision *v, const plr_cells *c, uint8_t taken[PLR_CELLS]) {
    memset(taken, 0, PLR_CELLS);
    for (unsigned i = 0; i < v->track_count; i++) {
        const plr_real *at = v->tracks[i].at;
        const unsigned across = (unsigned)(at[0] > 0 ? at[0] : 0) / c->side_px;
        const unsigned down = (unsigned)(at[1] > 0 ? at[1] : 0) / c->side_px;
        if (across < c->across && down < c->down)
            taken[down * c->across + across] = 1;
    }
}

/* Puts a corner behind those that are as strong; returns how many there are now. */
static unsigned insert(plr_corner sorted[PLR_CORNERS], unsigned n, const plr_corner *corner) {
    unsigned i = n;
    for (; i > 0 && sorted[i - 1].score < corner->score; i--)
        if (i < PLR_CORNERS)
            sorted[i] = sorted[i - 1];
    if (i < PLR_CORNERS)
        sorted[i] = *corner;
    return n < PLR_CORNERS ? n + 1 : n;
}

unsigned plr_corners_find(const plr_vision *v, const plr_levels *left,
                          plr_corner corners[PLR_CORNERS]) {
    uint8_t taken[PLR_CELLS];
    const plr_cells c = plr_cells_of(v->width, v->height);
    unsigned level = 0, n = 0;
    while (level + 1 < left->count && left->level[level].width > WIDEST)
        level++;
    mark_taken(v, &c, taken);
    for (unsigned cell = 0; cell < (unsigned)c.across * c.down; cell++) {
        window w;
        plr_corner corner;
        if (taken[cell] || !window_of(&w, &c, cell, &left->level[level], level) ||
            !best_corner(&left->level[level], &w, &corner))
            continue;
        corner.u = (uint16_t)((corner.u << level) + (1 << level) / 2);
        corner.v = (uint16_t)((corner.v << level) + (1 << level) / 2);
        n = insert(corners, n, &corner);
    }
    return n;
}
