// SPDX-License-Identifier: MIT
#include "support/imu_rig.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "support/chi_square.h"
#include "support/exact_camera.h"
#include "support/oracle.h"
#include "support/rigid.h"
#include "support/specimens.h"

imu_rig_state imu_rig;

static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

void imu_rig_set_up(void) {
    imu_flight_options *options = &imu_rig.options;
    plr_config *config = &imu_rig.config;
    imu_flight_options_default(options);
    plr_config_default(config);
    exact_camera(config);
    config->process = PLR_PROCESS_IMU;
    config->pixel_sigma_px = options->pixel_sigma_px;
    config->gyro_noise = options->gyro_noise;
    config->accel_noise = options->accel_noise;
    config->gyro_walk = options->gyro_walk;
    config->accel_walk = options->accel_walk;
    config->bias_accel_sigma_mps2 = options->bias_accel_sigma;
    config->bias_gyro_sigma_radps = options->bias_gyro_sigma;
}

static void give_start(void) {
    static const double exact[3] = {1e-6, 1e-6, 1e-6};
    double T[16], v[3];
    plr_pose pose;
    imu_flight_truth(&imu_rig.flight, T, v);
    rigid_to_pose(&pose, T);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_set_pose(&imu_rig.filter, imu_rig.flight.t_ns, &pose, NULL));
    for (int i = 0; i < 3; i++)
        v[i] += 1e-3 * rng_normal(&imu_rig.flight.chance);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(&imu_rig.filter, v, exact));
}

void imu_rig_begin(imu_rig_start start, uint64_t seed) {
    imu_flight_options options = imu_rig.options;
    plr_config config = imu_rig.config;
    options.seed = seed;
    if (start == IMU_RIG_AT_REST)
        options.rest_s = 1.5;
    if (start == IMU_RIG_IN_MOTION) {
        options.ahead_s = 3;
        config.imu_start = PLR_IMU_START_MOTION;
    }
    imu_flight_start(&imu_rig.flight, &options);
    TEST_ASSERT_EQUAL_INT(
        PLR_OK, plr_filter_init(&imu_rig.filter, &imu_rig.flight.calibration, &config, NULL));
    memcpy(imu_rig.world, identity, sizeof identity);
    if (start == IMU_RIG_GIVEN)
        give_start();
}

plr_imu imu_rig_read(void) {
    imu_flight_move(&imu_rig.flight);
    const plr_imu imu = imu_flight_read(&imu_rig.flight);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(&imu_rig.filter, imu_rig.flight.t_ns, &imu));
    return imu;
}

void imu_rig_lose(void) {
    imu_flight_move(&imu_rig.flight);
    (void)imu_flight_read(&imu_rig.flight);
}

void imu_rig_readings(unsigned count) {
    for (unsigned k = 0; k < count; k++)
        (void)imu_rig_read();
}

void imu_rig_frame(void) {
    const plr_frame frame = imu_flight_look(&imu_rig.flight);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&imu_rig.filter, &frame, &imu_rig.report));
}

void imu_rig_fly(unsigned frames) {
    for (unsigned k = 0; k < frames; k++) {
        imu_rig_readings(IMU_RIG_EVERY);
        imu_rig_frame();
    }
}

void imu_rig_adopt_world(void) {
    double T[16], true_pose[16], back[16], relative[16], v[3], moved[3];
    double *world = imu_rig.world;
    imu_flight_truth(&imu_rig.flight, true_pose, v);
    const plr_pose pose = pose_of(&imu_rig.filter);
    rigid_from_pose(T, &pose);
    rigid_inverse(back, true_pose);
    square_multiply(4, T, back, relative); /* brings the true world to the filter's */
    const double yaw = atan2(relative[4] - relative[1], relative[0] + relative[5]);
    memcpy(world, identity, sizeof identity);
    world[0] = world[5] = cos(yaw);
    world[4] = sin(yaw);
    world[1] = -world[4];
    const double p[3] = {true_pose[3], true_pose[7], true_pose[11]};
    rigid_apply(moved, world, p);
    for (int i = 0; i < 3; i++)
        world[4 * i + 3] = pose.p[i] - moved[i];
}

