// SPDX-License-Identifier: MIT
/* The stereo camera as the filter computes with it. Part of the state, not for direct use: the
 * caller's calibration is plr_calibration in types.h. */
#ifndef PELORUS_CAMERA_H
#define PELORUS_CAMERA_H

#include "pelorus/config.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct plr_camera {
    plr_real fx, fy, cx, cy; /* px */
    plr_real baseline;       /* m */
    plr_real R_CB[9];        /* body to left camera: q_C = R_CB s_B + t_CB */
    plr_real t_CB[3];        /* m */
} plr_camera;

#ifdef __cplusplus
}
#endif

#endif
