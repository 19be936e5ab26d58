// SPDX-License-Identifier: MIT
/*
 * A model: where landmarks live, and how the state's error is defined. The rest of the filter does
 * not know which one runs. Two exist: `body` (model_body.c) and `world` (model_world.c).
 */
#ifndef PLR_FILTER_MODEL_H
#define PLR_FILTER_MODEL_H

#include <stdbool.h>

#include "filter/motion.h"
#include "pelorus/state.h"

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

    /* Applies a motion to landmarks and covariance. T_WB has moved already. `body` leaves its noise in
     * work.noise, open; `world` puts it into P. */
    void (*propagate)(plr_filter *f, const plr_applied_motion *motion);

    /* Predicts an observation of a slot. False if the point lies nearer than min_depth in front of
     * the camera: no basis for a linearisation. */
    bool (*linearise)(const plr_filter *f, const plr_slot *slot, plr_linearisation *lin);

    /* A new landmark from its pixels: q in the camera, with covariance S_q S_q^T (3x3). A factor,
     * for the product itself would drown a far point's bearing in the rounding of its range. */
    void (*initialise)(const plr_filter *f, const plr_real q[3], const plr_real S_q[9],
                       plr_new_landmark *landmark);

    /* A landmark of known place in the world. False if this place cannot be represented. */
    bool (*adopt)(const plr_filter *f, const plr_landmark *known, plr_new_landmark *landmark);

    /* Moves the landmarks by dx (dim long), of which the pose has its share before or after, and
     * transports P. Returns how many landmark corrections had to be cut at the limits of range. */
    unsigned (*retract)(plr_filter *f, const plr_real *dx);

    /* Where a landmark is in the world. */
    void (*in_world)(const plr_filter *f, const plr_slot *slot, plr_world_point *point);
};

/* J = R_WB [I | -[s]x], 3x6: how the pose's error moves a point that stands at s in the body. */
void plr_world_by_pose(const plr_real R_WB[9], const plr_real s_B[3], plr_real J[18]);

extern const struct plr_model plr_model_body;
extern const struct plr_model plr_model_world;

/* By number: a pointer in RAM could be made to point anywhere. */
static inline const struct plr_model *plr_model_of(const plr_filter *f) {
    return f->model == PLR_MODEL_BODY ? &plr_model_body : &plr_model_world;
}

#endif
