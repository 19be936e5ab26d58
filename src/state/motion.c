// SPDX-License-Identifier: MIT
#include "state/motion.h"

#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "math/so3.h"
#include "state/blocks.h"
#include "state/covariance.h"

void plr_motion_clear(plr_motion *motion) {
    memset(motion, 0, sizeof *motion);
}

void plr_motion_jump(plr_filter *f, plr_time_ns t_ns, const plr_real R_WB[9],
                     const double p_WB[3]) {
    plr_real offset[3], d[3], dR[9];
    for (int i = 0; i < 3; i++)
        offset[i] = (plr_real)(p_WB[i] - f->p_WB[i]);
    plr_mat3_tvec(d, f->R_WB, offset);
    plr_mat3_mul_tn(dR, f->R_WB, R_WB);
    for (int i = 0; i < 9; i += 4)
        dR[i] -= PLR_R(1);
    plr_se3_append(f->motion.E, f->motion.p, dR, d);
    f->motion.pending = 1;
    f->t_ns = t_ns;
    memcpy(f->R_WB, R_WB, sizeof f->R_WB);
    memcpy(f->p_WB, p_WB, sizeof f->p_WB);
}

/* A part of the biases' effect on the motion that is charged as noise besides. It keeps the factor of M
 * from depending on the biases alone, which would leave the biases' own variance to rounding. */
#define SHARE_OF_BIAS PLR_R(1e-4)

void plr_motion_covariance(const plr_filter *f, plr_real BPB[36], plr_real M[36]) {
    memset(BPB, 0, 36 * sizeof *BPB);
    if (plr_has_block(f, PLR_BLOCK_BIAS)) {
        plr_real P_b[36];
        plr_covariance_get(f, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, P_b);
        plr_sandwich6(BPB, f->motion.B, P_b);
    }
    for (int i = 0; i < 36; i++)
        M[i] = BPB[i] + f->motion.Q[i];
}

/* M = L L^T, 6x6. A direction in which M is zero, to rounding, becomes a zero column. */
static void factorise(const plr_real M[36], plr_real L[36]) {
    memset(L, 0, 36 * sizeof *L);
    for (unsigned k = 0; k < 6; k++) {
        plr_real pivot = M[7 * k];
        for (unsigned l = 0; l < k; l++)
            pivot = PLR_FMA(-L[6 * k + l], L[6 * k + l], pivot);
        if (!(pivot > PLR_R(1e-6) * M[7 * k]))
            continue;
        const plr_real root = PLR_SQRT(pivot), inverse = PLR_R(1) / root;
        L[7 * k] = root;
        for (unsigned i = k + 1; i < 6; i++) {
            plr_real sum = M[6 * i + k];
            for (unsigned l = 0; l < k; l++)
                sum = PLR_FMA(-L[6 * i + l], L[6 * k + l], sum);
            L[6 * i + k] = sum * inverse;
        }
    }
}

/* K = L^-1 B. */
static void share_of_bias(const plr_real L[36], const plr_real B[36], plr_real K[36]) {
    memcpy(K, B, 36 * sizeof *K);
    for (unsigned k = 0; k < 6; k++) {
        const plr_real inverse = L[7 * k] > 0 ? PLR_R(1) / L[7 * k] : PLR_R(0);
        for (unsigned c = 0; c < 6; c++) {
            plr_real sum = K[6 * k + c];
            for (unsigned l = 0; l < k; l++)
                sum = PLR_FMA(-L[6 * k + l], K[6 * l + c], sum);
            K[6 * k + c] = sum * inverse;
        }
    }
}

static void put_prior(plr_filter *f, plr_applied_motion *applied, plr_real scale, plr_real way2,
                      plr_real turn2) {
    plr_real BPB[36], M[36];
    memset(f->work.noise.closer, 0, sizeof f->work.noise.closer);
    memset(applied, 0, sizeof *applied);
    memcpy(applied->E, f->motion.E, sizeof applied->E);
    memcpy(applied->p, f->motion.p, sizeof applied->p);
    if (!f->motion.noisy)
        return;
    plr_motion_covariance(f, BPB, M);
    for (int i = 0; i < 36; i++)
        M[i] = scale * (PLR_FMA(SHARE_OF_BIAS, BPB[i], BPB[i]) + f->motion.Q[i]);
    for (int i = 0; i < 6; i++)
        M[7 * i] += i < 3 ? way2 : turn2;
    factorise(M, applied->L);
    if (plr_has_block(f, PLR_BLOCK_BIAS))
        share_of_bias(applied->L, f->motion.B, applied->K);
    memcpy(applied->JL, applied->L, sizeof applied->JL);
}

void plr_motion_prior(plr_filter *f, plr_applied_motion *applied) {
    put_prior(f, applied, 1, 0, 0);
}

void plr_motion_open_prior(plr_filter *f, plr_applied_motion *applied) {
    put_prior(f, applied, PLR_R(900), PLR_R(0.09), PLR_R(0.01));
}

void plr_motion_at(const plr_filter *f, const plr_applied_motion *prior, const plr_real z[6],
                   plr_applied_motion *applied) {
    plr_real n[6] = {0}, E[9], p[3], Jr[36];
    if (applied != prior)
        *applied = *prior;
    memcpy(applied->z, z, sizeof applied->z);
    plr_gemm_nn(6, 1, 6, applied->L, 6, z, 1, n, 1);
    plr_se3_expm1(E, p, n);
    memcpy(applied->E, f->motion.E, sizeof applied->E);
    memcpy(applied->p, f->motion.p, sizeof applied->p);
    plr_se3_append(applied->E, applied->p, E, p);
    plr_so3_orthonormalise_small(applied->E);
    plr_se3_right_jacobian(Jr, n);
    memset(applied->JL, 0, sizeof applied->JL);
    plr_gemm_nn(6, 6, 6, Jr, 6, applied->L, 6, applied->JL, 6);
}

void plr_motion_pose_covariance(const plr_filter *f, plr_real P_xi[36]) {
    const plr_motion *m = &f->motion;
    plr_real A[36], P[36], R[9], BPB[36] = {0};
    plr_se3_rotation(R, m->E);
    plr_se3_adjoint_inverse(A, R, m->p);
    plr_covariance_get(f, PLR_BLOCK_POSE, PLR_BLOCK_POSE, P);
    plr_sandwich6(P_xi, A, P);
    for (int i = 0; i < 36; i++)
        P_xi[i] += m->Q[i];
    if (plr_has_block(f, PLR_BLOCK_BIAS)) {
        plr_covariance_get(f, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, P);
        plr_sandwich6(BPB, m->B, P);
    }
    /* the terms that follow may take most of a variance away: their rounding is made up for */
    for (int i = 0; i < 6; i++)
        P_xi[7 * i] = PLR_FMA(PLR_R(8) * PLR_EPSILON, P_xi[7 * i] + BPB[7 * i], P_xi[7 * i]);
    if (plr_has_block(f, PLR_BLOCK_BIAS)) {
        plr_real AP[36] = {0}, cross[36] = {0};
        plr_covariance_get(f, PLR_BLOCK_POSE, PLR_BLOCK_BIAS, P);
        plr_gemm_nn(6, 6, 6, A, 6, P, 6, AP, 6);
        plr_gemm_nt(6, 6, 6, AP, 6, m->B, 6, cross, 6);
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 6; j++)
                P_xi[6 * i + j] += cross[6 * i + j] + cross[6 * j + i] + BPB[6 * i + j];
    }
}
