// SPDX-License-Identifier: MIT
/* The cameras of a stereo pair as they are, lenses and all: for eyes (vision.h), and as a message (wire.h). */
#ifndef PELORUS_RIG_H
#define PELORUS_RIG_H

#include "pelorus/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How a lens bends a ray. */
typedef enum plr_lens_model {
    PLR_LENS_NONE = 0,       /* a pinhole, as rectified pictures are */
    PLR_LENS_RADTAN = 1,     /* OpenCV's: k1 k2 p1 p2 k3 k4 k5 k6; those not known are 0 */
    PLR_LENS_EQUIDISTANT = 2 /* OpenCV's fisheye, Kalibr's equidistant: k1 k2 k3 k4 */
} plr_lens_model;

/* One camera. Pixel (0, 0) is the middle of the first pixel. */
typedef struct plr_lens {
    uint8_t model; /* plr_lens_model */
    uint16_t width_px,
        height_px; /* of the pictures for which these numbers hold: 48 to 4096 each */
    double fx_px, fy_px, cx_px, cy_px;
    double k[8];
} plr_lens;

/* Two cameras, and how they are read. */
typedef struct plr_rig {
    plr_lens left, right; /* of equal size */
    plr_pose T_RL;        /* left camera to right camera: x_R = R x_L + p, m */
    double
        row_time_s; /* from one row to the next of a rolling shutter; 0: global. Points are moved to
                             the time of the middle row by the expected motion */
    uint16_t disparity_max_px; /* nearest point, in the virtual camera; 0: a sixth of the width */
    uint16_t tracks;           /* points to follow, 1 to PLR_VISION_TRACKS; 0: that many */
    double fx_px, fy_px, cx_px,
        cy_px; /* the virtual camera; fx 0: chosen so that its middle shows what
                                          the middles of both pictures show */
} plr_rig;

#ifdef __cplusplus
}
#endif

#endif
