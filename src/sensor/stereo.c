// SPDX-License-Identifier: MIT
#include "sensor/stereo.h"

#include "math/se3.h"
#include "math/small.h"
#include "pelorus/assertions.h"
#include "state/calibration.h"
#include "state/camera.h"
#include "state/covariance.h"
#include "state/polar.h"

/* ---------------------------------------------------------------- the pair of cameras */

void plr_stereo_project(plr_real z[3], const plr_camera *camera, const plr_real q[3]) {
    PLR_ASSERT(q[2] < 0 || q[2] > 0);
    const plr_real inverse = PLR_R(1) / q[2];
    z[0] = PLR_FMA(camera->fx * q[0], inverse, camera->cx);
    z[1] = PLR_FMA(camera->fx * (q[0] - camera->baseline), inverse, camera->cx);
    z[2] = PLR_FMA(camera->fy * q[1], inverse, camera->cy);
}

void plr_stereo_jacobian(plr_real Dz[9], const plr_camera *camera, const plr_real q[3]) {
    PLR_ASSERT(q[2] < 0 || q[2] > 0);
    const plr_real inverse = PLR_R(1) / q[2];
    const plr_real fx = camera->fx * inverse, fy = camera->fy * inverse;
    const plr_real rows[9] = {
        fx, 0,  -fx * q[0] * inverse,                      /* uL */
        fx, 0,  -fx * (q[0] - camera->baseline) * inverse, /* uR */
        0,  fy, -fy * q[1] * inverse,                      /* v */
    };
    memcpy(Dz, rows, sizeof rows);
}

void plr_stereo_back_project(plr_real q[3], plr_real Dq[9], const plr_camera *camera,
                             const plr_real z[3]) {
    PLR_ASSERT(z[0] - z[1] > 0);
    const plr_real inverse = PLR_R(1) / (z[0] - z[1]);
    const plr_real scale = camera->baseline * inverse; /* m per px in x */
    const plr_real aspect = camera->fx / camera->fy;
    q[0] = (z[0] - camera->cx) * scale;
    q[1] = (z[2] - camera->cy) * scale * aspect;
    q[2] = camera->fx * scale;
    for (int i = 0; i < 3; i++) {
        Dq[3 * i + 0] = -q[i] * inverse;
        Dq[3 * i + 1] = q[i] * inverse;
        Dq[3 * i + 2] = 0;
    }
    Dq[0] += scale;
    Dq[5] = scale * aspect;
}

/* ---------------------------------------------------------------- the measurement */

void plr_stereo_rows(plr_real z[3], const plr_observation *seen) {
    z[0] = (plr_real)seen->uL_px;
    z[1] = (plr_real)seen->uR_px;
    z[2] = PLR_R(0.5) * ((plr_real)seen->vL_px + (plr_real)seen->vR_px);
}

plr_real plr_stereo_variance(const plr_camera_model *camera, unsigned row) {
    PLR_ASSERT(row < PLR_ROWS);
    return row == 2 ? PLR_R(0.5) * camera->pixel_variance : camera->pixel_variance;
}

static plr_real row_gap(const plr_observation *seen) {
    return (plr_real)seen->vL_px - (plr_real)seen->vR_px;
}

plr_real plr_stereo_row_gap_d2(const plr_camera_model *camera, const plr_observation *seen) {
    return row_gap(seen) * row_gap(seen) / (PLR_R(2) * camera->pixel_variance);
}

static plr_real residual_norm2(const plr_observation *seen, const plr_real z[3]) {
    const plr_real residual[4] = {(plr_real)seen->uL_px - z[0], (plr_real)seen->uR_px - z[1],
                                  (plr_real)seen->vL_px - z[2], (plr_real)seen->vR_px - z[2]};
    return PLR_FMA(residual[3], residual[3], plr_dot3(residual, residual));
}

plr_real plr_stereo_max_variance(const plr_camera_model *camera) {
    return camera->estimate.eye.fx * camera->estimate.eye.fx;
}

plr_real plr_stereo_max_bearing_variance(const plr_camera_model *camera) {
    return PLR_R(0.4) * PLR_SQRT(camera->pixel_variance) / camera->estimate.eye.fx;
}

/* A point q of the axes that par.camera gives the camera, by the camera as it is estimated. */
typedef struct plr_eye_view {
    plr_real q[3];  /* in that camera, m */
    plr_real Dz[9]; /* derivative of the pixels by the point before */
    plr_real
        Dt[3]; /* of them by going along t, the shift between both: Dz q = (0, fx baseline, 0) / z -
                       Dt. From Dz and q it would be a difference of rounded numbers. */
} plr_eye_view;

