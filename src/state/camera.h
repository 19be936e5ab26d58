// SPDX-License-Identifier: MIT
/* The transformation between body and left camera, T_CB = (R_CB, t_CB). */
#ifndef PLR_STATE_CAMERA_H
#define PLR_STATE_CAMERA_H

#include "pelorus/camera.h"

/* q = R_CB s + t_CB: body to left camera. */
void plr_camera_from_body(plr_real q[3], const plr_camera *camera, const plr_real s[3]);

/* s = R_CB^T (q - t_CB): left camera to body. */
void plr_camera_to_body(plr_real s[3], const plr_camera *camera, const plr_real q[3]);

/* D_C = (I + E_C, p_C) = T_CB D T_CB^-1: the camera's motion for D = (I + E, p) of the body. */
void plr_camera_motion(plr_real E_C[9], plr_real p_C[3], const plr_camera *camera,
                       const plr_real E[9], const plr_real p[3]);

#endif
