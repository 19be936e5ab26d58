// SPDX-License-Identifier: MIT
/*
 * A pinhole with its lens: from pixels to directions and back. No function of a mathematics library is
 * used. Directions are (x, y, z) with z ahead, of any length above zero.
 */
#ifndef PLR_VISION_LENS_H
#define PLR_VISION_LENS_H

#include <stdbool.h>

#include "pelorus/config.h"
#include "pelorus/vision.h"

/* The direction of a pixel. False where the lens has none: its formula folds there. */
bool plr_lens_ray(const plr_optics *o, const plr_real px[2], plr_real ray[3]);

/* The pixel of a direction. False behind the camera, and where the formula folds. */
bool plr_lens_pixel(const plr_optics *o, const plr_real ray[3], plr_real px[2]);

/* The angle of (adjacent, opposite), opposite >= 0: 0 to pi. Of length 1; accurate to rounding. */
plr_real plr_lens_angle(plr_real adjacent, plr_real opposite);

#endif
