// SPDX-License-Identifier: MIT
#include "filter/motion.h"

#include "filter/consistency.h"
#include "filter/covariance.h"
#include "filter/filter_internal.h"
#include "filter/model.h"
#include "lie/se3.h"
#include "lie/so3.h"
#include "linalg/dense.h"
#include "linalg/small.h"

/* The series of SO(3) hold up to here; a robot that turns further in a step cannot be followed. */
#define MAX_TURN PLR_R(3.1415926)
#define MAX_WAY  PLR_R(1000)

void plr_motion_clear(plr_motion *motion) {
    memset(motion, 0, sizeof *motion);
}

/* xi = seconds (reading - b) */
static void displacement(const plr_filter *f, const plr_real reading[6], plr_real seconds,
                         plr_real xi[6]) {
    for (int i = 0; i < 6; i++)
        xi[i] = seconds * (reading[i] - f->bias[i]);
}

plr_status plr_motion_check(const plr_filter *f, const plr_real reading[6], plr_real seconds) {
    plr_real xi[6];
    displacement(f, reading, seconds, xi);
    const plr_real way2 = plr_dot3(xi, xi), turn2 = plr_dot3(xi + 3, xi + 3);
    return way2 <= MAX_WAY * MAX_WAY && turn2 <= MAX_TURN * MAX_TURN ? PLR_OK : PLR_E_RANGE;
}

/* p <- p + R d, in double; R <- R dR, once more a rotation to rounding: an hour of steps without
 * that leaves it by a hundredth in float32. */
static void move_pose(plr_filter *f, const plr_real E[9], const plr_real d[3]) {
    plr_real step[3], change[9];
    plr_mat3_vec(step, f->R_WB, d);
    plr_mat3_mul(change, f->R_WB, E);
    for (int i = 0; i < 3; i++)
        f->p_WB[i] += (double)step[i];
    for (int i = 0; i < 9; i++)
        f->R_WB[i] += change[i];
    plr_so3_orthonormalise(f->R_WB);
}

/* Variances of a step's displacement, (rho, theta). */
static void step_variance(const plr_filter *f, plr_real seconds, plr_real interval,
                          plr_real variance[6]) {
    const plr_real share = f->config.noise == PLR_NOISE_STEP
                               ? (interval > 0 ? seconds / interval : PLR_R(1))
                               : seconds * interval;
    for (int i = 0; i < 3; i++) {
        variance[i] = f->par.velocity_variance[i] * share;
        variance[3 + i] = f->par.gyro_variance[i] * share;
    }
}