/* e^T P^-1 e of three numbers, from a covariance with six columns. */
static double squared(const double e[3], const double *P) {
    double own[9], weighted[3], sum = 0;
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++)
            own[3 * i + j] = P[6 * i + j];
    memcpy(weighted, e, sizeof weighted);
    TEST_ASSERT_TRUE(oracle_solve_spd(3, 1, own, weighted));
    for (unsigned i = 0; i < 3; i++)
        sum += e[i] * weighted[i];
    return sum;
}

static double length(const double x[3]) {
    return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
}

imu_rig_errors imu_rig_errors_now(void) {
    const plr_filter *f = &imu_rig.filter;
    imu_rig_errors e;
    plr_twist twist;
    double truth[16], v[3], T[16], back[16], there[16], off[16], xi[6], P[36], b[6];
    imu_flight_truth(&imu_rig.flight, there, v);
    square_multiply(4, imu_rig.world, there, truth);
    const plr_pose pose = pose_of(f);
    rigid_from_pose(T, &pose);
    rigid_inverse(back, T);
    square_multiply(4, back, truth, off);
    rigid_log(xi, off);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(f, P));
    e.position = squared(xi, P);
    e.orientation = squared(xi + 3, P + 21);
    e.metres = length(xi);
    e.rad = length(xi + 3);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity(f, &twist));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(f, P));
    for (int i = 0; i < 3; i++)
        v[i] -= twist.v_B_mps[i];
    e.velocity = squared(v, P);
    e.mps = length(v);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(f, b, P));
    for (int i = 0; i < 6; i++)
        b[i] = imu_rig.flight.bias[i] - b[i];
    e.accel_bias = squared(b, P);
    e.gyro_bias = squared(b + 3, P + 21);
    return e;
}

void imu_rig_add(imu_rig_errors *sum, const imu_rig_errors *e, double share) {
    sum->orientation += share * e->orientation;
    sum->position += share * e->position;
    sum->velocity += share * e->velocity;
    sum->accel_bias += share * e->accel_bias;
    sum->gyro_bias += share * e->gyro_bias;
    sum->metres += share * e->metres * e->metres;
    sum->rad += share * e->rad * e->rad;
    sum->mps += share * e->mps * e->mps;
}

void imu_rig_tell(const char *what, const imu_rig_errors *sum) {
    printf("%s: NEES orientation %.3f, position %.3f, velocity %.3f, b_a %.3f, b_g %.3f; "
           "%.4f m, %.4f rad, %.4f m/s\n",
           what, sum->orientation / 3, sum->position / 3, sum->velocity / 3, sum->accel_bias / 3,
           sum->gyro_bias / 3, sqrt(sum->metres), sqrt(sum->rad), sqrt(sum->mps));
}

void imu_rig_demand_consistent(const char *what, const imu_rig_errors *sum, unsigned flights,
                               bool may_be_careful) {
    const double all[5] = {sum->orientation, sum->position, sum->velocity, sum->accel_bias,
                           sum->gyro_bias};
    double low, high;
    chi_square_bounds(3 * flights, &low, &high);
    imu_rig_tell(what, sum);
    for (unsigned i = 0; i < 5; i++) {
        TEST_ASSERT_TRUE_MESSAGE(all[i] / 3 < high, what);
        TEST_ASSERT_TRUE_MESSAGE(may_be_careful || all[i] / 3 > low, what);
    }
}

void imu_rig_remember(void) {
    memcpy(&imu_rig.before, &imu_rig.filter, sizeof imu_rig.before);
}

void imu_rig_demand_refusal(plr_status expected, plr_status got) {
    static plr_filter after;
    const plr_totals *was = &imu_rig.before.totals, *is = &imu_rig.filter.totals;
    TEST_ASSERT_EQUAL_INT(expected, got);
    after = imu_rig.filter; /* what it counts besides: the fault, repetitions, spikes */
    after.source.inertial.fault = imu_rig.before.source.inertial.fault;
    after.source.inertial.repeated = imu_rig.before.source.inertial.repeated;
    after.source.inertial.out_of_line = imu_rig.before.source.inertial.out_of_line;
    TEST_ASSERT_TRUE_MESSAGE(specimen_same_state(&imu_rig.before, &after),
                             "a refused call changed the state");
    TEST_ASSERT_EQUAL_UINT32(was->resets, is->resets);
    TEST_ASSERT_EQUAL_UINT32(was->frames, is->frames);
    TEST_ASSERT_EQUAL_UINT32(was->twists, is->twists);
    TEST_ASSERT_EQUAL_UINT32(was->refused + 1, is->refused);
    imu_rig_remember();
}
