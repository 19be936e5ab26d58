// SPDX-License-Identifier: MIT
/* The stereo camera against its equations in double (III.1 to III.3) and against differences. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "sensor/stereo.h"
#include "state/camera.h"
#include "support/matrices.h"
#include "support/random.h"

enum { RUNS = 500 };

static plr_camera camera;
static rng chance;

void setUp(void) {
    chance = rng_seeded(41);
    double R[9];
    random_rotation(&chance, R);
    camera = (plr_camera){PLR_R(718.5),
                          PLR_R(702.25),
                          PLR_R(607.25),
                          PLR_R(185.5),
                          PLR_R(0.5),
                          {0},
                          {PLR_R(0.3), PLR_R(-0.1), PLR_R(1.2)}};
    to_reals(camera.R_CB, R, 9);
}

/* A point in view, z_m away; as the filter stores it. */
static void random_point(double z_m, plr_real q[3], double exact[3]) {
    exact[0] = z_m * rng_uniform(&chance, -0.8, 0.8);
    exact[1] = z_m * rng_uniform(&chance, -0.3, 0.3);
    exact[2] = z_m;
    to_reals(q, exact, 3);
    to_doubles(exact, q, 3);
}

static double random_depth(void) {
    return exp(rng_uniform(&chance, log(0.5), log(3000)));
}

/* (uL, uR, v) in double. */
static void project(const double q[3], double z[3]) {
    const double fx = (double)camera.fx, fy = (double)camera.fy, b = (double)camera.baseline;
    z[0] = fx * q[0] / q[2] + (double)camera.cx;
    z[1] = fx * (q[0] - b) / q[2] + (double)camera.cx;
    z[2] = fy * q[1] / q[2] + (double)camera.cy;
}

/* A few roundings of numbers up to 1200 px. */
static double pixel_rounding(void) {
    return 4 * 1200 * REAL_EPSILON;
}

static void test_projection_follows_its_equations(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_real q[3], z[3];
        double exact[3], expected[3], got[3];
        random_point(random_depth(), q, exact);
        project(exact, expected);
        plr_stereo_project(z, &camera, q);
        to_doubles(got, z, 3);
        TEST_ASSERT_DOUBLE_WITHIN(pixel_rounding(), 0, largest_difference(expected, got, 3));
    }
}

static void test_rows_are_left_right_and_vertical(void) {
    const plr_real on_axis[3] = {0, 0, 10};
    plr_real z[3];
    plr_stereo_project(z, &camera, on_axis);
    TEST_ASSERT_DOUBLE_WITHIN(pixel_rounding(), 607.25, (double)z[0]);
    TEST_ASSERT_DOUBLE_WITHIN(pixel_rounding(), 607.25 - 718.5 * 0.5 / 10, (double)z[1]);
    TEST_ASSERT_DOUBLE_WITHIN(pixel_rounding(), 185.5, (double)z[2]);
}

static void test_jacobian_agrees_with_differences(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_real q[3], Dz[9];
        double exact[3];
        const double depth = random_depth(), h = 1e-6 * depth;
        random_point(depth, q, exact);
        plr_stereo_jacobian(Dz, &camera, q);
        /* the largest entry is fx / z; differences are good to (h / z)^2 and rounding / h */
        const double tolerance = 720 / depth * (8 * REAL_EPSILON + 1e-8);
        for (int j = 0; j < 3; j++) {
            double ahead[3], behind[3], z_ahead[3], z_behind[3];
            memcpy(ahead, exact, sizeof ahead);
            memcpy(behind, exact, sizeof behind);
            ahead[j] += h;
            behind[j] -= h;
            project(ahead, z_ahead);
            project(behind, z_behind);
            for (int i = 0; i < 3; i++)
                TEST_ASSERT_DOUBLE_WITHIN(tolerance, (z_ahead[i] - z_behind[i]) / (2 * h),
                                          (double)Dz[3 * i + j]);
        }
    }
}