/* False if it would be too near. */
static bool look_by_eye(const plr_camera_model *camera, const plr_real q[3], plr_eye_view *view) {
    const plr_camera *eye = &camera->estimate.eye;
    plr_real Dz[9];
    if (plr_calibration_estimated(&camera->errors) == 0) { /* it is where par.camera has it */
        memcpy(view->q, q, sizeof view->q);
        plr_stereo_jacobian(view->Dz, eye, q);
        memset(view->Dt, 0, sizeof view->Dt);
        return q[2] >= camera->min_depth;
    }
    const plr_real *R = eye->R_CB, *t = eye->t_CB;
    for (unsigned i = 0; i < 3; i++)
        view->q[i] = plr_dot3(R + 3 * i, q) + t[i];
    if (!(view->q[2] >= camera->min_depth))
        return false;
    plr_stereo_jacobian(Dz, eye, view->q);
    for (unsigned r = 0; r < PLR_ROWS; r++) { /* of u and v one depends on q_x, one on q_y */
        const unsigned across = r < 2 ? 0 : 1;
        const plr_real by = Dz[3 * r + across], by_depth = Dz[3 * r + 2];
        for (unsigned c = 0; c < 3; c++)
            view->Dz[3 * r + c] = PLR_FMA(by_depth, R[6 + c], by * R[3 * across + c]);
        view->Dt[r] = PLR_FMA(by_depth, t[2], by * t[across]);
    }
    return true;
}

bool plr_stereo_measure(const plr_belief *belief, const plr_camera_model *camera, unsigned slot,
                        const plr_observation *seen, plr_measurement *m) {
    PLR_ASSERT(slot < belief->count);
    const plr_camera *eye = &camera->estimate.eye;
    plr_real z[3], along[3];
    plr_eye_view by_eye;
    plr_view view;
    memset(m, 0, sizeof *m);
    for (unsigned i = 0; i < PLR_ROWS; i++)
        m->R[i] = plr_stereo_variance(camera, i);
    if (!plr_model_of(belief)->look(belief, camera, slot, &view) ||
        !look_by_eye(camera, view.q, &by_eye)) {
        (void)plr_rows_add(&m->H, plr_covariance_row(belief, slot), PLR_LANDMARK_DIM);
        return false;
    }
    plr_stereo_project(z, eye, by_eye.q);
    for (unsigned i = 0; i < PLR_ROWS; i++) /* only the right image moves: Dz q q_z */
        along[i] = (i == 1 ? eye->fx * eye->baseline * (view.q[2] / by_eye.q[2]) : PLR_R(0)) -
                   by_eye.Dt[i] * view.q[2];
    plr_model_of(belief)->derive(belief, camera, slot, &view, by_eye.Dz, along, z, &m->H);
    plr_stereo_rows(m->r, seen);
    for (unsigned i = 0; i < PLR_ROWS; i++)
        m->r[i] -= z[i];
    m->extra_d2 = plr_stereo_row_gap_d2(camera, seen);
    m->residual2 = residual_norm2(seen, z);
    m->max_variance = belief->slots[slot].known ? 0 : plr_stereo_max_variance(camera);
    return true;
}

/* How the point q that a pair of pixels shows would change with each error of the calibration: with a
 * longer baseline along its ray, with a longer focal length in its depth alone. If the camera is turned
 * by a small phi, pixels that show q mean q - phi x q in the axes before; if its picture is later, the
 * camera has gone on with its twist. q_eye is the same point in the camera as it is estimated. */
