// SPDX-License-Identifier: MIT
/*
 * The process `imu`: accelerometer and gyro move pose and velocity (docs/MATH.md 19). The body's
 * axes are those of the IMU. The state before the landmarks is (rho, theta, v, b_a, b_g), with v in
 * body axes: then a shift of the world, or a turn about the vertical, changes nothing but the pose,
 * and the filter learns nothing of either.
 */
#include <string.h>

#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "math/so3.h"
#include "process/imu_noise.h"
#include "process/process.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "state/pose.h"
#include "state/seconds.h"

/* The error of a reading that is held lasts about so long before it becomes another, s. */
#define LASTING_S PLR_R(0.5)
/* What a frame has bridged by the older reading is made up for if it is no longer than this, s. */
#define BRIDGED_S PLR_R(0.1)
/* A reading older than this says nothing of the present: the body keeps its velocity instead, s. */
#define STALE_S PLR_R(0.25)

/* Rows in the core, and columns among the drivers (theta, v, b_a, b_g). */
enum { THETA = PLR_CORE_THETA, VEL = PLR_CORE_VEL, ACCEL = PLR_CORE_ACCEL, GYRO = PLR_CORE_GYRO };
enum { DIM = PLR_CORE_DIM, MOVED = PLR_CORE_MOVED, D = PLR_DRIVERS };
enum { D_THETA = 0, D_VEL = 3, D_ACCEL = 6, D_GYRO = 9 };

static void lay_out(plr_belief *belief, const plr_config *config) {
    (void)config;
    plr_lay_out(belief, PLR_VELOCITY_DIM, PLR_BIAS_DIM, THETA);
}

/* gamma = R_WB^T (0, 0, -g): gravity's acceleration in body axes, m/s^2. */
static void gravity(const plr_belief *belief, const plr_source *source, plr_real gamma[3]) {
    for (int i = 0; i < 3; i++)
        gamma[i] = -source->gravity * belief->R_WB[6 + i];
}

/* ---------------------------------------------------------------- one step */

/* A step of constant rate w and specific force a, both without bias, over tau seconds. */
typedef struct plr_imu_step {
    plr_real tau;
    plr_real a[3], gamma[3]; /* gamma: gravity in body axes before the step */
    plr_real E[9], Et[9];    /* (I + E) = Exp(tau w); Et = Exp(tau w)^T */
    plr_real G1[9], G2[9];   /* integrals of Exp(s w), once and twice, over tau and tau^2 */
    plr_real d[3], v[3];     /* the way, in axes before the step; the velocity after it */
} plr_imu_step;

/* I c + s_1 W + s_2 W^2 */
static void series(plr_real G[9], plr_real c, plr_real s1, plr_real s2, const plr_real W[9],
                   const plr_real WW[9]) {
    for (int i = 0; i < 9; i++)
        G[i] = PLR_FMA(s2, WW[i], s1 * W[i]);
    for (int i = 0; i < 9; i += 4)
        G[i] += c;
}

static void integrate(const plr_belief *belief, const plr_source *source,
                      const plr_real reading[PLR_READING_DIM], plr_real tau, plr_imu_step *s) {
    plr_real phi[3], W[9], WW[9], g1[3], g2[3], next[3];
    plr_so3_series c;
    s->tau = tau;
    for (int i = 0; i < 3; i++) {
        s->a[i] = reading[i] - belief->bias[i];
        phi[i] = tau * (reading[3 + i] - belief->bias[3 + i]);
    }
    gravity(belief, source, s->gamma);
    plr_so3_series_at(&c, plr_dot3(phi, phi));
    plr_skew(W, phi);
    plr_mat3_mul(WW, W, W);
    series(s->E, 0, c.a, c.b, W, WW);
    series(s->G1, 1, c.b, c.c, W, WW);
    series(s->G2, PLR_R(0.5), c.c, c.d, W, WW);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            s->Et[3 * i + j] = s->E[3 * j + i] + (i == j ? PLR_R(1) : PLR_R(0));
    plr_mat3_vec(g1, s->G1, s->a);
    plr_mat3_vec(g2, s->G2, s->a);
    const plr_real *v = belief->velocity;
    for (int i = 0; i < 3; i++) {
        s->d[i] = tau * PLR_FMA(tau, PLR_FMA(PLR_R(0.5), s->gamma[i], g2[i]), v[i]);
        next[i] = PLR_FMA(tau, s->gamma[i] + g1[i], v[i]);
    }
    plr_mat3_vec(s->v, s->Et, next);
}

