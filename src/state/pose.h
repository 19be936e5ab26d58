// SPDX-License-Identifier: MIT
/* The pose T_WB of the body. */
#ifndef PLR_STATE_POSE_H
#define PLR_STATE_POSE_H

#include <stdbool.h>

#include "pelorus/belief.h"

/* T <- T (I + E, d): p <- p + R d in double, and R is made orthonormal. */
void plr_pose_move(plr_belief *belief, const plr_real E[9], const plr_real d[3]);

/* True if xi, m and rad, is finite and small enough for T Exp(xi): beyond it nothing that was
 * linearised is worth anything, and the series of Exp leaves the rotations. */
bool plr_pose_is_correction(const plr_real xi[PLR_POSE_DIM]);

/* T <- T Exp(xi): the correction of the pose by a frame. */
void plr_pose_correct(plr_belief *belief, const plr_real xi[PLR_POSE_DIM]);

/* How far the pose has moved from (R_WB, p_WB), in that body: m, and rad to first order. */
void plr_pose_moved_from(const plr_belief *belief, const plr_real R_WB[9], const double p_WB[3],
                         plr_real moved[PLR_POSE_DIM]);

/* xi from the pose to (R_WB, p_WB) = T Exp(xi): the turn exactly, the way to first order. */
void plr_pose_towards(const plr_belief *belief, const plr_real R_WB[9], const double p_WB[3],
                      plr_real xi[PLR_POSE_DIM]);

/* The pose to which landmarks and covariance refer: the one before the accumulated motion. */
void plr_pose_reference(const plr_belief *belief, const plr_motion *motion, plr_real R_WB[9],
                        double p_WB[3]);

/* J = R_WB [I | -[s]x], 3x6: derivative of a point's world position by the pose's error (rho,
 * theta), where s is the point in the body, m. */
void plr_world_by_pose(const plr_real R_WB[9], const plr_real s_B[3],
                       plr_real J[PLR_ROWS * PLR_POSE_DIM]);

#endif
