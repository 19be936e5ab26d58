// SPDX-License-Identifier: MIT
#include "state/motion.h"

#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "math/so3.h"
#include "pelorus/assertions.h"
#include "state/blocks.h"
#include "state/covariance.h"

void plr_motion_clear(const plr_belief *belief, plr_motion *motion) {
    memset(motion, 0, sizeof *motion);
    if (!plr_has_block(belief, PLR_BLOCK_VELOCITY))
        return;
    const unsigned own = plr_row_of(belief, PLR_BLOCK_VELOCITY) - belief->layout.driver;
    for (unsigned i = 0; i < PLR_VELOCITY_DIM; i++)
        motion->core.V[PLR_DRIVERS * i + own + i] = 1;
}

void plr_motion_jump(plr_belief *belief, plr_motion *motion, plr_time_ns t_ns,
                     const plr_real R_WB[9], const double p_WB[3]) {
    plr_real offset[3], d[3], dR[9];
    for (int i = 0; i < 3; i++)
        offset[i] = (plr_real)(p_WB[i] - belief->p_WB[i]);
    plr_mat3_tvec(d, belief->R_WB, offset);
    plr_mat3_mul_tn(dR, belief->R_WB, R_WB);
    for (int i = 0; i < 9; i += 4)
        dR[i] -= PLR_R(1);
    plr_se3_append(motion->E, motion->p, dR, d);
    motion->pending = 1;
    belief->t_ns = t_ns;
    memcpy(belief->R_WB, R_WB, sizeof belief->R_WB);
    memcpy(belief->p_WB, p_WB, sizeof belief->p_WB);
}

/* This part of B P_dd B^T is added to M as noise. With Q = 0 to know the motion would otherwise
 * leave the drivers a variance of zero, give or take rounding. */
#define SHARE_OF_STATE PLR_R(1e-4)

void plr_motion_covariance_by_state(const plr_belief *belief, const plr_motion *motion,
                                    plr_real BPB[PLR_POSE_SQUARE]) {
    const unsigned m = belief->layout.drivers;
    plr_real P_dd[PLR_DRIVERS * PLR_DRIVERS];
    plr_covariance_with_drivers(belief, belief->layout.driver, m, P_dd);
    plr_sandwich_drivers(BPB, m, motion->B, P_dd);
}

void plr_motion_solve(const plr_real L[PLR_POSE_SQUARE], unsigned columns, plr_real *X,
                      unsigned ld) {
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        const plr_real inverse =
            L[(PLR_POSE_DIM + 1) * k] > 0 ? PLR_R(1) / L[(PLR_POSE_DIM + 1) * k] : PLR_R(0);
        for (unsigned c = 0; c < columns; c++) {
            plr_real sum = X[ld * k + c];
            for (unsigned l = 0; l < k; l++)
                sum = PLR_FMA(-L[PLR_POSE_DIM * k + l], X[ld * l + c], sum);
            X[ld * k + c] = sum * inverse;
        }
    }
}

void plr_motion_by_drivers(const plr_belief *belief, const plr_motion *motion,
                           const plr_real L[PLR_POSE_SQUARE], plr_real K[PLR_MOTION_BY]) {
    memcpy(K, motion->B, sizeof motion->B);
    plr_motion_solve(L, belief->layout.drivers, K, PLR_DRIVERS);
}

void plr_motion_transpose(const plr_real K[PLR_MOTION_BY], plr_real Kt[PLR_MOTION_BY]) {
    for (unsigned d = 0; d < PLR_DRIVERS; d++)
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            Kt[PLR_POSE_DIM * d + k] = K[PLR_DRIVERS * k + d];
}

/* How a prior is wider than B P_dd B^T + Q. */
typedef struct plr_widened {
    plr_real all, noise; /* both parts, or Q besides, so many times */
    plr_real way2, turn2;
} plr_widened;

static void fill_prior(const plr_belief *belief, const plr_motion *motion, plr_noise *noise,
                       plr_applied_motion *applied, const plr_widened *by) {
    plr_real BPB[PLR_POSE_SQUARE], M[PLR_POSE_SQUARE];
    memset(noise->range_shift, 0, sizeof noise->range_shift);
    memset(applied, 0, sizeof *applied);
    memcpy(applied->E, motion->E, sizeof applied->E);
    memcpy(applied->p, motion->p, sizeof applied->p);
    if (!motion->noisy)
        return;
    plr_motion_covariance_by_state(belief, motion, BPB);
    for (int i = 0; i < PLR_POSE_SQUARE; i++)
        M[i] = by->all * (PLR_FMA(SHARE_OF_STATE, BPB[i], BPB[i]) + by->noise * motion->Q[i]);
    for (int i = 0; i < PLR_POSE_DIM; i++)
        M[(PLR_POSE_DIM + 1) * i] += i < 3 ? by->way2 : by->turn2;
    plr_factor6(applied->L, M);
    memcpy(applied->JL, applied->L, sizeof applied->JL);
}

void plr_motion_prior(const plr_belief *belief, const plr_motion *motion, plr_noise *noise,
                      plr_real weight, plr_applied_motion *applied) {
    PLR_ASSERT(weight >= PLR_R(1));
    const bool inertial = plr_has_block(belief, PLR_BLOCK_VELOCITY);
    const plr_widened by = {.all = inertial ? PLR_R(1) : weight * weight,
                            .noise = inertial ? weight * weight : PLR_R(1)};
    fill_prior(belief, motion, noise, applied, &by);
}

/* What an open prior adds: 0.3 m and 0.1 rad, squared. */
#define OPEN_WAY  PLR_R(0.09)
#define OPEN_TURN PLR_R(0.01)