void plr_motion_step(plr_filter *f, plr_time_ns t_ns, const plr_real reading[6], plr_real seconds,
                     plr_real interval) {
    plr_real xi[6], E[9], R[9], p[3], A[36], next[36], variance[6];
    plr_motion *m = &f->motion;
    displacement(f, reading, seconds, xi);
    plr_se3_expm1(E, p, xi);
    plr_se3_rotation(R, E);
    plr_se3_adjoint_inverse(A, R, p);
    f->t_ns = t_ns;
    move_pose(f, E, p);
    plr_se3_append(m->E, m->p, E, p);
    plr_so3_orthonormalise_small(m->E);

    plr_sandwich6(next, A, m->Q);
    step_variance(f, seconds, interval, variance);
    for (int i = 0; i < 6; i++)
        next[7 * i] += variance[i];
    memcpy(m->Q, next, sizeof next);

    if (f->config.bias) {
        plr_real Jr[36];
        plr_se3_right_jacobian(Jr, xi);
        memset(next, 0, sizeof next);
        plr_gemm_nn(6, 6, 6, A, 6, m->B, 6, next, 6);
        for (int i = 0; i < 36; i++)
            m->B[i] = PLR_FMA(-seconds, Jr[i], next[i]);
    }
    m->seconds += seconds;
    m->pending = 1;
    m->noisy = 1;
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

void plr_motion_correct_pose(plr_filter *f, const plr_real xi[6]) {
    plr_real E[9], p[3];
    plr_se3_expm1(E, p, xi);
    move_pose(f, E, p);
}

/* A part of the biases' effect on the motion that is charged as noise besides. It keeps the factor of M
 * from depending on the biases alone, which would leave the biases' own variance to rounding. */
#define SHARE_OF_BIAS PLR_R(1e-4)

/* M = B P_bb B^T + Q, 6x6. */
static void motion_covariance(const plr_filter *f, plr_real M[36]) {
    memset(M, 0, 36 * sizeof *M);
    if (f->config.bias) {
        plr_real P_b[36];
        plr_covariance_bias(f, P_b);
        plr_sandwich6(M, f->motion.B, P_b);
    }
    for (int i = 0; i < 36; i++)
        M[i] = PLR_FMA(SHARE_OF_BIAS, M[i], M[i]) + f->motion.Q[i];
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
    plr_real M[36];
    memset(f->work.noise.closer, 0, sizeof f->work.noise.closer);
    memset(applied, 0, sizeof *applied);
    memcpy(applied->E, f->motion.E, sizeof applied->E);
    memcpy(applied->p, f->motion.p, sizeof applied->p);
    if (!f->motion.noisy)
        return;
    motion_covariance(f, M);
    for (int i = 0; i < 36; i++)
        M[i] *= scale;
    for (int i = 0; i < 6; i++)
        M[7 * i] += i < 3 ? way2 : turn2;
    factorise(M, applied->L);
    if (f->config.bias)
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

void plr_motion_drop(plr_filter *f) {
    if (f->config.bias)
        plr_covariance_add_bias_walk(f, f->par.bias_velocity_walk * f->motion.seconds,
                                     f->par.bias_gyro_walk * f->motion.seconds);
    plr_motion_clear(&f->motion);
}

void plr_motion_apply(plr_filter *f, const plr_applied_motion *applied) {
    if (plr_norm2_of_6(applied->z) > 0) {
        plr_real n[6] = {0};
        plr_gemm_nn(6, 1, 6, applied->L, 6, applied->z, 1, n, 1);
        plr_motion_correct_pose(f, n);
    }
    plr_model_of(f)->propagate(f, applied);
    plr_filter_carry_recovery(f);
    plr_motion_drop(f);
    if (!plr_covariance_is_positive(f))
        plr_filter_diverge(f);
}

void plr_motion_settle(plr_filter *f) {
    plr_applied_motion applied;
    if (!f->motion.pending || f->diverged)
        return;
    plr_motion_prior(f, &applied);
    plr_motion_apply(f, &applied);
    if (!f->work.noise.open)
        return;
    plr_covariance_close_noise(f, NULL);
    (void)plr_model_of(f)->retract(f, f->work.dx); /* landmarks beyond infinity go back there */
}

void plr_motion_reference(const plr_filter *f, plr_real R_WB[9], double p_WB[3]) {
    plr_real moved[3];
    memcpy(R_WB, f->R_WB, sizeof f->R_WB);
    memcpy(p_WB, f->p_WB, sizeof f->p_WB);
    if (!f->motion.pending)
        return;
    plr_real back[9];
    plr_mat3_mul_nt(back, f->R_WB, f->motion.E); /* T D^-1 */
    for (int i = 0; i < 9; i++)
        R_WB[i] += back[i];
    plr_so3_orthonormalise(R_WB);
    plr_mat3_vec(moved, R_WB, f->motion.p);
    for (int i = 0; i < 3; i++)
        p_WB[i] -= (double)moved[i];
}

void plr_motion_pose_covariance(const plr_filter *f, plr_real P_xi[36]) {
    const plr_motion *m = &f->motion;
    plr_real A[36], P[36], R[9], BPB[36] = {0};
    plr_se3_rotation(R, m->E);
    plr_se3_adjoint_inverse(A, R, m->p);
    plr_covariance_pose(f, P);
    plr_sandwich6(P_xi, A, P);
    for (int i = 0; i < 36; i++)
        P_xi[i] += m->Q[i];
    if (f->config.bias) {
        plr_covariance_bias(f, P);
        plr_sandwich6(BPB, m->B, P);
    }
    /* the terms that follow may take most of a variance away: their rounding is made up for */
    for (int i = 0; i < 6; i++)
        P_xi[7 * i] = PLR_FMA(PLR_R(8) * PLR_EPSILON, P_xi[7 * i] + BPB[7 * i], P_xi[7 * i]);
    if (f->config.bias) {
        plr_real AP[36] = {0}, cross[36] = {0};
        plr_covariance_pose_bias(f, P);
        plr_gemm_nn(6, 6, 6, A, 6, P, 6, AP, 6);
        plr_gemm_nt(6, 6, 6, AP, 6, m->B, 6, cross, 6);
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 6; j++)
                P_xi[6 * i + j] += cross[6 * i + j] + cross[6 * j + i] + BPB[6 * i + j];
    }
    plr_consistency_cover(f, P_xi);
}

void plr_filter_diverge(plr_filter *f) {
    if (!f->diverged)
        f->totals.diverged_ns = f->t_ns;
    f->diverged = 1;
    f->work.noise.open = 0; /* what was about to come back into P is lost with it */
}