static plr_status check(const plr_belief *belief, const plr_source *source,
                        const plr_real reading[PLR_READING_DIM], plr_real seconds) {
    plr_real turn2 = 0, way2 = 0;
    for (int i = 0; i < 3; i++) {
        const plr_real turn = seconds * (reading[3 + i] - belief->bias[3 + i]);
        const plr_real way = seconds * (plr_abs(belief->velocity[i]) +
                                        seconds * (plr_abs(reading[i]) + source->gravity));
        turn2 += turn * turn;
        way2 += way * way;
    }
    return plr_step_is_possible(way2, turn2) ? PLR_OK : PLR_E_RANGE;
}

/* ---------------------------------------------------------------- accumulation */

/* C (3 x n, leading dimension ldc) <- s E^T A (3 x n, leading dimension lda) */
static void turn_back(unsigned n, const plr_real Et[9], plr_real s, const plr_real *A, unsigned lda,
                      plr_real *C, unsigned ldc) {
    for (unsigned j = 0; j < n; j++) {
        const plr_real x[3] = {s * A[j], s * A[lda + j], s * A[2 * lda + j]};
        plr_real y[3];
        plr_mat3_vec(y, Et, x);
        for (unsigned i = 0; i < 3; i++)
            C[i * ldc + j] = y[i];
    }
}

static void put(plr_real *F, const plr_real block[9]) {
    for (unsigned i = 0; i < 3; i++)
        memcpy(F + DIM * i, block + 3 * i, 3 * sizeof *block);
}

/* The rows of F for rho, theta, v, 9 x 15: x+ = F x. Those of the biases are the identity. What is always zero,
 * all of theta but its own columns and the gyro's, and the columns of rho in v, is not filled. */
static void transition(const plr_imu_step *s, plr_real F[MOVED * DIM]) {
    plr_real block[9], skew[9], forward[9], tau = s->tau;
    plr_real *rho = F, *theta = F + THETA * DIM, *vel = F + VEL * DIM;
    put(rho, s->Et);
    put(theta + THETA, s->Et);
    put(vel + VEL, s->Et);
    for (int i = 0; i < 3; i++) /* E^T (tau^2/2 gamma - d)x */
        forward[i] = PLR_FMA(PLR_R(0.5) * tau * tau, s->gamma[i], -s->d[i]);
    plr_skew(skew, forward);
    turn_back(3, s->Et, 1, skew, 3, rho + THETA, DIM);
    plr_skew(skew, s->gamma);
    turn_back(3, s->Et, tau, skew, 3, vel + THETA, DIM);
    for (int i = 0; i < 9; i++)
        block[i] = tau * s->Et[i];
    put(rho + VEL, block);
    turn_back(3, s->Et, -tau * tau, s->G2, 3, rho + ACCEL, DIM);
    turn_back(3, s->Et, -tau, s->G1, 3, vel + ACCEL, DIM);
    for (int i = 0; i < 3; i++) /* -tau Jr, Jr = G1^T */
        for (int j = 0; j < 3; j++)
            theta[DIM * i + GYRO + j] = -tau * s->G1[3 * j + i];
    plr_skew(skew, s->a);
    turn_back(3, s->Et, tau * tau * tau / PLR_R(6), skew, 3, rho + GYRO, DIM);
    turn_back(3, s->Et, PLR_R(0.5) * tau * tau, skew, 3, vel + GYRO, DIM);
    plr_skew(skew, s->v); /* -tau [v+]x Jr */
    for (int i = 0; i < 3; i++)
        plr_gemm_nn(1, 3, 3, skew + 3 * i, 3, theta + GYRO, DIM, vel + DIM * i + GYRO, DIM);
}

/* A column of the derivatives before a step, in axes before it: of the error n its way, and the velocity's. */
typedef struct plr_imu_column {
    plr_real way[3], speed[3];
} plr_imu_column;

static inline void get_column(plr_imu_column *at, const plr_motion *motion, unsigned c) {
    for (unsigned i = 0; i < 3; i++) {
        at->way[i] = motion->B[D * i + c];
        at->speed[i] = motion->core.V[D * i + c];
    }
}

/* The velocity goes on; a body that is turned by this takes gravity for a force. */
static inline void move_column(plr_imu_column *at, const plr_imu_step *s,
                               const plr_real turned[3]) {
    plr_real cross[3];
    plr_cross3(cross, s->gamma, turned);
    for (unsigned i = 0; i < 3; i++) {
        const plr_real v = at->speed[i];
        at->speed[i] = PLR_FMA(s->tau, cross[i], v);
        at->way[i] = PLR_FMA(s->tau, PLR_FMA(PLR_R(0.5) * s->tau, cross[i], v), at->way[i]);
    }
}

