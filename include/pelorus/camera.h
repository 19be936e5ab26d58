// SPDX-License-Identifier: MIT
/* The stereo camera in the filter's precision. Internal to the filter; a caller describes the
 * camera by plr_calibration in types.h. */
#ifndef PELORUS_CAMERA_H
#define PELORUS_CAMERA_H

#include "pelorus/config.h"

typedef struct plr_camera {
    plr_real fx, fy, cx, cy; /* px */
    plr_real baseline;       /* m */
    plr_real R_CB[9];        /* body to left camera: q_C = R_CB s_B + t_CB */
    plr_real t_CB[3];        /* m */
} plr_camera;

#endif
