// SPDX-License-Identifier: MIT
/*
 * The geometry of a pair: from raw pixels to the virtual rectified camera C and back, and how a small patch
 * is deformed on the way. C's x axis is the baseline, z lies half way between the optical axes.
 */
#ifndef PLR_VISION_RIG_H
#define PLR_VISION_RIG_H

#include <stdbool.h>

#include "pelorus/config.h"
#include "pelorus/vision.h"

enum { PLR_LEFT = 0, PLR_RIGHT = 1 };

/* The expected motion, and what moves a point within a picture: x(t + dt) = x + dt rate(x),
 * rate(x) = w x x + u, per second. */
typedef struct plr_expected_motion {
    plr_real R[9], p[3]; /* from the last pair to this one, in C */
    plr_real w[3], u[3];
    plr_real right_late; /* s by which the right picture is later than the left one */
    bool place_known;    /* p is not zero */
    bool known;          /* else R = I and nothing moves within a picture */
} plr_expected_motion;

/* Fills the geometry of v from a rig that has been checked: PLR_E_CALIBRATION where the two cameras do not
 * stand side by side. */
plr_status plr_rig_prepare(plr_vision *v, const plr_rig *rig);

/* The point at `depth` (m, along C's z) that a raw pixel of a side shows, in C, at the time of the frame. */
bool plr_rig_point(const plr_vision *v, const plr_expected_motion *m, int side,
                   const plr_real px[2], plr_real depth, plr_real X[3]);

/* The raw pixel of a side that shows the point X. */
bool plr_rig_pixel(const plr_vision *v, const plr_expected_motion *m, int side, const plr_real X[3],
                   plr_real px[2]);

/* Its pixel in the virtual camera: at 0, or one baseline to the right. */
void plr_rig_virtual(const plr_vision *v, int side, const plr_real X[3], plr_real px[2]);

/* Where a raw pixel of the last left picture is seen in this one, by the surface that it shows, which
 * becomes the one that is expected now, and how a patch around it is deformed: A, 2x2. False where it is not
 * seen. */
bool plr_rig_forward(const plr_vision *v, const plr_expected_motion *m, const plr_real px[2],
                     plr_surface *surface, plr_real to[2], plr_real A[4]);

/* Where a raw pixel of the left picture is seen in the right one, likewise; A may be
 * NULL. */
bool plr_rig_across(const plr_vision *v, const plr_expected_motion *m, const plr_real px[2],
                    const plr_surface *surface, plr_real to[2], plr_real A[4]);

/* The depth of a disparity; those at infinity and beyond stand at a thousand baselines' worth of pixels. */
plr_real plr_rig_depth(const plr_vision *v, plr_real disparity);

#endif
