// SPDX-License-Identifier: MIT
/* The process `imu` (docs/MATH.md 19): pose, velocity and what a stretch of readings makes of their
 * errors, against an integrator by Runge and Kutta and its central differences, in double. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "pelorus/filter.h"
#include "process/process.h"
#include "support/held_step.h"
#include "support/matrices.h"
#include "support/pose_of.h"
#include "support/reseal.h"
#include "support/rigid.h"
#include "support/scene.h"

enum { READINGS = 40, DRIVER = PLR_DRIVERS, ERROR = 9 /* (n, v) */, CORE = PLR_CORE_DIM };
enum { SUBSTEPS = 8 };

static const double eps = REAL_EPSILON;
static const double tau = 0.0025, gravity = 9.7;
static const double accel_noise = 0.02, gyro_noise = 0.003, accel_walk = 0.004, gyro_walk = 5e-4;

/* What drives a body: where it is at the start, its biases and readings. */
typedef struct flight {
    double T[16], v[3]; /* pose; velocity in body axes */
    double bias[6];
    double walk[READINGS][6]; /* what the biases gain after each reading */
    double reading[READINGS][6];
} flight;

static plr_filter filter;
static flight real;
static rng chance;

static void round_all(flight *x) {
    round_to_real(x->v, 3);
    round_to_real(x->bias, 6);
    round_to_real(x->reading[0], 6 * READINGS);
}

/* A body that turns at a rad/s and is pushed about by some g. */
void setUp(void) {
    static const double variance[6] = {1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6};
    plr_config config;
    plr_calibration calibration;
    plr_pose pose;
    chance = rng_seeded(211);
    plr_config_default(&config);
    scene_calibration(&calibration);
    config.process = PLR_PROCESS_IMU;
    config.gravity_mps2 = gravity;
    config.accel_noise = accel_noise;
    config.gyro_noise = gyro_noise;
    config.accel_walk = accel_walk;
    config.gyro_walk = gyro_walk;
    memset(&real, 0, sizeof real);
    random_rotation(&chance, pose.R);
    rng_normals(&chance, 3, pose.p, 3);
    rng_normals(&chance, 2, real.v, 3);
    rng_normals(&chance, 0.1, real.bias, 3);
    rng_normals(&chance, 0.02, real.bias + 3, 3);
    for (unsigned k = 0; k < READINGS; k++)
        for (unsigned i = 0; i < 6; i++)
            real.reading[k][i] =
                i < 3 ? 6 * sin(0.3 * k + i) + (i == 2 ? 9.7 : 0) : cos(0.2 * k + 0.7 * i);
    round_all(&real);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &calibration, &config, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_bias(&filter, real.bias, variance));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&filter, 1000000000, &pose, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(&filter, real.v, variance));
    pose = pose_of(&filter);
    rigid_from_pose(real.T, &pose); /* as the filter has rounded it */
    rigid_clean(real.T);
}

/* ---------------------------------------------------------------- the oracle */

