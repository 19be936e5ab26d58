// SPDX-License-Identifier: MIT
/* SE(3) against 4x4 matrices, power series and finite differences in double. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "math/se3.h"
#include "support/matrices.h"
#include "support/random.h"
#include "support/rigid.h"

enum { RUNS = 400 };

static const double eps = REAL_EPSILON;
static const double pi = 3.14159265358979323846;

/* A motion in the filter's precision and its 4x4 twin in double. */
typedef struct motion {
    plr_real R[9], p[3];
    double M[16];
} motion;

/* The 4x4 matrix of (R, p). */
static void to_matrix(double M[16], const plr_real R[9], const plr_real p[3]) {
    memset(M, 0, 16 * sizeof *M);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            M[4 * i + j] = (double)R[3 * i + j];
        M[4 * i + 3] = (double)p[i];
    }
    M[15] = 1;
}

static motion random_motion(rng *r) {
    motion m;
    double R[9], p[3];
    random_rotation(r, R);
    rng_normals(r, 3, p, 3);
    to_reals(m.R, R, 9);
    to_reals(m.p, p, 3);
    to_matrix(m.M, m.R, m.p);
    return m;
}

/* A tangent vector with |theta| = angle and |rho| about 2 m, rounded, and in both precisions. */
static void random_tangent(rng *r, double angle, double twin[6], plr_real xi[6]) {
    rng_normals(r, 1, twin, 3);
    random_direction(r, angle, twin + 3, 3);
    round_to_real(twin, 6);
    to_reals(xi, twin, 6);
}

/* Angles from 0 to pi, and every second run a tiny one. */
static double angle_of(int run) {
    return run % 2 == 0 ? pi * run / RUNS : pow(10, -12.0 * run / RUNS);
}

static void test_exp_agrees_with_the_matrix_exponential(void) {
    rng r = rng_seeded(61);
    for (int run = 0; run < RUNS; run++) {
        double twin[6], expected[16], got[16];
        plr_real xi[6], R[9], p[3];
        random_tangent(&r, angle_of(run), twin, xi);
        rigid_exp(expected, twin);
        plr_se3_exp(R, p, xi);
        to_matrix(got, R, p);
        TEST_ASSERT_DOUBLE_WITHIN(20 * eps, 0, largest_difference(expected, got, 16));
    }
}

/* T [xi]^ T^-1 = [Ad(T) xi]^, column by column: rigid_vee reads [xi]^ off a matrix. */
static void test_adjoint_carries_tangents_through_a_motion(void) {
    rng r = rng_seeded(62);
    for (int run = 0; run < RUNS; run++) {
        const motion m = random_motion(&r);
        plr_real Ad[36];
        plr_se3_adjoint(Ad, m.R, m.p);
        double inverse[16];
        rigid_inverse(inverse, m.M);
        for (int j = 0; j < 6; j++) {
            double e[6] = {0}, hat[16] = {0}, left[16], both[16], column[6];
            e[j] = 1;
            rigid_exp(hat, e);
            square_multiply(4, m.M, hat, left);
            square_multiply(4, left, inverse, both);
            for (int i = 0; i < 6; i++)
                column[i] = (double)Ad[6 * i + j];
            rigid_exp(hat, column);
            TEST_ASSERT_DOUBLE_WITHIN(300 * eps, 0, largest_difference(hat, both, 16));
        }
    }
}

static void test_adjoint_inverse_undoes_the_adjoint(void) {
    rng r = rng_seeded(63);
    double identity[36] = {0};
    for (int i = 0; i < 6; i++)
        identity[7 * i] = 1;
    for (int run = 0; run < RUNS; run++) {
        const motion m = random_motion(&r);
        plr_real Ad[36], Ad_inverse[36];
        double a[36], b[36], product[36];
        plr_se3_adjoint(Ad, m.R, m.p);
        plr_se3_adjoint_inverse(Ad_inverse, m.R, m.p);
        to_doubles(a, Ad, 36);
        to_doubles(b, Ad_inverse, 36);
        square_multiply(6, a, b, product);
        TEST_ASSERT_DOUBLE_WITHIN(200 * eps, 0, largest_difference(identity, product, 36));
    }
}

static void test_right_jacobian_agrees_with_its_series(void) {
    rng r = rng_seeded(64);
    for (int run = 0; run < RUNS; run++) {
        double twin[6], expected[36], got[36];
        plr_real xi[6], Jr[36];
        random_tangent(&r, angle_of(run), twin, xi);
        rigid_right_jacobian(expected, twin);
        plr_se3_right_jacobian(Jr, xi);
        to_doubles(got, Jr, 36);
        char message[40];
        snprintf(message, sizeof message, "|theta| = %g", angle_of(run));
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(60 * eps, 0, largest_difference(expected, got, 36),
                                          message);
    }
}

/* Column j of Jr by a central difference: (Exp(-xi) Exp(xi + h e_j))^v / h. */
static void jacobian_column(const double xi[6], int j, double column[6]) {
    const double h = 1e-5;
    double here[16], inverse[16], ends[2][6];
    rigid_exp(here, xi);
    rigid_inverse(inverse, here);
    for (int end = 0; end < 2; end++) {
        double moved[6], there[16], between[16];
        memcpy(moved, xi, sizeof moved);
        moved[j] += end == 0 ? h : -h;
        rigid_exp(there, moved);
        square_multiply(4, inverse, there, between);
        rigid_vee(ends[end], between);
    }
    for (int i = 0; i < 6; i++)
        column[i] = (ends[0][i] - ends[1][i]) / (2 * h);
}

