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

/* Cells of a picture. */
typedef struct plr_cells {
    uint16_t side_px, across, down;
} plr_cells;

/* The cells of pictures of this size: at most PLR_VISION_CELLS. */
plr_cells plr_cells_of(unsigned width, unsigned height);

/* Fills v->corners with the best corner of each empty cell, the strongest first. */
void plr_corners_find(plr_vision *v, const plr_levels *left);

/* The smaller eigenvalue of [a b; b c]. */
plr_real plr_smaller_eigenvalue(plr_real a, plr_real b, plr_real c);

#endif
