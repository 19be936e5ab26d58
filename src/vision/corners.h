// SPDX-License-Identifier: MIT
/*
 * Corners: the smaller eigenvalue of the structure tensor, the best of each cell that holds no track. Cells
 * are a nineteenth of the longer side. The tensor is summed from every second pixel each way, which is a
 * quarter of the work; where exactly a corner lies is of no matter, because its own patch is followed.
 */
#ifndef PLR_VISION_CORNERS_H
#define PLR_VISION_CORNERS_H

#include "pelorus/vision.h"
#include "vision/pyramid.h"

enum {
    PLR_CELLS = 20 * 20,                    /* most cells of a picture */
    PLR_CORNERS = 3 * PLR_VISION_TRACKS + 8 /* most that are kept: many are no births */
};

/* A corner that could be followed. */
typedef struct plr_corner {
    plr_real score; /* smaller eigenvalue of the structure tensor */
    uint16_t u, v;  /* in the left picture */
} plr_corner;

/* Cells of a picture. */
typedef struct plr_cells {
    uint16_t side_px, across, down;
} plr_cells;

/* The cells of pictures of this size: at most PLR_CELLS. */
plr_cells plr_cells_of(unsigned width, unsigned height);

/* The best corner of each empty cell, the strongest first, equal ones in the order of their cells. Returns how
 * many there are. */
unsigned plr_corners_find(const plr_vision *v, const plr_levels *left,
                          plr_corner corners[PLR_CORNERS]);

/* The smaller eigenvalue of [a b; b c]. */
plr_real plr_smaller_eigenvalue(plr_real a, plr_real b, plr_real c);

#endif
