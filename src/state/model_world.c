// SPDX-License-Identifier: MIT
/*
 * The `world` model, the course report's: landmarks m in the world frame, with errors dm there
 * (III.1 to III.14). It is overconfident, and in float32 its covariance can lose
 * positivity (docs/NUMERICS.md). It exists for comparison.
 */
#include "pelorus/assertions.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "state/model.h"

#include "math/se3.h"
#include "math/small.h"
#include "state/camera.h"
#include "state/motion.h"
#include "state/pose.h"

static void world_propagate(plr_belief *belief, const plr_camera_model *camera,
                            const plr_motion *motion, plr_workspace *work,
                            const plr_applied_motion *applied) {
    (void)camera, (void)work;
    plr_real A[PLR_POSE_SQUARE], R[9], BPB[PLR_POSE_SQUARE], M[PLR_POSE_SQUARE];
    (void)applied; /* the pose alone moves, by its motion */
    plr_se3_rotation(R, motion->E);
    plr_se3_adjoint_inverse(A, R, motion->p);
    plr_motion_covariance_by_state(belief, motion, BPB);
    for (int i = 0; i < PLR_POSE_SQUARE; i++)
        M[i] = BPB[i] + motion->Q[i];
    plr_covariance_predict_pose(belief, A, motion->B, M);
}

/* s = R^T (m - p): the landmark in the body. */
static bool world_look(const plr_belief *belief, const plr_camera_model *camera, unsigned slot,
                       plr_view *view) {
    PLR_ASSERT(slot < belief->count);
    plr_real offset[3];
    for (int i = 0; i < 3; i++)
        offset[i] = (plr_real)((double)belief->slots[slot].x[i] - belief->p_WB[i]);
    plr_mat3_tvec(view->s, belief->R_WB, offset);
    plr_camera_from_body(view->q, &camera->given, view->s);
    return view->q[2] >= camera->min_depth;
}

/* H_pose = Dz R_CB [-I | [s]x], H_l = Dz R_CB R^T (III.7, III.11). */
static void world_derive(const plr_belief *belief, const plr_camera_model *camera, unsigned slot,
                         const plr_view *view, const plr_real Dz[9], const plr_real along[3],
                         plr_real z[3], plr_rows *H) {
    PLR_ASSERT(slot < belief->count);
    plr_real DzR[9], S[9], DzRS[9];
    (void)along, (void)z;
    plr_mat3_mul(DzR, Dz, camera->given.R_CB);
    plr_skew(S, view->s);
    plr_mat3_mul(DzRS, DzR, S);
    H->terms = 0;
    plr_mat3_mul_nt(plr_rows_add(H, plr_covariance_row(belief, slot), PLR_LANDMARK_DIM), DzR,
                    belief->R_WB);
    plr_real *by_pose = plr_rows_add(H, plr_row_of(belief, PLR_BLOCK_POSE), PLR_POSE_DIM);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            by_pose[PLR_POSE_DIM * i + j] = -DzR[3 * i + j];
            by_pose[PLR_POSE_DIM * i + 3 + j] = DzRS[3 * i + j];
        }
}

static void world_initialise(const plr_belief *belief, const plr_camera_model *camera,
                             const plr_real q[3], const plr_real S_q[9],
                             plr_new_landmark *landmark) {
    plr_real s[3], offset[3], RS[9];
    plr_camera_to_body(s, &camera->given, q);
    plr_mat3_vec(offset, belief->R_WB, s);
    for (int i = 0; i < 3; i++)
        landmark->x[i] = (plr_real)(belief->p_WB[i] + (double)offset[i]);
    landmark->uses_pose = camera->landmark_prior == PLR_PRIOR_CORRELATED;
    if (landmark->uses_pose)
        plr_world_by_pose(belief->R_WB, s, landmark->J_pose);
    plr_mat3_mul_nt(landmark->J_q, belief->R_WB, camera->given.R_CB); /* R_WC */
    plr_mat3_mul(RS, landmark->J_q, S_q);
    plr_mat3_mul_nt(landmark->P, RS, RS);
}

static bool world_adopt(const plr_belief *belief, const plr_camera_model *camera,
                        const plr_motion *motion, const plr_landmark *known,
                        plr_new_landmark *landmark) {
    (void)belief, (void)camera, (void)motion;
    for (int i = 0; i < 3; i++)
        landmark->x[i] = (plr_real)known->p_W_m[i];
    for (int i = 0; i < 9; i++)
        landmark->P[i] = (plr_real)known->P_W_m2[i];
    landmark->uses_pose = false;
    memset(landmark->by_calibration, 0, sizeof landmark->by_calibration);
    return true;
}

static unsigned world_retract(plr_belief *belief, const plr_camera_model *camera,
                              plr_workspace *work, const plr_real *dx) {
    (void)camera, (void)work;
    for (unsigned slot = 0; slot < belief->count; slot++)
        for (unsigned i = 0; i < 3; i++)
            belief->slots[slot].x[i] += dx[plr_covariance_row(belief, slot) + i];
    return 0;
}

static void world_in_world(const plr_belief *belief, const plr_camera_model *camera,
                           const plr_motion *motion, const plr_slot *slot, plr_world_point *point) {
    (void)camera, (void)motion;
    for (int i = 0; i < 3; i++)
        point->p_W[i] = (double)slot->x[i];
    const unsigned row = plr_covariance_row(belief, (unsigned)(slot - belief->slots));
    point->J.terms = 0;
    plr_mat3_identity(plr_rows_add(&point->J, row, PLR_LANDMARK_DIM));
}

const struct plr_model plr_model_world = {
    .propagate = world_propagate,
    .look = world_look,
    .derive = world_derive,
    .initialise = world_initialise,
    .adopt = world_adopt,
    .retract = world_retract,
    .in_world = world_in_world,
};