static inline void put_column(const plr_imu_column *at, const plr_imu_step *s, plr_motion *motion,
                              unsigned c) {
    for (unsigned i = 0; i < 3; i++) {
        motion->B[D * i + c] = plr_dot3(s->Et + 3 * i, at->way);
        motion->core.V[D * i + c] = plr_dot3(s->Et + 3 * i, at->speed);
    }
}

/* The derivatives of the whole motion by the drivers: B of its error n, V of the velocity. Of n's turn that by the
 * gyro's bias alone is not zero; and the body has been turned by its tilt at the beginning and by that. */
static void accumulate_derivatives(plr_motion *motion, const plr_imu_step *s,
                                   const plr_real F[MOVED * DIM]) {
    plr_real *B = motion->B, *V = motion->core.V, *turn = B + D * THETA + D_GYRO, cross[3];
    plr_imu_column at;
    for (unsigned c = D_VEL; c < D_GYRO; c++) {
        get_column(&at, motion, c);
        for (unsigned i = 0; i < 3; i++)
            at.way[i] = PLR_FMA(s->tau, at.speed[i], at.way[i]);
        put_column(&at, s, motion, c);
    }
    for (unsigned c = 0; c < 3; c++) {
        const plr_real turned[3] = {turn[c], turn[D + c], turn[2 * D + c]};
        plr_real tilted[3];
        for (unsigned i = 0; i < 3; i++) /* R_D^T */
            tilted[i] = motion->E[3 * c + i] + (i == c ? PLR_R(1) : PLR_R(0));
        get_column(&at, motion, D_THETA + c);
        move_column(&at, s, tilted);
        put_column(&at, s, motion, D_THETA + c);
        get_column(&at, motion, D_GYRO + c);
        move_column(&at, s, turned);
        plr_cross3(cross, s->d, turned);
        for (unsigned i = 0; i < 3; i++) {
            at.way[i] -= cross[i];
            turn[D * i + c] = plr_dot3(s->Et + 3 * i, turned) + F[DIM * (THETA + i) + GYRO + c];
        }
        put_column(&at, s, motion, D_GYRO + c);
    }
    for (unsigned i = 0; i < 3; i++)
        for (unsigned c = D_ACCEL; c < D; c++) {
            B[D * i + c] += F[DIM * i + THETA + c];
            V[D * i + c] += F[DIM * (VEL + i) + THETA + c];
        }
}

/* The density of the accelerometer's (0) or the gyro's (1) noise, squared: as stated, or as the readings
 * scatter about their neighbours, if that is more. A vibration that is true motion counts, too: sampled so that
 * neighbours tell little of each other it cannot be integrated. */
static plr_real density_of(const plr_source *source, unsigned which) {
    const plr_real stated = which == 0 ? source->accel_density : source->gyro_density;
    const plr_real shown = source->inertial.scatter2[which] * source->inertial.usual_s;
    return shown > stated ? shown : stated;
}

/* What three numbers of this variance each exceed once in a million. */
#define UNLIKELY PLR_R(30)

/* The densities of a step's noise. A force that accelerates the body by more than its own weight, and by more
 * than scatter does, is a shock: the reading may be wrong by all of that, for as long as any error lasts, and the
 * gyro, which took the same blow, by all that it reads. The force is that of the whole interval: the rest of one
 * that a frame cut makes up for rounded stamps, too. A reading held for longer than usual is wrong by what
 * changes meanwhile: at first as successive readings differ, later as they scatter at all. */
static void densities(const plr_belief *belief, const plr_source *source,
                      const plr_process_step *by, const plr_real gamma[3], plr_real density[2]) {
    const plr_inertial *at = &source->inertial;
    const plr_real g = source->gravity, scatter2 = UNLIKELY * at->scatter2[0];
    plr_real forced[3], turned[3];
    for (unsigned i = 0; i < 2; i++)
        density[i] = density_of(source, i);
    for (int i = 0; i < 3; i++) {
        forced[i] = by->whole[i] - belief->bias[i] + gamma[i];
        turned[i] = by->whole[3 + i] - belief->bias[3 + i];
    }
    const plr_real beyond2 = plr_dot3(forced, forced) - (scatter2 > g * g ? scatter2 : g * g);
    if (beyond2 > 0) {
        density[0] = PLR_FMA(LASTING_S, beyond2, density[0]);
        density[1] = PLR_FMA(LASTING_S, plr_dot3(turned, turned), density[1]);
    }
    if (!(at->usual_s > 0) || by->interval <= PLR_LONG_INTERVALS * at->usual_s)
        return;
    const plr_real intervals = by->interval / at->usual_s;
    const plr_real lasting = by->interval < LASTING_S ? by->interval : LASTING_S;
    for (int i = 0; i < 2; i++) {
        const plr_real changed = at->change2[i] * intervals * intervals;
        const plr_real most = at->spread2[i] + at->change2[i];
        density[i] = PLR_FMA(changed < most ? changed : most, lasting, density[i]);
    }
}

