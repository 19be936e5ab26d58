// SPDX-License-Identifier: MIT
/* The process `twist`: measured velocity and angular rate move the pose (docs/MATH.md 4). */
#include "process/process.h"

#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "math/so3.h"
#include "pelorus/assertions.h"
#include "process/velocity.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "state/pose.h"
#include "state/seconds.h"

/* An interval longer than usual by this many of the intervals' deviations lacks readings. */
#define LATE_SIGMAS PLR_R(4)

static void lay_out(plr_belief *belief, const plr_config *config) {
    plr_lay_out(belief, 0, config->bias ? PLR_BIAS_DIM : 0, PLR_POSE_DIM);
}

static plr_real bias_walk(const plr_source *source, unsigned k) {
    return k < 3 ? source->bias_velocity_walk : source->bias_gyro_walk;
}

static void walk(plr_belief *belief, const plr_source *source, plr_real seconds) {
    plr_real variance[PLR_BIAS_DIM];
    for (unsigned i = 0; i < PLR_BIAS_DIM; i++)
        variance[i] = seconds * bias_walk(source, i);
    plr_covariance_add_variance(belief, PLR_BLOCK_BIAS, variance);
}

static void bias_covariance(const plr_belief *belief, const plr_motion *motion,
                            const plr_source *source, plr_real P_b[PLR_POSE_SQUARE]) {
    memset(P_b, 0, PLR_POSE_SQUARE * sizeof *P_b);
    if (!plr_has_block(belief, PLR_BLOCK_BIAS))
        return;
    plr_covariance_get(belief, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, P_b);
    for (unsigned i = 0; i < PLR_BIAS_DIM; i++)
        P_b[(PLR_BIAS_DIM + 1) * i] += motion->seconds * bias_walk(source, i);
}

static PLR_SELDOM void now(const plr_belief *belief, const plr_motion *motion,
                           const plr_source *source, plr_real u[PLR_POSE_DIM],
                           plr_real P_u[PLR_POSE_SQUARE]) {
    for (int i = 0; i < PLR_POSE_DIM; i++)
        u[i] = source->reading[i] - belief->bias[i];
    if (!P_u)
        return;
    /* with noise = step the sigmas are those of a displacement: divide by the step */
    const plr_real scale = source->noise == PLR_NOISE_STEP && source->interval_s > 0
                               ? PLR_R(1) / (source->interval_s * source->interval_s)
                               : PLR_R(1);
    bias_covariance(belief, motion, source, P_u);
    for (int i = 0; i < 3; i++) {
        P_u[(PLR_POSE_DIM + 1) * i] += scale * source->velocity_variance[i];
        P_u[(PLR_POSE_DIM + 1) * (3 + i)] += scale * source->gyro_variance[i];
    }
}

/* xi = seconds (reading - b) */
static void displacement(const plr_belief *belief, const plr_real reading[PLR_POSE_DIM],
                         plr_real seconds, plr_real xi[PLR_POSE_DIM]) {
    for (int i = 0; i < PLR_POSE_DIM; i++)
        xi[i] = seconds * (reading[i] - belief->bias[i]);
}

static bool is_possible(const plr_real xi[PLR_POSE_DIM]) {
    return plr_step_is_possible(plr_dot3(xi, xi), plr_dot3(xi + 3, xi + 3));
}

static plr_status check(const plr_belief *belief, const plr_source *source,
                        const plr_real reading[PLR_POSE_DIM], plr_real seconds) {
    (void)source;
    plr_real xi[PLR_POSE_DIM];
    displacement(belief, reading, seconds, xi);
    return is_possible(xi) ? PLR_OK : PLR_E_RANGE;
}

/* Variances of a step's displacement, (rho, theta). */
static void step_variance(const plr_source *source, plr_real seconds, plr_real interval,
                          plr_real variance[PLR_POSE_DIM]) {
    const plr_real share = source->noise == PLR_NOISE_STEP
                               ? (interval > 0 ? seconds / interval : PLR_R(1))
                               : seconds * interval;
    for (int i = 0; i < 3; i++) {
        variance[i] = source->velocity_variance[i] * share;
        variance[3 + i] = source->gyro_variance[i] * share;
    }
}

/* Whether readings were lost in an interval of h seconds. Where intervals differ by much all along,
 * a long one is usual: its reading stands for all of it, to the sigma that was told. */
static bool lost_readings(const plr_source *source, plr_real h) {
    const plr_real usual = source->inertial.usual_s, late = h - usual;
    return usual > 0 && h > PLR_LONG_INTERVALS * usual &&
           late * late > LATE_SIGMAS * LATE_SIGMAS * source->inertial.off_usual2;
}

static void mean(const plr_belief *belief, const plr_source *source, plr_time_ns t_ns,
                 const plr_real reading[PLR_READING_DIM], plr_process_step *step) {
    const bool makes_up = !lost_readings(source, step->interval);
    plr_mean_reading(belief, source, source->timing, makes_up, t_ns, reading, step);
}

static void hold(const plr_belief *belief, const plr_source *source, plr_real age,
                 plr_real held[PLR_READING_DIM]) {
    (void)belief, (void)age;
    memcpy(held, source->reading, PLR_READING_DIM * sizeof *held);
}

/* The square of by how much a velocity is off that is held for n usual intervals: what readings
 * differ by beyond their noise, later what they scatter by. `which`: 0 linear, 1 angular. */
