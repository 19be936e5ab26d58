// SPDX-License-Identifier: MIT
/* An IMU with noise as it is told: orientation, position, velocity and biases stay within their
 * covariance, whichever way the filter has started. Simulated flights, normalised squared errors
 * against chi-square. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "pelorus/filter.h"
#include "support/chi_square.h"
#include "support/imu_flight.h"
#include "support/oracle.h"
#include "support/rigid.h"

/* In a slow build fewer flights, and with them wider bounds. */
enum { RUNS = PELORUS_SLOW_BUILD ? 3 : 20, FRAMES = 300, EVERY = 40 /* readings in a frame */ };

typedef enum start_kind { GIVEN, AT_REST, IN_MOTION, STARTS } start_kind;

typedef struct errors {
    double orientation, position, velocity, accel_bias, gyro_bias; /* chi-square of 3 */
    double metres, rad;
} errors;

static plr_filter filter;
static plr_config config;
static imu_flight flight;
static imu_flight_options options;

void setUp(void) {
    imu_flight_options_default(&options);
    plr_config_default(&config);
    config.process = PLR_PROCESS_IMU;
    config.pixel_sigma_px = options.pixel_sigma_px;
    config.gyro_noise = options.gyro_noise;
    config.accel_noise = options.accel_noise;
    config.gyro_walk = options.gyro_walk;
    config.accel_walk = options.accel_walk;
    config.bias_accel_sigma_mps2 = options.bias_accel_sigma;
    config.bias_gyro_sigma_radps = options.bias_gyro_sigma;
}

void tearDown(void) {
}

/* e^T P^-1 e of three numbers, from a covariance with `ld` columns. */
static double squared(const double e[3], const double *P, unsigned ld) {
    double own[9], weighted[3], sum = 0;
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++)
            own[3 * i + j] = P[ld * i + j];
    memcpy(weighted, e, sizeof weighted);
    TEST_ASSERT_TRUE(oracle_solve_spd(3, 1, own, weighted));
    for (unsigned i = 0; i < 3; i++)
        sum += e[i] * weighted[i];
    return sum;
}

/* The pose of the true world seen from the filter's: position and yaw of the start are free. */
static double world[16];

static errors errors_now(void) {
    errors e;
    plr_pose pose;
    plr_twist twist;
    double truth[16], v[3], T[16], back[16], there[16], off[16], xi[6], P[36], b[6], d[3];
    imu_flight_truth(&flight, there, v);
    square_multiply(4, world, there, truth);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose(&filter, &pose));
    rigid_from_pose(T, &pose);
    rigid_inverse(back, T);
    square_multiply(4, back, truth, off);
    rigid_log(xi, off);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&filter, P));
    e.position = squared(xi, P, 6);
    e.orientation = squared(xi + 3, P + 21, 6);
    e.metres = sqrt(xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]);
    e.rad = sqrt(xi[3] * xi[3] + xi[4] * xi[4] + xi[5] * xi[5]);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity(&filter, &twist));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(&filter, P));
    for (int i = 0; i < 3; i++)
        d[i] = v[i] - twist.v_B_mps[i];
    e.velocity = squared(d, P, 6);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&filter, b, P));
    for (int i = 0; i < 6; i++)
        b[i] = flight.bias[i] - b[i];
    e.accel_bias = squared(b, P, 6);
    e.gyro_bias = squared(b + 3, P + 21, 6);
    return e;
}

static void give_start(void) {
    static const double exact[3] = {1e-6, 1e-6, 1e-6};
    double T[16], v[3];
    plr_pose pose;
    imu_flight_truth(&flight, T, v);
    rigid_to_pose(&pose, T);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&filter, flight.t_ns, &pose, NULL));
    for (int i = 0; i < 3; i++)
        v[i] += 1e-3 * rng_normal(&flight.chance);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(&filter, v, exact));
}