static void move_noise(const plr_belief *belief, plr_motion *motion, const plr_source *source,
                       const plr_imu_step *s, const plr_real F[MOVED * DIM],
                       const plr_process_step *by) {
    const plr_real tau = s->tau;
    plr_real reading[2];
    densities(belief, source, by, s->gamma, reading);
    reading[0] /= tau;
    reading[1] /= tau;
    plr_imu_carry_noise(motion, F, reading);
    for (unsigned i = ACCEL - VEL; i < PLR_REST_DIM; i++) {
        plr_real *q = &motion->core.Q_cc[(PLR_REST_DIM + 1) * i];
        *q = PLR_FMA(i < GYRO - VEL ? source->accel_walk_variance : source->gyro_walk_variance, tau,
                     *q);
    }
}

static void step(plr_belief *belief, plr_motion *motion, plr_source *source, plr_time_ns t_ns,
                 const plr_process_step *by) {
    const plr_real seconds = by->seconds;
    plr_imu_step s;
    plr_real F[MOVED * DIM];
    integrate(belief, source, by->mean, seconds, &s);
    transition(&s, F);
    accumulate_derivatives(motion, &s, F);
    move_noise(belief, motion, source, &s, F, by);
    plr_pose_move(belief, s.E, s.d);
    memcpy(belief->velocity, s.v, sizeof s.v);
    plr_se3_append(motion->E, motion->p, s.E, s.d);
    plr_so3_orthonormalise_small(motion->E);
    belief->t_ns = t_ns;
    motion->seconds += seconds;
    motion->pending = 1;
    motion->noisy = 1;
}

/* ---------------------------------------------------------------- readings */

static void mean(const plr_belief *belief, const plr_source *source, plr_time_ns t_ns,
                 const plr_real reading[PLR_READING_DIM], plr_process_step *step) {
    const bool makes_up = step->interval <= BRIDGED_S;
    plr_mean_reading(belief, source, source->timing, makes_up, t_ns, reading, step);
}

static plr_real bias_walk(const plr_source *source, unsigned k) {
    return k < 3 ? source->accel_walk_variance : source->gyro_walk_variance;
}

static void rest(const plr_belief *belief, const plr_source *source,
                 plr_real reading[PLR_READING_DIM]) {
    plr_real gamma[3];
    gravity(belief, source, gamma);
    for (int i = 0; i < 3; i++) {
        reading[i] = belief->bias[i] - gamma[i];
        reading[3 + i] = belief->bias[3 + i];
    }
}

static void hold(const plr_belief *belief, const plr_source *source, plr_real age,
                 plr_real held[PLR_READING_DIM]) {
    if (age > STALE_S)
        rest(belief, source, held);
    else
        memcpy(held, source->reading, PLR_READING_DIM * sizeof *held);
}

/* ---------------------------------------------------------------- the estimate */

static PLR_SELDOM void bias_covariance(const plr_belief *belief, const plr_motion *motion,
                                       const plr_source *source, plr_real P_b[PLR_POSE_SQUARE]) {
    (void)source;
    const plr_real *Q = motion->core.Q_cc;
    plr_covariance_get(belief, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, P_b);
    for (unsigned i = 0; i < PLR_BIAS_DIM; i++)
        for (unsigned j = 0; j < PLR_BIAS_DIM; j++)
            P_b[PLR_BIAS_DIM * i + j] +=
                Q[PLR_REST_DIM * (PLR_VELOCITY_DIM + i) + PLR_VELOCITY_DIM + j];
}

