// SPDX-License-Identifier: MIT
/*
 * Projection of a rectified stereo pair (course report III.1 to III.3, docs/MATH.md 7). Every
 * result depends on the arguments alone.
 *
 * A point q = (x, y, z) in the left camera (x right, y down, z forward) is seen at
 *   uL = fx x / z + cx,  uR = fx (x - baseline) / z + cx,  vL = vR = fy y / z + cy.
 * vL and vR measure the same quantity, so the filter uses their mean. An observation has three
 * rows, everywhere in this order: (uL, uR, v) with v = (vL + vR) / 2, and variances s^2, s^2, s^2 /
 * 2 for a pixel sigma s. No information is lost by this.
 */
#ifndef PLR_SENSOR_STEREO_H
#define PLR_SENSOR_STEREO_H

#include "pelorus/camera.h"

/* z = (uL, uR, v) of the point q, px. Needs q[2] != 0. */
void plr_stereo_project(plr_real z[3], const plr_camera *camera, const plr_real q[3]);

/* Dz = d(uL, uR, v) / dq, 3x3, px/m. Needs q[2] != 0. */
void plr_stereo_jacobian(plr_real Dz[9], const plr_camera *camera, const plr_real q[3]);

/* The point q whose projection is z, m, and Dq = dq / d(uL, uR, v), 3x3, m/px.
 * Needs a disparity z[0] - z[1] > 0. */
void plr_stereo_back_project(plr_real q[3], plr_real Dq[9], const plr_camera *camera,
                             const plr_real z[3]);

#endif