static void test_right_jacobian_agrees_with_differences(void) {
    rng r = rng_seeded(65);
    for (int run = 0; run < RUNS; run++) {
        double twin[6], column[6];
        plr_real xi[6], Jr[36];
        random_tangent(&r, angle_of(run), twin, xi);
        plr_se3_right_jacobian(Jr, xi);
        for (int j = 0; j < 6; j++) {
            jacobian_column(twin, j, column);
            for (int i = 0; i < 6; i++)
                TEST_ASSERT_DOUBLE_WITHIN(1e-8 + 60 * eps, column[i], (double)Jr[6 * i + j]);
        }
    }
}

/* E = R - I */
static void less_identity(plr_real E[9], const plr_real R[9]) {
    for (int i = 0; i < 9; i++)
        E[i] = R[i] - (i % 4 == 0 ? PLR_R(1) : PLR_R(0));
}

static void test_append_multiplies_motions(void) {
    rng r = rng_seeded(66);
    for (int run = 0; run < RUNS; run++) {
        motion a = random_motion(&r);
        const motion b = random_motion(&r);
        double expected[16], got[16];
        square_multiply(4, a.M, b.M, expected);
        plr_real E[9], dE[9];
        less_identity(E, a.R);
        less_identity(dE, b.R);
        plr_se3_append(E, a.p, dE, b.p);
        plr_se3_rotation(a.R, E);
        to_matrix(got, a.R, a.p);
        TEST_ASSERT_DOUBLE_WITHIN(60 * eps, 0, largest_difference(expected, got, 16));
    }
}

/* Exp(xi) - I as its small numbers: theta rho / 2 and the like are right to their own size. */
static void test_a_small_exponential_is_right_to_its_own_size(void) {
    rng r = rng_seeded(68);
    for (int run = 0; run < RUNS; run++) {
        double twin[6];
        plr_real xi[6], E[9], p[3];
        random_tangent(&r, pow(10, -3 - 9.0 * run / RUNS), twin, xi);
        plr_se3_expm1(E, p, xi);
        const double t[3] = {twin[3], twin[4], twin[5]};
        const double size2 = t[0] * t[0] + t[1] * t[1] + t[2] * t[2], size = sqrt(size2);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) { /* [t]x + [t]x^2 / 2, the next term is |t|^3 / 6 */
                const double skew = i == j                 ? 0
                                    : (j - i + 3) % 3 == 1 ? -t[3 - i - j]
                                                           : t[3 - i - j];
                const double expected = skew + (t[i] * t[j] - (i == j ? size2 : 0)) / 2;
                TEST_ASSERT_DOUBLE_WITHIN(8 * eps * size + size2 * size, expected,
                                          (double)E[3 * i + j]);
            }
    }
}

/* Ten thousand steps of a micrometre and a microradian: what each adds is not rounded at the size of 1. */
static void test_small_motions_add_up(void) {
    const double xi[6] = {1e-6, -2e-6, 3e-6, 2e-6, -1e-6, 3e-6};
    plr_real xi_real[6], E[9] = {0}, p[3] = {0}, dE[9], dp[3], R[9];
    double all[6], expected[16], got[16];
    to_reals(xi_real, xi, 6);
    plr_se3_expm1(dE, dp, xi_real);
    for (int k = 0; k < 10000; k++)
        plr_se3_append(E, p, dE, dp);
    for (int i = 0; i < 6; i++)
        all[i] = 10000 * (double)xi_real[i];
    rigid_exp(expected, all);
    plr_se3_rotation(R, E);
    to_matrix(got, R, p);
    TEST_ASSERT_DOUBLE_WITHIN(30 * eps, 0, largest_difference(expected, got, 16));
}

/* A point that a small motion moves is rounded once: there and back it is within one rounding. */
static void test_moving_back_undoes_the_motion(void) {
    rng r = rng_seeded(69);
    for (int run = 0; run < RUNS; run++) {
        double twin[6], M[16], exact[3], expected[3];
        plr_real xi[6], E[9], p[3], x[3];
        random_tangent(&r, angle_of(run), twin, xi);
        rigid_exp(M, twin);
        plr_se3_expm1(E, p, xi);
        rng_normals(&r, 5, exact, 3);
        to_reals(x, exact, 3);
        to_doubles(exact, x, 3);
        for (int i = 0; i < 3; i++) {
            expected[i] = 0;
            for (int j = 0; j < 3; j++)
                expected[i] += M[4 * j + i] * (exact[j] - M[4 * j + 3]);
        }
        plr_se3_move_back(x, E, p);
        for (int i = 0; i < 3; i++)
            TEST_ASSERT_DOUBLE_WITHIN(100 * eps, expected[i], (double)x[i]);
    }
    const plr_real none[9] = {0};
    plr_real x[3] = {PLR_R(3.1), PLR_R(-0.7), PLR_R(12.3)};
    const plr_real before[3] = {x[0], x[1], x[2]};
    plr_se3_move_back(x, none, none);
    TEST_ASSERT_TRUE(same_bits(before, x, 3));
}

static void test_inverse_point_undoes_the_motion(void) {
    rng r = rng_seeded(67);
    for (int run = 0; run < RUNS; run++) {
        const motion m = random_motion(&r);
        double x[3], moved[3];
        rng_normals(&r, 5, x, 3);
        for (int i = 0; i < 3; i++)
            moved[i] =
                m.M[4 * i] * x[0] + m.M[4 * i + 1] * x[1] + m.M[4 * i + 2] * x[2] + m.M[4 * i + 3];
        plr_real input[3], output[3];
        double back[3];
        to_reals(input, moved, 3);
        plr_se3_inverse_point(output, m.R, m.p, input);
        to_doubles(back, output, 3);
        TEST_ASSERT_DOUBLE_WITHIN(200 * eps, 0, largest_difference(x, back, 3));
    }
}