/* v with its covariance now, and w = w_m - b_g, correlated by the gyro's bias. */
static PLR_SELDOM void now(const plr_belief *belief, const plr_motion *motion,
                           const plr_source *source, plr_real u[PLR_POSE_DIM],
                           plr_real P_u[PLR_POSE_SQUARE]) {
    enum { V = PLR_VELOCITY_DIM };
    const plr_core_motion *m = &motion->core;
    plr_real P_dd[D * D], VP[V * D] = {0}, P_vv[V * V] = {0}, P_b[PLR_POSE_SQUARE];
    for (unsigned i = 0; i < V; i++) {
        u[i] = belief->velocity[i];
        u[V + i] = source->reading[V + i] - belief->bias[V + i];
    }
    if (!P_u)
        return;
    plr_covariance_with_drivers(belief, belief->layout.driver, D, P_dd);
    plr_gemm_nn(V, D, D, m->V, D, P_dd, D, VP, D);
    plr_gemm_nt(V, V, D, VP, D, m->V, D, P_vv, V);
    bias_covariance(belief, motion, source, P_b);
    const plr_real density = density_of(source, 1), usual = source->inertial.usual_s;
    const plr_real per_reading = usual > 0 ? density / usual : density;
    for (unsigned i = 0; i < V; i++)
        for (unsigned j = 0; j < V; j++) {
            P_u[PLR_POSE_DIM * i + j] = P_vv[V * i + j] + m->Q_cc[PLR_REST_DIM * i + j];
            P_u[PLR_POSE_DIM * i + V + j] = P_u[PLR_POSE_DIM * (V + j) + i] =
                -VP[D * i + D_GYRO + j] - m->Q_cc[PLR_REST_DIM * i + PLR_POSE_DIM + j];
            P_u[PLR_POSE_DIM * (V + i) + V + j] =
                P_b[PLR_POSE_DIM * (V + i) + V + j] + (i == j ? per_reading : PLR_R(0));
        }
}

/* a + gamma - w x v */
static void changes(const plr_belief *belief, const plr_source *source,
                    const plr_real u[PLR_POSE_DIM], plr_real change[3]) {
    plr_real turning[3];
    plr_cross3(turning, u + 3, u);
    gravity(belief, source, change);
    for (int i = 0; i < 3; i++)
        change[i] += source->reading[i] - belief->bias[i] - turning[i];
}

/* The noise of the rate at a standstill is in theta too, where v = 0 finds it again: as if it were
 * independent, the gyro's bias would be believed too much. */
#define USED_TWICE PLR_R(2)

/* A measurement of the twist is one of the state: v is estimated, and w = w_m - b_g, whose noise
 * adds to it. A row of v and w together (a wheel) takes the last reading, for both change; a row of
 * w alone (a standstill) the mean since the last one, which has less noise. */
static PLR_SELDOM void measure(const plr_belief *belief, const plr_source *source,
                               const plr_twist_rows *rows, plr_rows *H, plr_real r[PLR_ROWS],
                               plr_real R[PLR_ROWS]) {
    const plr_real since = plr_seconds(belief->t_ns - source->inertial.still_ns);
    const plr_real most = since < PLR_R(0.5) ? since : PLR_R(0.5);
    const plr_real usual = source->inertial.usual_s > 0 ? source->inertial.usual_s : PLR_R(1e-3);
    const plr_real density = density_of(source, 1);
    /* at the time of the last such row the mean is used up: one reading's worth is granted */
    const plr_real mean_of = most > 0 ? most : usual;
    memset(H, 0, sizeof *H);
    plr_real *by_v = plr_rows_add(H, plr_row_of(belief, PLR_BLOCK_VELOCITY), PLR_VELOCITY_DIM);
    plr_real *by_bias = plr_rows_add(H, plr_row_of(belief, PLR_BLOCK_BIAS), PLR_BIAS_DIM);
    for (unsigned i = 0; i < PLR_ROWS; i++) {
        const plr_real *M = rows->M + PLR_POSE_DIM * i;
        const bool moves = plr_dot3(M, M) > 0;
        const plr_real *w_m = moves ? source->reading + 3 : source->inertial.slow + 3;
        const plr_real noise = moves ? density / usual : USED_TWICE * density / mean_of;
        r[i] = rows->z[i];
        R[i] = PLR_FMA(noise, plr_dot3(M + 3, M + 3), rows->R[i]);
        for (unsigned c = 0; c < 3; c++) {
            const plr_real w = w_m[c] - belief->bias[3 + c];
            r[i] = PLR_FMA(-M[c], belief->velocity[c], r[i]);
            r[i] = PLR_FMA(-M[3 + c], w, r[i]);
            by_v[PLR_VELOCITY_DIM * i + c] = M[c];
            by_bias[PLR_BIAS_DIM * i + 3 + c] = -M[3 + c];
        }
    }
}

const plr_process plr_process_imu = {
    .lay_out = lay_out,
    .check = check,
    .step = step,
    .mean = mean,
    .hold = hold,
    .rest = rest,
    .bias_walk = bias_walk,
    .now = now,
    .changes = changes,
    .bias_covariance = bias_covariance,
    .measure = measure,
};
