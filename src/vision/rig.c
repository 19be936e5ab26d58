// SPDX-License-Identifier: MIT
#include "vision/rig.h"

#include <string.h>

#include "math/small.h"
#include "math/two.h"
#include "vision/lens.h"

/* A patch's deformation is measured over its half side, px. */
#define HALF_SIDE PLR_R(4)
/* The least disparity that tells a depth, px. */
#define FARTHEST PLR_R(0.05)
/* Of the baseline, across the direction of view. */
#define SIDEWAYS PLR_R(0.5)

/* --- preparation --- */

static void take_optics(plr_optics *o, const plr_lens *lens) {
    o->model = lens->model;
    o->fx = (plr_real)lens->fx_px, o->fy = (plr_real)lens->fy_px;
    o->cx = (plr_real)lens->cx_px, o->cy = (plr_real)lens->cy_px;
    for (int i = 0; i < 8; i++)
        o->k[i] = (plr_real)lens->k[i];
}

static void normalise(plr_real x[3]) {
    const plr_real by = 1 / PLR_SQRT(plr_dot3(x, x));
    for (int i = 0; i < 3; i++)
        x[i] *= by;
}

/* Rows x, z cross x, z of the virtual camera in the left one: x = the baseline at `at`, z half way between
 * (0, 0, 1) and the right camera's axis. */
static bool look_ahead(plr_real R[9], const plr_real at[3], const plr_real R_RL[9]) {
    plr_real x[3] = {at[0], at[1], at[2]}, z[3] = {R_RL[6], R_RL[7], 1 + R_RL[8]}, y[3];
    if (!(plr_dot3(z, z) > PLR_R(0.1)))
        return false;
    normalise(x);
    normalise(z);
    if (!(x[0] > SIDEWAYS))
        return false;
    const plr_real along = plr_dot3(x, z);
    for (int i = 0; i < 3; i++)
        z[i] = PLR_FMA(-along, x[i], z[i]);
    if (!(plr_dot3(z, z) > PLR_R(0.1)))
        return false;
    normalise(z);
    plr_cross3(y, z, x);
    memcpy(R, x, sizeof x);
    memcpy(R + 3, y, sizeof y);
    memcpy(R + 6, z, sizeof z);
    return true;
}

/* The pair is as if rectified: the virtual camera is the left one as it is, to the bit. */
static bool is_rectified(const plr_rig *rig) {
    const plr_lens *l = &rig->left, *r = &rig->right;
    const double *R = rig->T_RL.R, *p = rig->T_RL.p;
    double apart = 0;
    for (int i = 0; i < 9; i++) {
        const double off = R[i] - (i % 4 == 0 ? 1.0 : 0.0);
        apart += off < 0 ? -off : off;
    }
    apart += (p[1] < 0 ? -p[1] : p[1]) + (p[2] < 0 ? -p[2] : p[2]);
    return l->model == PLR_LENS_NONE && r->model == PLR_LENS_NONE && apart < 1e-6 &&
           memcmp(&l->fx_px, &r->fx_px, 4 * sizeof(double)) == 0;
}

/* The middles of both pictures lie in the middle of the virtual one, on average. */
static bool choose_camera(plr_vision *v) {
    const plr_real middle[2] = {(plr_real)(v->width - 1) / 2, (plr_real)(v->height - 1) / 2};
    const plr_optics *o = v->optics;
    v->fx = v->fy = (o[0].fx + o[0].fy + o[1].fx + o[1].fy) / 4;
    v->cx = v->cy = 0;
    for (int side = 0; side < 2; side++) {
        plr_real ray[3], d[3];
        if (!plr_lens_ray(&o[side], middle, ray))
            return false;
        plr_mat3_vec(d, v->R_CS[side], ray);
        if (!(d[2] > 0))
            return false;
        v->cx += (middle[0] - v->fx * d[0] / d[2]) / 2;
        v->cy += (middle[1] - v->fy * d[1] / d[2]) / 2;
    }
    return true;
}