/* dR = R [w]x, dp = v, dv = R a + g, all in the world: R, p, v are 15 numbers. */
static void rates(const double x[15], const double reading[6], double d[15]) {
    const double *a = reading, *w = reading + 3;
    const double W[9] = {0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0};
    for (int i = 0; i < 3; i++) {
        d[9 + i] = x[12 + i];
        d[12 + i] = i == 2 ? -gravity : 0;
        for (int j = 0; j < 3; j++) {
            d[3 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                d[3 * i + j] += x[3 * i + k] * W[3 * k + j];
            d[12 + i] += x[3 * i + j] * a[j];
        }
    }
}

static void shifted(const double x[15], const double d[15], double h, double y[15]) {
    for (int i = 0; i < 15; i++)
        y[i] = x[i] + h * d[i];
}

static void runge_kutta(double x[15], const double reading[6], double h) {
    double k1[15], k2[15], k3[15], k4[15], y[15];
    rates(x, reading, k1);
    shifted(x, k1, h / 2, y);
    rates(y, reading, k2);
    shifted(x, k2, h / 2, y);
    rates(y, reading, k3);
    shifted(x, k3, h, y);
    rates(y, reading, k4);
    for (int i = 0; i < 15; i++)
        x[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
}

/* T and v in body axes after the readings. */
static void integrate(const flight *f, double T[16], double v[3]) {
    double x[15], bias[6];
    memcpy(bias, f->bias, sizeof bias);
    for (int i = 0; i < 3; i++) {
        x[9 + i] = f->T[4 * i + 3];
        x[12 + i] = 0;
        for (int j = 0; j < 3; j++) {
            x[3 * i + j] = f->T[4 * i + j];
            x[12 + i] += f->T[4 * i + j] * f->v[j];
        }
    }
    for (unsigned k = 0; k < READINGS; k++) {
        double reading[6];
        for (int i = 0; i < 6; i++)
            reading[i] = f->reading[k][i] - bias[i];
        for (unsigned s = 0; s < SUBSTEPS; s++)
            runge_kutta(x, reading, tau / SUBSTEPS);
        for (int i = 0; i < 6; i++)
            bias[i] += f->walk[k][i];
    }
    for (int i = 0; i < 16; i++)
        T[i] = i == 15;
    for (int i = 0; i < 3; i++) {
        T[4 * i + 3] = x[9 + i];
        v[i] = 0;
        for (int j = 0; j < 3; j++) {
            T[4 * i + j] = x[3 * i + j];
            v[i] += x[3 * j + i] * x[12 + j];
        }
    }
    rigid_clean(T);
}

/* The relative motion T0^-1 T and the velocity of a flight. */
static void outcome(const flight *f, double D[16], double v[3]) {
    double T[16], back[16];
    integrate(f, T, v);
    rigid_inverse(back, f->T);
    square_multiply(4, back, T, D);
}

/* (n, dv) of one flight against another: D = D' Exp(n). */
static void difference(const flight *a, const flight *b, double e[ERROR]) {
    double A[16], B[16], back[16], off[16], va[3], vb[3];
    outcome(a, A, va);
    outcome(b, B, vb);
    rigid_inverse(back, A);
    square_multiply(4, back, B, off);
    rigid_log(e, off);
    for (int i = 0; i < 3; i++)
        e[6 + i] = vb[i] - va[i];
}

/* Central differences by any number of a flight. */
static void derivative(double *number, double h, double column[ERROR]) {
    const double keep = *number;
    const flight before = real;
    double ahead[ERROR], behind[ERROR];
    flight other = before;
    *number = keep + h;
    other = real;
    difference(&before, &other, ahead);
    *number = keep - h;
    other = real;
    difference(&before, &other, behind);
    *number = keep;
    for (int i = 0; i < ERROR; i++)
        column[i] = (ahead[i] - behind[i]) / (2 * h);
}

/* The same by a turn of the pose about axis i of the body. */
static void derivative_by_turn(int i, double h, double column[ERROR]) {
    const flight before = real;
    flight other = real;
    double sides[2][ERROR];
    for (int side = 0; side < 2; side++) {
        double xi[6] = {0}, E[16];
        xi[3 + i] = side ? -h : h;
        rigid_exp(E, xi);
        square_multiply(4, before.T, E, other.T);
        difference(&before, &other, sides[side]);
    }
    for (int k = 0; k < ERROR; k++)
        column[k] = (sides[0][k] - sides[1][k]) / (2 * h);
}

/* ---------------------------------------------------------------- the filter */

static void step_all(void) {
    for (unsigned k = 0; k < READINGS; k++) {
        plr_real reading[6];
        to_reals(reading, real.reading[k], 6);
        held_step(&plr_process_imu, &filter, filter.belief.t_ns + 2500000, reading, (plr_real)tau,
                  (plr_real)tau);
    }
    reseal(&filter);
}

static void test_pose_and_velocity_are_those_of_an_integrator(void) {
    plr_twist twist;
    double T[16], v[3], got[16];
    step_all();
    integrate(&real, T, v);
    const plr_pose pose = pose_of(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity(&filter, &twist));
    rigid_from_pose(got, &pose);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 + 40 * eps, 0, largest_difference(T, got, 16));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 + 40 * eps, 0, largest_difference(v, twist.v_B_mps, 3));
}

