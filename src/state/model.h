// SPDX-License-Identifier: MIT
/*
 * A model defines how landmarks are stored and what the error of the state is. The rest of the
 * filter is the same for both models: `body` (model_body.c) and `world` (model_world.c).
 */
#ifndef PLR_STATE_MODEL_H
#define PLR_STATE_MODEL_H

#include <stdbool.h>

#include "pelorus/belief.h"
#include "pelorus/camera.h"
#include "pelorus/settings.h"
#include "pelorus/workspace.h"
#include "state/motion.h"
#include "state/rows.h"

/* A landmark relative to the camera at the present estimate. */
typedef struct plr_view {
    plr_real q[3]; /* in the left camera, m */
    plr_real s[3]; /* `world` alone: in the body, m */
} plr_view;

/* A landmark to be appended to the state: its error is J_pose xi + N(0, P). */
typedef struct plr_new_landmark {
    plr_real x[3];                            /* as stored in a slot */
    bool uses_pose;                           /* false: J_pose is zero and not filled */
    plr_real J_pose[PLR_ROWS * PLR_POSE_DIM]; /* 3x6 */
    plr_real P[9];                            /* 3x3 */
    plr_real J_q[9]; /* 3x3: its error by that of the point it was made from; not of a known one */
    plr_real by_calibration[PLR_CALIBRATIONS][PLR_LANDMARK_DIM]; /* its error by the camera's;
                                                                    zeros if it is known */
} plr_new_landmark;

/* A landmark's position in the world, and its derivative by the state. */
typedef struct plr_world_point {
    double p_W[3];
    plr_rows J; /* by landmark and pose */
} plr_world_point;

struct plr_model {
    /* Applies a motion; T_WB has been moved before. `body` holds it (plr_held_motion) until `retract` moves
     * landmarks and P, at once where it is exact, and keeps its noise apart in work.noise (docs/MATH.md 10);
     * `world` moves P, and adds the noise to it. */
    void (*propagate)(plr_belief *belief, const plr_camera_model *camera, const plr_motion *motion,
                      plr_workspace *work, const plr_applied_motion *applied);

    /* The landmark in the camera, after the held motion. False nearer than min_depth, where no linearisation is valid. */
    bool (*look)(const plr_belief *belief, const plr_camera_model *camera, unsigned slot,
                 plr_view *view);

    /* From derivatives by the point in the camera to those by the state's error: H = Dz dq/dx, Dz
     * 3x3. Dz q = along / q_z is passed besides: from Dz it would be a difference of rounded
     * numbers. z, the prediction, is corrected for plr_slot.beyond. */
    void (*derive)(const plr_belief *belief, const plr_camera_model *camera, unsigned slot,
                   const plr_view *view, const plr_real Dz[9], const plr_real along[3],
                   plr_real z[3], plr_rows *H);

    /* Makes a landmark from a point q in the camera, m, with covariance S_q S_q^T (3x3). The factor
     * S_q is passed and not the product: for a far point the variance along the ray is so large
     * that rounding would destroy the variance across it. The caller fills by_calibration. */
    void (*initialise)(const plr_belief *belief, const plr_camera_model *camera,
                       const plr_real q[3], const plr_real S_q[9], plr_new_landmark *landmark);

    /* Makes a landmark of a known position in the world. False if the model cannot. */
    bool (*adopt)(const plr_belief *belief, const plr_camera_model *camera,
                  const plr_motion *motion, const plr_landmark *known, plr_new_landmark *landmark);

    /* The tracks have wandered off their points by sigma px in u and in v. Both pictures show the
     * same patch, so the point stays as deep as it is. NULL in `world`. */
    void (*drift)(plr_belief *belief, const plr_camera_model *camera, plr_real sigma);

    /* Moves landmarks and P along the held motion and by a correction dx of the whole state before it; pose and
     * bias are the caller's. Returns how many were limited: PLR_REASON_RANGE_LIMITED. */
    unsigned (*retract)(plr_belief *belief, const plr_camera_model *camera, plr_workspace *work,
                        const plr_real *dx);

    /* The position of a landmark in the world. */
    void (*in_world)(const plr_belief *belief, const plr_camera_model *camera,
                     const plr_motion *motion, const plr_slot *slot, plr_world_point *point);
};

extern const struct plr_model plr_model_body;
extern const struct plr_model plr_model_world;

/* The model is stored as a number: a damaged address would be followed before any checksum. */
static inline const struct plr_model *plr_model_of(const plr_belief *belief) {
    return belief->model == PLR_MODEL_BODY ? &plr_model_body : &plr_model_world;
}

#endif