plr_status plr_rig_prepare(plr_vision *v, const plr_rig *rig) {
    plr_real R_RL[9], p[3], at[3], R_LR[9];
    for (int i = 0; i < 9; i++)
        R_RL[i] = (plr_real)rig->T_RL.R[i];
    for (int i = 0; i < 3; i++)
        p[i] = -(plr_real)rig->T_RL.p[i];
    plr_mat3_tvec(at, R_RL, p);
    v->baseline = PLR_SQRT(plr_dot3(at, at));
    take_optics(&v->optics[PLR_LEFT], &rig->left);
    take_optics(&v->optics[PLR_RIGHT], &rig->right);
    if (!(v->baseline > PLR_R(1e-4)) || !look_ahead(v->R_CS[PLR_LEFT], at, R_RL))
        return PLR_E_CALIBRATION;
    if (is_rectified(rig)) {
        plr_mat3_identity(v->R_CS[PLR_LEFT]);
        plr_mat3_identity(v->R_CS[PLR_RIGHT]);
        v->fx = v->optics[0].fx, v->fy = v->optics[0].fy;
        v->cx = v->optics[0].cx, v->cy = v->optics[0].cy;
        return PLR_OK;
    }
    plr_mat3_transpose(R_LR, R_RL);
    plr_mat3_mul(v->R_CS[PLR_RIGHT], v->R_CS[PLR_LEFT], R_LR);
    if (!(rig->fx_px > 0))
        return choose_camera(v) ? PLR_OK : PLR_E_CALIBRATION;
    v->fx = (plr_real)rig->fx_px, v->fy = (plr_real)rig->fy_px;
    v->cx = (plr_real)rig->cx_px, v->cy = (plr_real)rig->cy_px;
    return PLR_OK;
}

/* --- points and pixels --- */

/* By how much later than the frame a row of a side was read, s. */
static plr_real delay(const plr_vision *v, const plr_expected_motion *m, int side, plr_real row) {
    const plr_real middle = (plr_real)(v->height - 1) / 2;
    return PLR_FMA(v->row_time, row - middle, side == PLR_RIGHT ? m->right_late : PLR_R(0));
}

/* X <- where X is dt later: the midpoint rule. */
static void move(const plr_expected_motion *m, plr_real dt, plr_real X[3]) {
    plr_real turn[3], half[3];
    plr_cross3(turn, m->w, X);
    for (int i = 0; i < 3; i++)
        half[i] = PLR_FMA(dt / 2, turn[i] + m->u[i], X[i]);
    plr_cross3(turn, m->w, half);
    for (int i = 0; i < 3; i++)
        X[i] = PLR_FMA(dt, turn[i] + m->u[i], X[i]);
}

static bool moves_within(const plr_vision *v, const plr_expected_motion *m, int side) {
    return m->known && (v->row_time > 0 || (side == PLR_RIGHT && plr_abs(m->right_late) > 0));
}

bool plr_rig_point(const plr_vision *v, const plr_expected_motion *m, int side,
                   const plr_real px[2], plr_real depth, plr_real X[3]) {
    plr_real ray[3];
    if (!plr_lens_ray(&v->optics[side], px, ray))
        return false;
    plr_mat3_vec(X, v->R_CS[side], ray);
    if (!(X[2] > PLR_R(0.05) * (plr_abs(X[0]) + plr_abs(X[1]))))
        return false;
    const plr_real by = depth / X[2];
    for (int i = 0; i < 3; i++)
        X[i] *= by;
    if (side == PLR_RIGHT)
        X[0] += v->baseline;
    if (moves_within(v, m, side))
        move(m, -delay(v, m, side, px[1]), X);
    return true;
}

static bool project(const plr_vision *v, int side, const plr_real X[3], plr_real px[2]) {
    const plr_real at[3] = {side == PLR_RIGHT ? X[0] - v->baseline : X[0], X[1], X[2]};
    plr_real ray[3];
    plr_mat3_tvec(ray, v->R_CS[side], at);
    return plr_lens_pixel(&v->optics[side], ray, px);
}