static void test_the_accumulated_motion_is_what_moved_the_pose(void) {
    double D[16], v[3], got[16] = {0};
    step_all();
    outcome(&real, D, v);
    for (int i = 0; i < 3; i++) {
        got[4 * i + 3] = (double)filter.motion.p[i];
        for (int j = 0; j < 3; j++)
            got[4 * i + j] = (double)filter.motion.E[3 * i + j] + (i == j);
    }
    got[15] = 1;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 + 20 * eps, 0, largest_difference(D, got, 16));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, READINGS * tau, (double)filter.motion.seconds);
}

/* A 3x3 block of the derivatives, against its own largest entry. */
static void demand_block(const double *expected, const double *got, double tolerance,
                         const char *at) {
    double most = 0, gap = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            most = fmax(most, fabs(expected[DRIVER * i + j]));
            gap = fmax(gap, fabs(expected[DRIVER * i + j] - got[DRIVER * i + j]));
        }
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(tolerance * most + 1e-10, 0, gap, at);
}

/* By the gyro's bias two terms are of first order in the angle of a step (docs/MATH.md 19). */
static void test_derivatives_by_tilt_velocity_and_biases_are_those_of_the_motion(void) {
    static const char *const rows[3] = {"rho", "theta", "v"};
    static const char *const columns[4] = {"theta", "v", "b_a", "b_g"};
    double expected[ERROR * DRIVER], got[ERROR * DRIVER], column[ERROR];
    for (int c = 0; c < DRIVER; c++) {
        if (c < 3)
            derivative_by_turn(c, 1e-4, column);
        else
            derivative(c < 6 ? &real.v[c - 3] : &real.bias[c - 6], 1e-4, column);
        for (int r = 0; r < ERROR; r++)
            expected[DRIVER * r + c] = column[r];
    }
    step_all();
    to_doubles(got, filter.motion.B, 6 * DRIVER);
    to_doubles(got + 6 * DRIVER, filter.motion.core.V, 3 * DRIVER);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 4; c++) {
            char at[32];
            snprintf(at, sizeof at, "%s by %s", rows[r], columns[c]);
            demand_block(expected + DRIVER * 3 * r + 3 * c, got + DRIVER * 3 * r + 3 * c,
                         (c == 3 ? 2e-5 : 5e-8) + 30 * eps, at);
        }
}

static void test_a_shift_and_a_turn_about_the_vertical_drive_nothing(void) {
    const double up[3] = {(double)filter.belief.R_WB[6], (double)filter.belief.R_WB[7],
                          (double)filter.belief.R_WB[8]};
    step_all();
    for (int r = 0; r < ERROR; r++) {
        const plr_real *row =
            r < 6 ? filter.motion.B + DRIVER * r : filter.motion.core.V + DRIVER * (r - 6);
        double sum = 0, size = 1e-3;
        for (int i = 0; i < 3; i++) {
            sum += (double)row[i] * up[i];
            size = fmax(size, fabs((double)row[i]));
        }
        TEST_ASSERT_DOUBLE_WITHIN(20 * eps * size, 0, sum);
    }
}

/* ---------------------------------------------------------------- noise */

/* Q += s^2 c c^T, 15 x 15 in the order (n, v, b). */
static void add_square(double *Q, const double c[CORE], double sigma) {
    for (int i = 0; i < CORE; i++)
        for (int j = 0; j < CORE; j++)
            Q[CORE * i + j] += sigma * sigma * c[i] * c[j];
}

/* Each reading's noise is one by itself, and the biases walk after each. */
static void noise_of_all(double *Q) {
    memset(Q, 0, CORE * CORE * sizeof *Q);
    for (unsigned k = 0; k < READINGS; k++)
        for (int i = 0; i < 6; i++) {
            double c[CORE] = {0};
            derivative(&real.reading[k][i], 1e-3, c);
            add_square(Q, c, (i < 3 ? accel_noise : gyro_noise) / sqrt(tau));
            derivative(&real.walk[k][i], 1e-3, c);
            c[ERROR + i] = 1;
            add_square(Q, c, (i < 3 ? accel_walk : gyro_walk) * sqrt(tau));
        }
}

static double filters_noise(int i, int j) {
    if (i > j)
        return filters_noise(j, i);
    if (j < 6)
        return (double)filter.motion.Q[6 * i + j];
    if (i < 6)
        return (double)filter.motion.core.Q_nc[PLR_REST_DIM * i + j - 6];
    return (double)filter.motion.core.Q_cc[PLR_REST_DIM * (i - 6) + j - 6];
}