static void point_by_calibration(const plr_camera_model *camera, const plr_real q[3],
                                 const plr_real q_eye[3], plr_real q_s[PLR_CALIBRATIONS][3]) {
    PLR_ASSERT(camera->errors.count <= PLR_CALIBRATIONS);
    const plr_camera *eye = &camera->estimate.eye;
    const plr_real *p = q_eye, *u = camera->estimate.twist;
    const plr_real in_eye[PLR_CALIBRATION_ERRORS][3] = {
        [PLR_BASELINE] = {p[0], p[1], p[2]},      [PLR_FOCAL_LENGTH] = {0, 0, p[2]},
        [PLR_CAMERA_TURN_X] = {0, p[2], -p[1]},   [PLR_CAMERA_TURN_Y] = {-p[2], 0, p[0]},
        [PLR_CAMERA_TURN_Z] = {p[1], -p[0], 0},   [PLR_CENTRE_X] = {-p[2] / eye->fx, 0, 0},
        [PLR_CENTRE_Y] = {0, -p[2] / eye->fy, 0}, [PLR_CAMERA_PLACE_X] = {-1, 0, 0},
        [PLR_CAMERA_PLACE_Y] = {0, -1, 0},        [PLR_CAMERA_PLACE_Z] = {0, 0, -1},
    };
    for (unsigned k = 0; k < camera->errors.count; k++) {
        const unsigned kind = camera->errors.kind[k];
        plr_mat3_tvec(q_s[k], eye->R_CB, in_eye[kind]);
        if (kind != PLR_CAMERA_CLOCK)
            continue;
        plr_cross3(q_s[k], u + 3, q);
        for (unsigned i = 0; i < 3; i++)
            q_s[k][i] += u[i];
    }
}

void plr_stereo_by_calibration(const plr_belief *belief, const plr_camera_model *camera,
                               unsigned slot, plr_real H_s[PLR_CALIBRATIONS][PLR_ROWS]) {
    PLR_ASSERT(slot < belief->count);
    plr_view view;
    plr_eye_view by_eye;
    plr_real q_s[PLR_CALIBRATIONS][3];
    if (!plr_model_of(belief)->look(belief, camera, slot, &view) ||
        !look_by_eye(camera, view.q, &by_eye))
        return;
    point_by_calibration(camera, view.q, by_eye.q, q_s);
    for (unsigned k = 0; k < camera->errors.count; k++) {
        plr_mat3_vec(H_s[k], by_eye.Dz, q_s[k]);
        for (unsigned r = 0; r < PLR_ROWS; r++)
            H_s[k][r] = -H_s[k][r]; /* so that pixels which stay show the point that changes */
    }
}

/* ---------------------------------------------------------------- during the motion's search */

/* J = Dz R^T Ji(q0), without what vanishes, as in model_body.c: Dz q in the rows uL and v. */
static void differentiate(const plr_camera *eye, const plr_eye_view *by_eye, const plr_polar *chart,
                          const plr_real R[9], const plr_real p[3], plr_stereo_prediction *sight) {
    plr_real DzRt[9];
    plr_mat3_mul_nt(DzRt, sight->Dz, R);
    for (int row = 0; row < 3; row++) {
        const plr_real along =
            (row == 1 ? eye->fx * eye->baseline / by_eye->q[2] : PLR_R(0)) - by_eye->Dt[row];
        for (int column = 0; column < 2; column++)
            sight->J[3 * row + column] = chart->r * plr_dot3(DzRt + 3 * row, chart->N[column]);
        sight->J[3 * row + 2] = -chart->r * (along + plr_dot3(DzRt + 3 * row, p));
    }
}

bool plr_stereo_predict_after(const plr_camera_model *camera, const plr_slot *slot,
                              const plr_observation *seen, const plr_real E[9], const plr_real R[9],
                              const plr_real p[3], plr_stereo_prediction *sight) {
    const plr_camera *eye = &camera->estimate.eye;
    plr_polar chart;
    plr_real z[3];
    plr_eye_view by_eye;
    memcpy(sight->q, slot->x, sizeof sight->q);
    plr_se3_move_back(sight->q, E, p);
    if (!(sight->q[2] >= camera->min_depth) || !look_by_eye(camera, sight->q, &by_eye))
        return false;
    plr_polar_at(&chart, slot->x);
    plr_stereo_project(z, eye, by_eye.q);
    memcpy(sight->Dz, by_eye.Dz, sizeof sight->Dz);
    differentiate(eye, &by_eye, &chart, R, p, sight);
    plr_stereo_rows(sight->r, seen);
    for (unsigned i = 0; i < PLR_ROWS; i++)
        sight->r[i] -= z[i];
    return true;
}

bool plr_stereo_improves_range(const plr_camera_model *camera, const plr_real J[9],
                               const plr_real P[9]) {
    const plr_real by_range = J[2] - J[5];
    return by_range * by_range * P[8] > PLR_R(0.02) * camera->pixel_variance;
}

plr_real plr_stereo_residual2(const plr_observation *seen, const plr_real r[3]) {
    /* vL and vR lie half the gap to both sides of v */
    return plr_dot3(r, r) + r[2] * r[2] + PLR_R(0.5) * row_gap(seen) * row_gap(seen);
}

