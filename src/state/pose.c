// SPDX-License-Identifier: MIT
#include "state/pose.h"

#include "math/se3.h"
#include "math/small.h"
#include "math/so3.h"
#include "pelorus/assertions.h"
#include "state/rigid_fit.h"

/* Not made orthonormal, R would deviate from a rotation by 0.01 in an hour of float32 steps. */
void plr_pose_move(plr_belief *belief, const plr_real E[9], const plr_real d[3]) {
    plr_real step[3], change[9];
    plr_mat3_vec(step, belief->R_WB, d);
    plr_mat3_mul(change, belief->R_WB, E);
    for (int i = 0; i < 3; i++)
        belief->p_WB[i] += (double)step[i];
    for (int i = 0; i < 9; i++)
        belief->R_WB[i] += change[i];
    plr_so3_orthonormalise(belief->R_WB);
}

bool plr_pose_is_correction(const plr_real xi[PLR_POSE_DIM]) {
    static const plr_real max_way2 = 1e6;
    return plr_dot3(xi, xi) < max_way2 && plr_dot3(xi + 3, xi + 3) < PLR_MAX_CORRECTION_TURN2;
}

void plr_pose_correct(plr_belief *belief, const plr_real xi[PLR_POSE_DIM]) {
    PLR_ASSERT(plr_pose_is_correction(xi));
    plr_real E[9], p[3];
    plr_se3_expm1(E, p, xi);
    plr_pose_move(belief, E, p);
}

/* From one pose to another, in the body of the first: the way, m, and the turn as a matrix. */
static void between(const plr_real R_from[9], const double p_from[3], const plr_real R_to[9],
                    const double p_to[3], plr_real way[3], plr_real turn[9]) {
    plr_real way_W[3];
    for (int i = 0; i < 3; i++)
        way_W[i] = (plr_real)(p_to[i] - p_from[i]);
    plr_mat3_tvec(way, R_from, way_W);
    plr_mat3_mul_tn(turn, R_from, R_to);
}

void plr_pose_moved_from(const plr_belief *belief, const plr_real R_WB[9], const double p_WB[3],
                         plr_real moved[PLR_POSE_DIM]) {
    plr_real turn[9];
    between(R_WB, p_WB, belief->R_WB, belief->p_WB, moved, turn);
    plr_turn_of(moved + 3, turn);
}

void plr_pose_towards(const plr_belief *belief, const plr_real R_WB[9], const double p_WB[3],
                      plr_real xi[PLR_POSE_DIM]) {
    plr_real turn[9];
    between(belief->R_WB, belief->p_WB, R_WB, p_WB, xi, turn);
    plr_so3_log(xi + 3, turn);
}

void plr_pose_reference(const plr_belief *belief, const plr_motion *motion, plr_real R_WB[9],
                        double p_WB[3]) {
    plr_real moved[3];
    memcpy(R_WB, belief->R_WB, sizeof belief->R_WB);
    memcpy(p_WB, belief->p_WB, sizeof belief->p_WB);
    if (!motion->pending)
        return;
    plr_real back[9];
    plr_mat3_mul_nt(back, belief->R_WB, motion->E); /* T D^-1 */
    for (int i = 0; i < 9; i++)
        R_WB[i] += back[i];
    plr_so3_orthonormalise(R_WB);
    plr_mat3_vec(moved, R_WB, motion->p);
    for (int i = 0; i < 3; i++)
        p_WB[i] -= (double)moved[i];
}

void plr_world_by_pose(const plr_real R_WB[9], const plr_real s_B[3],
                       plr_real J[PLR_ROWS * PLR_POSE_DIM]) {
    plr_real S[9], RS[9];
    plr_skew(S, s_B);
    plr_mat3_mul(RS, R_WB, S);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            J[PLR_POSE_DIM * i + j] = R_WB[3 * i + j];
            J[PLR_POSE_DIM * i + 3 + j] = -RS[3 * i + j];
        }
}