static plr_real off2(const plr_source *source, unsigned which, plr_real n) {
    PLR_ASSERT(which < 2 && n > PLR_R(0));
    const plr_real *v = which == 0 ? source->velocity_variance : source->gyro_variance;
    const plr_real noise = (v[0] + v[1] + v[2]) / PLR_R(3);
    const plr_real change = source->inertial.change2[which] - PLR_R(2) * noise;
    const plr_real spread = source->inertial.spread2[which] - noise;
    if (!(change > 0))
        return 0;
    const plr_real changed = PLR_R(0.25) * change * n * n;
    const plr_real most = change + (spread > 0 ? spread : PLR_R(0));
    return changed < most ? changed : most;
}

static PLR_SELDOM bool missed(const plr_source *source, plr_real h0, plr_real h1,
                              const plr_real *next, plr_real variance[PLR_POSE_DIM]) {
    const plr_real usual = source->inertial.usual_s;
    if (!lost_readings(source, h1) || source->noise == PLR_NOISE_STEP)
        return false;
    for (unsigned i = 0; i < PLR_POSE_DIM; i++) {
        variance[i] = off2(source, i / 3, h1 / usual);
        if (next) { /* when it became what it is now is not known */
            const plr_real *v = i < 3 ? source->velocity_variance : source->gyro_variance;
            const plr_real step = next[i] - source->reading[i],
                           change = step * step - PLR_R(2) * v[i % 3];
            variance[i] += change > 0 ? change / PLR_R(3) : PLR_R(0);
        }
        variance[i] *= h1 * h1 - h0 * h0;
    }
    return true;
}

static void rest(const plr_belief *belief, const plr_source *source,
                 plr_real reading[PLR_READING_DIM]) {
    (void)source;
    memcpy(reading, belief->bias, PLR_READING_DIM * sizeof *reading);
}

/* What the older reading had wrong in the part of the interval that it bridged counts by as much as the
 * reading does beside the velocities that are held: T of plr_velocity_fuse. */
static void make_up(const plr_process_step *by, const plr_real T[PLR_POSE_SQUARE],
                    plr_real xi[PLR_POSE_DIM]) {
    for (unsigned j = 0; j < PLR_POSE_DIM; j++) {
        const plr_real wrong = by->seconds * (by->mean[j] - by->whole[j]);
        for (unsigned i = 0; i < PLR_POSE_DIM; i++)
            xi[i] = PLR_FMA(T[PLR_POSE_DIM * i + j], wrong, xi[i]);
    }
}

static void step(plr_belief *belief, plr_motion *motion, plr_source *source, plr_time_ns t_ns,
                 const plr_process_step *by) {
    const plr_real seconds = by->seconds;
    plr_real xi[PLR_POSE_DIM], E[9], R[9], p[3], A[PLR_POSE_SQUARE], next[PLR_POSE_SQUARE],
        variance[PLR_POSE_DIM], V[PLR_POSE_SQUARE], T[PLR_POSE_SQUARE];
    bool fused = plr_velocity_is_held(belief, source, t_ns);
    displacement(belief, fused ? by->whole : by->mean, seconds, xi);
    step_variance(source, seconds, by->interval, variance);
    if (fused) {
        memset(V, 0, sizeof V);
        for (int i = 0; i < PLR_POSE_DIM; i++)
            V[(PLR_POSE_DIM + 1) * i] = variance[i];
        plr_velocity_fuse(belief, source, t_ns, seconds, xi, V, T);
        make_up(by, T, xi);
        if (!is_possible(xi)) { /* no step of a robot: the velocities are wrong */
            plr_velocity_forget(source);
            displacement(belief, by->mean, seconds, xi);
            fused = false;
        }
    }
    plr_se3_expm1(E, p, xi);
    plr_se3_rotation(R, E);
    plr_se3_adjoint_inverse(A, R, p);
    belief->t_ns = t_ns;
    plr_pose_move(belief, E, p);
    plr_se3_append(motion->E, motion->p, E, p);
    plr_so3_orthonormalise_small(motion->E);

    plr_sandwich6(next, A, motion->Q);
    for (int i = 0; i < PLR_POSE_DIM && !fused; i++)
        next[(PLR_POSE_DIM + 1) * i] += variance[i];
    for (int i = 0; i < PLR_POSE_SQUARE && fused; i++)
        next[i] += V[i];
    memcpy(motion->Q, next, sizeof next);

    if (plr_has_block(belief, PLR_BLOCK_BIAS)) {
        plr_real Jr[PLR_POSE_SQUARE];
        plr_se3_right_jacobian(Jr, xi);
        if (fused) {
            plr_mat6_mul(next, Jr, T);
            memcpy(Jr, next, sizeof Jr);
        }
        plr_real AB[PLR_POSE_SQUARE] = {0};
        plr_gemm_nn(PLR_POSE_DIM, PLR_BIAS_DIM, PLR_POSE_DIM, A, PLR_POSE_DIM, motion->B,
                    PLR_DRIVERS, AB, PLR_BIAS_DIM);
        for (int i = 0; i < PLR_POSE_DIM; i++)
            for (int j = 0; j < PLR_BIAS_DIM; j++)
                motion->B[PLR_DRIVERS * i + j] =
                    PLR_FMA(-seconds, Jr[PLR_BIAS_DIM * i + j], AB[PLR_BIAS_DIM * i + j]);
    }
    motion->seconds += seconds;
    motion->pending = 1;
    motion->noisy = 1;
}

const plr_process plr_process_twist = {
    .lay_out = lay_out,
    .check = check,
    .step = step,
    .mean = mean,
    .hold = hold,
    .missed = missed,
    .rest = rest,
    .walk = walk,
    .bias_walk = bias_walk,
    .now = now,
    .bias_covariance = bias_covariance,
};