plr_real plr_stereo_inverse_range_variance(const plr_camera_model *camera) {
    const plr_real by_range = camera->estimate.eye.fx * camera->estimate.eye.baseline;
    return PLR_R(2) * camera->pixel_variance / (by_range * by_range);
}

/* ---------------------------------------------------------------- new landmarks */

/* The disparity of a point at infinity lies above this but for one in 700. */
static plr_real least_disparity(const plr_belief *belief, const plr_camera_model *camera) {
    return belief->model == PLR_MODEL_BODY ? PLR_R(-4.25) * PLR_SQRT(camera->pixel_variance) : 0;
}

/* The least disparity at which a landmark is initialised, px. Further away, the bearing information
 * of a single observation would be lost by rounding in float32. */
static plr_real farthest_disparity(const plr_camera_model *camera) {
    const plr_real by_range = camera->estimate.eye.fx * camera->estimate.eye.baseline *
                              camera->min_inverse_range * PLR_R(1.5);
    return by_range > PLR_R(0.05) ? by_range : PLR_R(0.05);
}

bool plr_stereo_makes_landmark(const plr_belief *belief, const plr_camera_model *camera,
                               const plr_observation *seen) {
    plr_real z[3];
    plr_stereo_rows(z, seen);
    const plr_real disparity = z[0] - z[1];
    const plr_real least =
        camera->min_disparity > 0 ? camera->min_disparity : least_disparity(belief, camera);
    if (!(disparity >= least) ||
        (camera->max_row_gap > 0 && plr_abs(row_gap(seen)) > camera->max_row_gap))
        return false;
    const bool any_depth = belief->model == PLR_MODEL_BODY && camera->max_depth <= 0;
    if (any_depth && disparity < farthest_disparity(camera))
        return true;
    const plr_real depth = camera->estimate.eye.fx * camera->estimate.eye.baseline / disparity;
    return disparity > 0 && depth >= camera->min_depth &&
           (camera->max_depth <= 0 || depth <= camera->max_depth) &&
           depth * camera->min_inverse_range < 1;
}

/* Raises the disparity of z to farthest_disparity. Returns the disparity that was removed by it, 0
 * or negative, which is kept in plr_slot.beyond. */
static plr_real limit_disparity(const plr_belief *belief, const plr_camera_model *camera,
                                plr_real z[3]) {
    const plr_real disparity = z[0] - z[1], farthest = farthest_disparity(camera);
    if (belief->model != PLR_MODEL_BODY || disparity >= farthest)
        return 0;
    z[1] = z[0] - farthest;
    return disparity - farthest;
}

/* S_q with S_q S_q^T = Dq R Dq^T, the pixels' noise in the camera; or the course's constant. */
static void initial_factor(const plr_camera_model *camera, const plr_real Dq[9], plr_real S_q[9]) {
    const plr_real constant = camera->landmark_variance;
    for (unsigned i = 0; i < 9; i++)
        S_q[i] = constant > 0 ? (i % 4 == 0 ? PLR_SQRT(constant) : PLR_R(0))
                              : Dq[i] * PLR_SQRT(plr_stereo_variance(camera, i % 3));
}

plr_real plr_stereo_initialise(const plr_belief *belief, const plr_camera_model *camera,
                               const plr_observation *seen, plr_new_landmark *landmark) {
    const plr_camera *eye = &camera->estimate.eye;
    plr_real z[3], q[3], q_eye[3], Dq[9], S_eye[9], S_q[9], q_s[PLR_CALIBRATIONS][3];
    plr_stereo_rows(z, seen);
    const plr_real missing = limit_disparity(belief, camera, z);
    plr_stereo_back_project(q_eye, Dq, eye, z);
    plr_camera_to_body(q, eye, q_eye);
    initial_factor(camera, Dq, S_eye);
    plr_mat3_mul_tn(S_q, eye->R_CB, S_eye);
    plr_model_of(belief)->initialise(belief, camera, q, S_q, landmark);
    point_by_calibration(camera, q, q_eye, q_s);
    for (unsigned k = 0; k < camera->errors.count; k++)
        plr_mat3_vec(landmark->by_calibration[k], landmark->J_q, q_s[k]);
    /* inverse range is disparity over focal length and baseline, along the ray */
    return missing * q[2] / PLR_SQRT(plr_dot3(q, q)) / (eye->fx * eye->baseline);
}