void plr_motion_open_prior(const plr_belief *belief, const plr_motion *motion, plr_noise *noise,
                           plr_applied_motion *applied) {
    static const plr_widened open = {PLR_R(900), PLR_R(1), OPEN_WAY, OPEN_TURN};
    fill_prior(belief, motion, noise, applied, &open);
}

void plr_motion_open_velocity(const plr_belief *belief, plr_motion *motion) {
    plr_core_motion *m = &motion->core;
    const plr_real seconds = motion->seconds;
    plr_real W[9];
    if (!plr_has_block(belief, PLR_BLOCK_VELOCITY) || !(seconds > 0))
        return;
    plr_skew(W, belief->velocity);
    for (unsigned i = 0; i < PLR_VELOCITY_DIM; i++) {
        m->Q_nc[(PLR_REST_DIM + 1) * i] += PLR_R(1.5) * OPEN_WAY / seconds;
        m->Q_cc[(PLR_REST_DIM + 1) * i] += PLR_R(3) * OPEN_WAY / (seconds * seconds);
        for (unsigned j = 0; j < PLR_VELOCITY_DIM; j++) {
            m->Q_nc[PLR_REST_DIM * (3 + i) + j] += OPEN_TURN * W[3 * j + i];
            m->Q_cc[PLR_REST_DIM * i + j] += OPEN_TURN * plr_dot3(W + 3 * i, W + 3 * j);
        }
    }
}

void plr_motion_widen_velocity(const plr_belief *belief, plr_motion *motion, plr_real weight) {
    plr_core_motion *m = &motion->core;
    if (!plr_has_block(belief, PLR_BLOCK_VELOCITY) || !(weight > 1))
        return;
    for (unsigned j = 0; j < PLR_VELOCITY_DIM; j++) {
        for (unsigned i = 0; i < PLR_POSE_DIM; i++)
            m->Q_nc[PLR_REST_DIM * i + j] *= weight * weight;
        for (unsigned i = 0; i < PLR_VELOCITY_DIM; i++)
            m->Q_cc[PLR_REST_DIM * i + j] *= weight * weight;
    }
}

void plr_motion_at(const plr_motion *motion, const plr_applied_motion *prior,
                   const plr_real z[PLR_POSE_DIM], plr_applied_motion *applied) {
    plr_real n[PLR_POSE_DIM], E[9], p[3], Jr[PLR_POSE_SQUARE];
    if (applied != prior)
        *applied = *prior;
    memcpy(applied->z, z, sizeof applied->z);
    plr_mat6_vec(n, applied->L, z);
    plr_se3_expm1(E, p, n);
    memcpy(applied->E, motion->E, sizeof applied->E);
    memcpy(applied->p, motion->p, sizeof applied->p);
    plr_se3_append(applied->E, applied->p, E, p);
    plr_so3_orthonormalise_small(applied->E);
    plr_se3_right_jacobian(Jr, n);
    plr_mat6_mul(applied->JL, Jr, applied->L);
}

void plr_motion_held_adjoint(const plr_belief *belief, plr_real A[PLR_POSE_SQUARE]) {
    plr_real R[9];
    plr_se3_rotation(R, belief->held.E);
    plr_se3_adjoint_inverse(A, R, belief->held.p);
}

void plr_motion_pose_covariance(const plr_belief *belief, const plr_motion *motion,
                                plr_real P_xi[PLR_POSE_SQUARE]) {
    const unsigned drivers = belief->layout.drivers;
    plr_real A[PLR_POSE_SQUARE], P[PLR_POSE_SQUARE], R[9], BPB[PLR_POSE_SQUARE];
    plr_se3_rotation(R, motion->E);
    plr_se3_adjoint_inverse(A, R, motion->p);
    plr_covariance_get(belief, PLR_BLOCK_POSE, PLR_BLOCK_POSE, P);
    plr_sandwich6(P_xi, A, P);
    for (int i = 0; i < PLR_POSE_SQUARE; i++)
        P_xi[i] += motion->Q[i];
    plr_motion_covariance_by_state(belief, motion, BPB);
    /* the terms that follow may cancel most of a variance: this covers their rounding */
    for (int i = 0; i < PLR_POSE_DIM; i++)
        P_xi[(PLR_POSE_DIM + 1) * i] = PLR_FMA(
            PLR_R(8) * PLR_EPSILON, P_xi[(PLR_POSE_DIM + 1) * i] + BPB[(PLR_POSE_DIM + 1) * i],
            P_xi[(PLR_POSE_DIM + 1) * i]);
    if (drivers == 0)
        return;
    plr_real P_xd[PLR_MOTION_BY], AP[PLR_MOTION_BY] = {0}, cross[PLR_POSE_SQUARE] = {0};
    plr_covariance_with_drivers(belief, plr_row_of(belief, PLR_BLOCK_POSE), PLR_POSE_DIM, P_xd);
    plr_gemm_nn(PLR_POSE_DIM, drivers, PLR_POSE_DIM, A, PLR_POSE_DIM, P_xd, drivers, AP, drivers);
    plr_gemm_nt(PLR_POSE_DIM, PLR_POSE_DIM, drivers, AP, drivers, motion->B, PLR_DRIVERS, cross,
                PLR_POSE_DIM);
    for (int i = 0; i < PLR_POSE_DIM; i++)
        for (int j = 0; j < PLR_POSE_DIM; j++)
            P_xi[PLR_POSE_DIM * i + j] += cross[PLR_POSE_DIM * i + j] +
                                          cross[PLR_POSE_DIM * j + i] + BPB[PLR_POSE_DIM * i + j];
}