bool plr_rig_pixel(const plr_vision *v, const plr_expected_motion *m, int side, const plr_real X[3],
                   plr_real px[2]) {
    if (!project(v, side, X, px))
        return false;
    for (int again = 0; again < 2 && moves_within(v, m, side); again++) {
        plr_real at[3] = {X[0], X[1], X[2]};
        move(m, delay(v, m, side, px[1]), at);
        if (!project(v, side, at, px))
            return false;
    }
    return true;
}

void plr_rig_virtual(const plr_vision *v, int side, const plr_real X[3], plr_real px[2]) {
    const plr_real x = side == PLR_RIGHT ? X[0] - v->baseline : X[0];
    px[0] = PLR_FMA(v->fx, x / X[2], v->cx);
    px[1] = PLR_FMA(v->fy, X[1] / X[2], v->cy);
}

plr_real plr_rig_depth(const plr_vision *v, plr_real disparity) {
    return v->fx * v->baseline / (disparity > FARTHEST ? disparity : FARTHEST);
}

/* --- patches --- */

/* Raw left pixel -> raw pixel of a side, by its disparity, which becomes the one it has then; moved by the
 * expected motion where the side is the left one. */
static bool carry(const plr_vision *v, const plr_expected_motion *m, int side, const plr_real px[2],
                  plr_real *disparity, plr_real to[2]) {
    plr_real X[3];
    if (!plr_rig_point(v, m, PLR_LEFT, px, plr_rig_depth(v, *disparity), X))
        return false;
    if (side == PLR_LEFT) {
        plr_real moved[3];
        const plr_real z = X[2];
        plr_mat3_vec(moved, m->R, X);
        for (int i = 0; i < 3; i++)
            X[i] = moved[i] + m->p[i];
        *disparity *= z / X[2];
    }
    return X[2] > PLR_R(0.02) && plr_rig_pixel(v, m, side, X, to);
}

/* A: the middle, and what is beside and below it by half a patch. */
static bool carry_patch(const plr_vision *v, const plr_expected_motion *m, int side,
                        const plr_real px[2], plr_surface *s, plr_real to[2], plr_real A[4]) {
    const plr_surface was = *s;
    plr_real slope[2];
    if (!carry(v, m, side, px, &s->disparity, to))
        return false;
    for (int j = 0; A && j < 2; j++) {
        const plr_real at[2] = {px[0] + (j == 0 ? HALF_SIDE : 0), px[1] + (j == 1 ? HALF_SIDE : 0)};
        plr_real there[2], disparity = PLR_FMA(HALF_SIDE, was.slope[j], was.disparity);
        if (!carry(v, m, side, at, &disparity, there))
            return false;
        A[j] = (there[0] - to[0]) / HALF_SIDE;
        A[2 + j] = (there[1] - to[1]) / HALF_SIDE;
        slope[j] = (disparity - s->disparity) / HALF_SIDE;
    }
    if (!A)
        return true;
    const plr_real transposed[4] = {A[0], A[2], A[1], A[3]};
    if (!(plr_abs(plr_det2(A)) > PLR_R(0.01)))
        return false;
    plr_solve2(s->slope, transposed, slope);
    return true;
}

bool plr_rig_forward(const plr_vision *v, const plr_expected_motion *m, const plr_real px[2],
                     plr_surface *surface, plr_real to[2], plr_real A[4]) {
    return carry_patch(v, m, PLR_LEFT, px, surface, to, A);
}

bool plr_rig_across(const plr_vision *v, const plr_expected_motion *m, const plr_real px[2],
                    const plr_surface *surface, plr_real to[2], plr_real A[4]) {
    plr_surface seen = *surface;
    return carry_patch(v, m, PLR_RIGHT, px, &seen, to, A);
}