/* The specific force that the body feels where it is, and a push that is less than its weight. */
static void push_gently(void) {
    for (unsigned k = 0; k < READINGS; k++)
        for (int i = 0; i < 3; i++)
            real.reading[k][i] = gravity * real.T[8 + i] + real.bias[i] + 3 * sin(0.3 * k + i);
    round_all(&real);
}

static void test_noise_is_that_of_each_reading_and_of_the_walks(void) {
    double Q[CORE * CORE];
    push_gently();
    noise_of_all(Q);
    step_all();
    for (int i = 0; i < CORE; i++)
        for (int j = 0; j < CORE; j++) {
            char at[32];
            snprintf(at, sizeof at, "(%d, %d)", i, j);
            const double size = sqrt(Q[(CORE + 1) * i] * Q[(CORE + 1) * j]);
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE((3e-5 + 100 * eps) * size, Q[CORE * i + j],
                                              filters_noise(i, j), at);
        }
}

/* A step of this acceleration along the body's x: what its noise adds to the velocity's variance, as a density
 * of the readings'. */
static double density_of_a_step(double mps2) {
    static plr_filter once;
    plr_real reading[6];
    once = filter;
    memset(once.belief.velocity, 0, sizeof once.belief.velocity); /* what a turn adds */
    double force[6] = {mps2, 0, 0};
    for (int i = 0; i < 3; i++) {
        force[i] += gravity * real.T[8 + i] + real.bias[i];
        force[3 + i] = real.bias[3 + i];
    }
    to_reals(reading, force, 6);
    held_step(&plr_process_imu, &once, once.belief.t_ns + 2500000, reading, PLR_R(0.0025),
              PLR_R(0.0025));
    return (double)once.motion.core.Q_cc[0] / tau;
}

static void test_a_force_of_more_than_the_bodys_weight_is_a_shock_and_not_believed(void) {
    const double stated = accel_noise * accel_noise;
    TEST_ASSERT_DOUBLE_WITHIN(1e-2 * stated, stated, density_of_a_step(0.9 * gravity));
    const double due = stated + 0.5 * (23.0 * 23.0 - gravity * gravity);
    TEST_ASSERT_DOUBLE_WITHIN(2e-3 * due, due, density_of_a_step(23));
    filter.source.inertial.scatter2[0] =
        PLR_R(40); /* a body that is shaken: 30 times that is more than 23^2 */
    filter.source.inertial.usual_s = PLR_R(0.0025);
    const double shaken = 40 * 0.0025;
    TEST_ASSERT_DOUBLE_WITHIN(2e-3 * shaken, shaken, density_of_a_step(23));
}

static void test_noise_is_symmetric_to_the_bit(void) {
    step_all();
    TEST_ASSERT_TRUE(is_symmetric(filter.motion.Q, 6));
    TEST_ASSERT_TRUE(is_symmetric(filter.motion.core.Q_cc, PLR_REST_DIM));
}

static void test_parts_of_an_interval_add_up_to_the_whole(void) {
    static plr_filter whole;
    plr_real reading[6];
    to_reals(reading, real.reading[0], 6);
    whole = filter;
    held_step(&plr_process_imu, &whole, whole.belief.t_ns + 4000000, reading, PLR_R(0.004),
              PLR_R(0.004));
    held_step(&plr_process_imu, &filter, filter.belief.t_ns + 1000000, reading, PLR_R(0.001),
              PLR_R(0.004));
    held_step(&plr_process_imu, &filter, filter.belief.t_ns + 3000000, reading, PLR_R(0.003),
              PLR_R(0.004));
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-9 + 10 * eps, whole.belief.p_WB[i], filter.belief.p_WB[i]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9 + 10 * eps, (double)whole.belief.velocity[i],
                                  (double)filter.belief.velocity[i]);
    }
    for (int i = 3; i < 6; i++) { /* the rate's noise, and with it the turn's */
        const double once = (double)whole.motion.Q[7 * i];
        TEST_ASSERT_DOUBLE_WITHIN(1e-4 * once, once, (double)filter.motion.Q[7 * i]);
    }
}