/* So many frames. */
static void fly(unsigned frames) {
    for (unsigned k = 0; k < frames * EVERY; k++) {
        imu_flight_move(&flight);
        const plr_imu imu = imu_flight_read(&flight);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(&filter, flight.t_ns, &imu));
        if ((k + 1) % EVERY == 0) {
            const plr_frame frame = imu_flight_look(&flight);
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &frame, NULL));
        }
    }
}

/* The world of the estimate: its position and yaw hold, and its vertical is that of the truth. */
static void adopt_world(void) {
    static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    double T[16], true_pose[16], back[16], relative[16], v[3];
    plr_pose pose;
    imu_flight_truth(&flight, true_pose, v);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose(&filter, &pose));
    rigid_from_pose(T, &pose);
    rigid_inverse(back, true_pose);
    square_multiply(4, T, back, relative); /* brings the true world to the filter's */
    const double yaw = atan2(relative[4] - relative[1], relative[0] + relative[5]);
    memcpy(world, identity, sizeof world);
    world[0] = world[5] = cos(yaw);
    world[4] = sin(yaw);
    world[1] = -world[4];
    double moved[3];
    const double p[3] = {true_pose[3], true_pose[7], true_pose[11]};
    rigid_apply(moved, world, p);
    for (int i = 0; i < 3; i++)
        world[4 * i + 3] = pose.p[i] - moved[i];
}

static void begin(start_kind kind, uint64_t seed) {
    static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    options.seed = seed;
    options.rest_s = kind == AT_REST ? 1.5 : 0;
    options.ahead_s = kind == IN_MOTION ? 3 : 0;
    config.imu_start = kind == IN_MOTION ? PLR_IMU_START_MOTION : PLR_IMU_START_AUTO;
    imu_flight_start(&flight, &options);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &flight.calibration, &config, NULL));
    memcpy(world, identity, sizeof world);
    if (kind == GIVEN)
        give_start();
}

static void test_errors_stay_within_the_covariance(void) {
    static const char *const names[STARTS] = {"given", "at rest", "in motion"};
    double low, high;
    chi_square_bounds(3 * RUNS, &low, &high);
    for (int kind = 0; kind < STARTS; kind++) {
        errors sum = {0};
        for (uint64_t seed = 1; seed <= RUNS; seed++) {
            begin((start_kind)kind, seed);
            if (kind == AT_REST) {
                fly(12);
                adopt_world();
            } else if (kind == IN_MOTION) {
                while (!filter.inertial.anchored)
                    fly(1);
                adopt_world();
            }
            fly(FRAMES);
            const errors e = errors_now();
            const double share = 1.0 / (3 * RUNS);
            sum.orientation += share * e.orientation;
            sum.position += share * e.position;
            sum.velocity += share * e.velocity;
            sum.accel_bias += share * e.accel_bias;
            sum.gyro_bias += share * e.gyro_bias;
            sum.metres += e.metres * e.metres / RUNS;
            sum.rad += e.rad * e.rad / RUNS;
        }
        printf("%s: NEES orientation %.3f, position %.3f, velocity %.3f, b_a %.3f, b_g %.3f; "
               "%.4f m, %.4f rad\n",
               names[kind], sum.orientation, sum.position, sum.velocity, sum.accel_bias,
               sum.gyro_bias, sqrt(sum.metres), sqrt(sum.rad));
        TEST_ASSERT_TRUE_MESSAGE(sum.orientation > low && sum.orientation < high, names[kind]);
        TEST_ASSERT_TRUE_MESSAGE(sum.position > low && sum.position < high, names[kind]);
        TEST_ASSERT_TRUE_MESSAGE(sum.velocity > low && sum.velocity < high, names[kind]);
        TEST_ASSERT_TRUE_MESSAGE(sum.accel_bias > low && sum.accel_bias < high, names[kind]);
        TEST_ASSERT_TRUE_MESSAGE(sum.gyro_bias > low && sum.gyro_bias < high, names[kind]);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_errors_stay_within_the_covariance);
    return UNITY_END();
}
