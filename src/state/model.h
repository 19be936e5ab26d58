// SPDX-License-Identifier: MIT
/*
 * A model: how landmarks are stored, and how the error of the state is defined. The rest of the
 * filter is the same for both models: `body` (model_body.c) and `world` (model_world.c).
 */
#ifndef PLR_STATE_MODEL_H
#define PLR_STATE_MODEL_H

#include <stdbool.h>

#include "pelorus/state.h"
#include "state/motion.h"

/* An observation's prediction and derivatives at the current estimate. Rows (uL, uR, v). */
typedef struct plr_linearisation {
    plr_real z[3];          /* px */
    plr_real depth;         /* m, along the camera's axis */
    bool uses_pose;         /* false: H_pose is zero and not filled */
    plr_real H_pose[18];    /* 3x6 */
    plr_real H_landmark[9]; /* 3x3 */
} plr_linearisation;

/* A landmark about to enter the state: error = J_pose xi + N(0, P). */
typedef struct plr_new_landmark {
    plr_real x[3];       /* as stored in a slot */
    bool uses_pose;      /* false: J_pose is zero and not filled */
    plr_real J_pose[18]; /* 3x6 */
    plr_real P[9];       /* 3x3 */
} plr_new_landmark;

/* A landmark's place in the world, and how its error arises: dm = J_pose xi + J_landmark w. */
typedef struct plr_world_point {
    double p_W[3];
    plr_real J_pose[18];
    plr_real J_landmark[9];
} plr_world_point;

struct plr_model {
    const char *name;

    /* Applies a motion to landmarks and covariance; T_WB has been moved before. `body` keeps the
     * motion's noise apart in work.noise (docs/MATH.md 10); `world` adds it to P. */
    void (*propagate)(plr_filter *f, const plr_applied_motion *motion);

    /* Predicts the observation of a slot, with its derivatives. False if the point is nearer than
     * min_depth_m in front of the camera, where a linearisation means nothing. */
    bool (*linearise)(const plr_filter *f, const plr_slot *slot, plr_linearisation *lin);

    /* Makes a landmark from a point q in the camera, m, with covariance S_q S_q^T (3x3). The factor
     * S_q is passed, because for a far point the product is so large along the ray that rounding
     * would destroy what it says across the ray. */
    void (*initialise)(const plr_filter *f, const plr_real q[3], const plr_real S_q[9],
                       plr_new_landmark *landmark);

    /* Makes a landmark from a known position in the world. False if the model cannot represent
     * it. */
    bool (*adopt)(const plr_filter *f, const plr_landmark *known, plr_new_landmark *landmark);

    /* Applies a correction dx of the whole state (plr_covariance_dim elements) to the landmarks,
     * and transports P to the new estimate. The caller corrects pose and bias. Returns how many
     * landmark corrections were limited: PLR_REASON_RANGE_LIMITED. */
    unsigned (*retract)(plr_filter *f, const plr_real *dx);

    /* The position of a landmark in the world. */
    void (*in_world)(const plr_filter *f, const plr_slot *slot, plr_world_point *point);
};

/* J = R_WB [I | -[s]x], 3x6: derivative of a point's world position by the pose's error (rho,
 * theta), where s is the point in the body, m. */
void plr_world_by_pose(const plr_real R_WB[9], const plr_real s_B[3], plr_real J[18]);

extern const struct plr_model plr_model_body;
extern const struct plr_model plr_model_world;

/* The filter holds the model's number and not its address: a damaged pointer could lead
 * anywhere. */
static inline const struct plr_model *plr_model_of(const plr_filter *f) {
    return f->model == PLR_MODEL_BODY ? &plr_model_body : &plr_model_world;
}

#endif
