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

#include <stdbool.h>

#include "pelorus/camera.h"
#include "sensor/measurement.h"
#include "state/model.h"

/* z = (uL, uR, v) of the point q, px. Needs q[2] != 0. */
void plr_stereo_project(plr_real z[3], const plr_camera *camera, const plr_real q[3]);

/* Dz = d(uL, uR, v) / dq, 3x3, px/m. Needs q[2] != 0. */
void plr_stereo_jacobian(plr_real Dz[9], const plr_camera *camera, const plr_real q[3]);

/* The point q whose projection is z, m, and Dq = dq / d(uL, uR, v), 3x3, m/px, for z[0] > z[1]. */
void plr_stereo_back_project(plr_real q[3], plr_real Dq[9], const plr_camera *camera,
                             const plr_real z[3]);

/* --- the measurement --- */

/* The rows (uL, uR, v) of an observation, px. */
void plr_stereo_rows(plr_real z[3], const plr_observation *seen);

/* The variance of a row, px^2. */
plr_real plr_stereo_variance(const plr_camera_model *camera, unsigned row);

/* (vL - vR)^2 / (2 s^2), which does not depend on the state; one degree of freedom. */
plr_real plr_stereo_row_gap_d2(const plr_camera_model *camera, const plr_observation *seen);

/* The largest variance of a predicted pixel, px^2: one focal length, one radian. Beyond it a
 * linearisation is wrong, and an update would take more digits than float32 has. */
plr_real plr_stereo_max_variance(const plr_camera_model *camera);

/* The largest variance of a landmark's bearing, rad^2, at which a projection is taken for linear:
 * what that leaves out, fx sigma^2 / 2, is then a fifth of a pixel sigma. */
plr_real plr_stereo_max_bearing_variance(const plr_camera_model *camera);

/* An observation of a landmark, linearised at the present estimate. False, and without effect, if
 * the landmark is nearer than min-depth. Known landmarks are exempt from plr_stereo_max_variance:
 * from a rough start only they can correct the pose. */
bool plr_stereo_measure(const plr_belief *belief, const plr_camera_model *camera, unsigned slot,
                        const plr_observation *seen, plr_measurement *m);

/* H_s: how the three rows change with what is not exact in the calibration: focal length or
 * baseline longer by a share, camera turned. Left as it is for a landmark nearer than min-depth. */
void plr_stereo_by_calibration(const plr_belief *belief, const plr_camera_model *camera,
                               unsigned slot, plr_real H_s[PLR_CALIBRATIONS][PLR_ROWS]);

/* --- during the search for the motion: `body` alone --- */

/* The prediction of an observation after a motion of the camera; q0 is the landmark before it. */
typedef struct plr_stereo_prediction {
    plr_real q[3];  /* the landmark after the motion, m */
    plr_real r[3];  /* seen minus predicted, px */
    plr_real Dz[9]; /* rows by q, 3x3 */
    plr_real J[9];  /* rows by the error in the polar chart at q0, 3x3 */
} plr_stereo_prediction;

/* For the motion (R = I + E, p) of the camera. False: then it would be nearer than min-depth. */
bool plr_stereo_predict_after(const plr_camera_model *camera, const plr_slot *slot,
                              const plr_observation *seen, const plr_real E[9], const plr_real R[9],
                              const plr_real p[3], plr_stereo_prediction *sight);

/* True if a single observation still improves a landmark's range noticeably. After many the range
 * is mostly uncertain by the camera's error, common to all, and correcting each would move them
 * relative to the pose. J is from a prediction, P the landmark's covariance. */
bool plr_stereo_improves_range(const plr_camera_model *camera, const plr_real J[9],
                               const plr_real P[9]);

/* The squared norm of the four residuals (uL, uR, vL, vR), px^2, from that of the three rows. */
plr_real plr_stereo_residual2(const plr_observation *seen, const plr_real r[3]);

/* The variance of a far point's inverse range after a single observation, 1/m^2. */
plr_real plr_stereo_inverse_range_variance(const plr_camera_model *camera);

/* --- new landmarks --- */

/* True if a landmark may be made of it (min-disparity, max-depth, max-row-gap, min-depth). */
bool plr_stereo_makes_landmark(const plr_belief *belief, const plr_camera_model *camera,
                               const plr_observation *seen);

/* Initialises a landmark from them. Returns its plr_slot.beyond. */
plr_real plr_stereo_initialise(const plr_belief *belief, const plr_camera_model *camera,
                               const plr_observation *seen, plr_new_landmark *landmark);

#endif
