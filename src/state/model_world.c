// SPDX-License-Identifier: MIT
/*
 * The `world` model, the course report's: landmarks m in the world frame, with errors dm there
 * (III.1 to III.14). It believes more than it knows, and in float32 its covariance can break down
 * (docs/NUMERICS.md): it is here to be compared with.
 */
#include "state/covariance.h"
#include "state/model.h"

#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "sensor/stereo.h"
#include "state/camera.h"
#include "state/motion.h"

/* s = R^T (m - p): the landmark in the body. */
static void in_body(const plr_filter *f, const plr_real m[3], plr_real s[3]) {
    plr_real offset[3];
    for (int i = 0; i < 3; i++)
        offset[i] = (plr_real)((double)m[i] - f->p_WB[i]);
    plr_mat3_tvec(s, f->R_WB, offset);
}

static void world_propagate(plr_filter *f, const plr_applied_motion *motion) {
    plr_real A[36], R[9];
    (void)motion; /* the pose alone moves, by f->motion */
    plr_se3_rotation(R, f->motion.E);
    plr_se3_adjoint_inverse(A, R, f->motion.p);
    plr_covariance_predict_pose(f, A, &f->motion);
}

/* H_pose = Dz R_CB [-I | [s]x], H_l = Dz R_CB R^T (III.7, III.11). */
static bool world_linearise(const plr_filter *f, const plr_slot *slot, plr_linearisation *lin) {
    const plr_camera *camera = &f->par.camera;
    plr_real s[3], q[3], Dz[9], DzR[9], S[9], DzRS[9];
    in_body(f, slot->x, s);
    plr_camera_from_body(q, camera, s);
    lin->depth = q[2];
    lin->uses_pose = true;
    if (!(lin->depth >= f->par.min_depth))
        return false;
    plr_stereo_project(lin->z, camera, q);
    plr_stereo_jacobian(Dz, camera, q);
    plr_mat3_mul(DzR, Dz, camera->R_CB);
    plr_skew(S, s);
    plr_mat3_mul(DzRS, DzR, S);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            lin->H_pose[6 * i + j] = -DzR[3 * i + j];
            lin->H_pose[6 * i + 3 + j] = DzRS[3 * i + j];
        }
    plr_mat3_mul_nt(lin->H_landmark, DzR, f->R_WB);
    return true;
}

static void world_initialise(const plr_filter *f, const plr_real q[3], const plr_real S_q[9],
                             plr_new_landmark *landmark) {
    plr_real s[3], offset[3], R_WC[9], RS[9];
    plr_camera_to_body(s, &f->par.camera, q);
    plr_mat3_vec(offset, f->R_WB, s);
    for (int i = 0; i < 3; i++)
        landmark->x[i] = (plr_real)(f->p_WB[i] + (double)offset[i]);
    landmark->uses_pose = f->config.landmark_prior == PLR_PRIOR_CORRELATED;
    if (landmark->uses_pose)
        plr_world_by_pose(f->R_WB, s, landmark->J_pose);
    plr_mat3_mul_nt(R_WC, f->R_WB, f->par.camera.R_CB);
    plr_mat3_mul(RS, R_WC, S_q);
    plr_mat3_mul_nt(landmark->P, RS, RS);
}

static bool world_adopt(const plr_filter *f, const plr_landmark *known,
                        plr_new_landmark *landmark) {
    (void)f;
    for (int i = 0; i < 3; i++)
        landmark->x[i] = (plr_real)known->p_W_m[i];
    for (int i = 0; i < 9; i++)
        landmark->P[i] = (plr_real)known->P_W_m2[i];
    landmark->uses_pose = false;
    return true;
}

static unsigned world_retract(plr_filter *f, const plr_real *dx) {
    (void)f;
    for (unsigned slot = 0; slot < f->count; slot++)
        for (unsigned i = 0; i < 3; i++)
            f->slots[slot].x[i] += dx[plr_covariance_row(f, slot) + i];
    return 0;
}

static void world_in_world(const plr_filter *f, const plr_slot *slot, plr_world_point *point) {
    (void)f;
    for (int i = 0; i < 3; i++)
        point->p_W[i] = (double)slot->x[i];
    memset(point->J_pose, 0, sizeof point->J_pose);
    plr_mat3_identity(point->J_landmark);
}

const struct plr_model plr_model_world = {
    .name = "world",
    .propagate = world_propagate,
    .linearise = world_linearise,
    .initialise = world_initialise,
    .adopt = world_adopt,
    .retract = world_retract,
    .in_world = world_in_world,
};