static void test_back_projection_undoes_projection(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_real q[3], Dq[9], z[3];
        double exact[3], pixels[3], got[3];
        const double depth = exp(rng_uniform(&chance, log(0.5), log(300)));
        random_point(depth, q, exact);
        project(exact, pixels);
        to_reals(z, pixels, 3);
        plr_stereo_back_project(q, Dq, &camera, z);
        to_doubles(got, q, 3);
        /* a pixel's rounding is a part of the disparity: 1200 eps of fx b / z */
        const double disparity = (double)camera.fx * (double)camera.baseline / depth;
        const double tolerance = 2 * depth * (1200 * REAL_EPSILON / disparity + 8 * REAL_EPSILON);
        TEST_ASSERT_DOUBLE_WITHIN(tolerance, 0, largest_difference(exact, got, 3));
    }
}

/* Of back-projection in double, which the round trip above holds to the code under test. */
static void back_project(const double z[3], double q[3]) {
    const double scale = (double)camera.baseline / (z[0] - z[1]);
    q[0] = (z[0] - (double)camera.cx) * scale;
    q[1] = (z[2] - (double)camera.cy) * scale * (double)camera.fx / (double)camera.fy;
    q[2] = (double)camera.fx * scale;
}

static void test_back_projection_jacobian_agrees_with_differences(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_real z[3], q[3], Dq[9];
        double pixels[3] = {rng_uniform(&chance, 0, 1200), 0, rng_uniform(&chance, 0, 370)};
        const double disparity = rng_uniform(&chance, 1, 200), h = 1e-4;
        pixels[1] = pixels[0] - disparity;
        to_reals(z, pixels, 3);
        to_doubles(pixels, z, 3);
        plr_stereo_back_project(q, Dq, &camera, z);
        const double size = 720 * 0.5 / (disparity * disparity) * 2 + 1;
        for (int j = 0; j < 3; j++) {
            double ahead[3], behind[3], q_ahead[3], q_behind[3];
            memcpy(ahead, pixels, sizeof ahead);
            memcpy(behind, pixels, sizeof behind);
            ahead[j] += h;
            behind[j] -= h;
            back_project(ahead, q_ahead);
            back_project(behind, q_behind);
            for (int i = 0; i < 3; i++)
                TEST_ASSERT_DOUBLE_WITHIN(size * (1e-7 + 20 * REAL_EPSILON),
                                          (q_ahead[i] - q_behind[i]) / (2 * h),
                                          (double)Dq[3 * i + j]);
        }
    }
}

static void test_jacobians_of_projection_and_back_projection_are_inverse(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_real q[3], z[3], Dz[9], Dq[9];
        double exact[3];
        random_point(rng_uniform(&chance, 1, 50), q, exact);
        plr_stereo_project(z, &camera, q);
        plr_stereo_jacobian(Dz, &camera, q);
        plr_stereo_back_project(q, Dq, &camera, z);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                double sum = 0;
                for (int k = 0; k < 3; k++)
                    sum += (double)Dz[3 * i + k] * (double)Dq[3 * k + j];
                /* rounded pixels move the point by 1200 eps of its disparity, at least 7 px */
                TEST_ASSERT_DOUBLE_WITHIN(3e4 * REAL_EPSILON, i == j, sum);
            }
    }
}

static void test_body_and_camera_are_one_motion_apart(void) {
    for (int run = 0; run < RUNS; run++) {
        double s[3], expected[3], got[3];
        plr_real body[3], q[3], back[3];
        rng_normals(&chance, 10, s, 3);
        to_reals(body, s, 3);
        to_doubles(s, body, 3);
        for (int i = 0; i < 3; i++) {
            expected[i] = (double)camera.t_CB[i];
            for (int j = 0; j < 3; j++)
                expected[i] += (double)camera.R_CB[3 * i + j] * s[j];
        }
        plr_camera_from_body(q, &camera, body);
        to_doubles(got, q, 3);
        TEST_ASSERT_DOUBLE_WITHIN(200 * REAL_EPSILON, 0, largest_difference(expected, got, 3));
        plr_camera_to_body(back, &camera, q);
        to_doubles(got, back, 3);
        TEST_ASSERT_DOUBLE_WITHIN(400 * REAL_EPSILON, 0, largest_difference(s, got, 3));
    }
}
