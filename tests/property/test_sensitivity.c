// SPDX-License-Identifier: MIT
/*
 * What is told of covariances contains what an error of the camera's calibration does to the
 * estimate: held against filters that believe in another focal length or baseline and are given the
 * same readings and pictures. Without noise, an estimate moves by d where the believed number grows
 * by one; with a sigma for it, each covariance must be larger by sigma^2 d d^T.
 */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/imu_rig.h"
#include "support/rig.h"
#include "support/rigid.h"

enum { MOST_LANDMARKS = 40, FRAMES = 30 };

/* By which the believed number is varied, either way: so little that no test contradicts it. */
static double step_of_belief;
static const double SIGMA = 0.05;
static const double ROUNDING = PLR_REAL == 32 ? 0.05 : 0.02; /* of the largest element of a block */
/* Small, because an uncertain range is linearised at another place than the estimate: P and S agree
 * about that place, but a difference of two estimates is taken at theirs. */
static const double PIXEL_SIGMA = 0.02;

typedef enum parameter { FOCAL_LENGTH, BASELINE, PARAMETERS } parameter;

typedef struct outcome {
    double T[16], b[6], u[6], P_xi[36], P_b[36], P_u[36];
    unsigned count;
    plr_landmark landmarks[MOST_LANDMARKS];
} outcome;

static outcome plain, more, less, told;

void setUp(void) {
    rig_set_up();
    rig.options.pixel_sigma_px = 0; /* without noise an estimate does not depend on gains */
    rig.options.velocity_sigma_mps = rig.options.gyro_sigma_radps = 0;
    rig.config.pixel_sigma_px = PIXEL_SIGMA;
    rig.config.slots = MOST_LANDMARKS;
    rig.config.gate_d2 = 0;
    imu_rig_set_up();
    imu_rig.options.pixel_sigma_px = 0;
    imu_rig.options.gyro_noise = imu_rig.options.accel_noise = 0;
    imu_rig.options.gyro_walk = imu_rig.options.accel_walk = 0;
    imu_rig.options.bias_accel_sigma = imu_rig.options.bias_gyro_sigma = 0;
    imu_rig.config.pixel_sigma_px = PIXEL_SIGMA;
    imu_rig.config.slots = MOST_LANDMARKS;
    imu_rig.config.gate_d2 = 0;
}

static void look_at(plr_filter *f, outcome *o) {
    plr_twist u;
    memset(o, 0, sizeof *o);
    const plr_pose pose = pose_of(f);
    rigid_from_pose(o->T, &pose);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(f, o->P_xi));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(f, o->b, o->P_b));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity(f, &u));
    memcpy(o->u, u.v_B_mps, sizeof u.v_B_mps);
    memcpy(o->u + 3, u.w_B_radps, sizeof u.w_B_radps);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(f, o->P_u));
    o->count = plr_filter_landmark_count(f);
    for (unsigned i = 0; i < o->count; i++)
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(f, i, &o->landmarks[i]));
}

static void vary(plr_calibration *calibration, parameter what, double share) {
    if (what == BASELINE) {
        calibration->baseline_m *= 1 + share;
    } else {
        calibration->fx_px *= 1 + share;
        calibration->fy_px *= 1 + share;
    }
}

static void consider(plr_config *config, parameter what, double sigma) {
    *(what == BASELINE ? &config->baseline_sigma : &config->focal_sigma) = sigma;
}

/* Ends between two frames, with motion that no frame has taken into the covariance yet. */
static void drive(parameter what, double share, double sigma, outcome *o) {
    scene_calibration(&rig.calibration);
    vary(&rig.calibration, what, share);
    consider(&rig.config, what, sigma);
    rig_begin();
    rig_drive(FRAMES);
    for (unsigned i = 0; i < RIG_TWISTS / 2; i++)
        rig_twist();
    look_at(&rig.filter, o);
}

static void fly(parameter what, double share, double sigma, outcome *o) {
    static const double exact[3] = {1e-6, 1e-6, 1e-6};
    plr_filter *f = &imu_rig.filter;
    double T[16], v[3];
    plr_pose pose;
    consider(&imu_rig.config, what, sigma);
    imu_rig_begin(IMU_RIG_GIVEN, 3);
    plr_calibration believed = imu_rig.flight.calibration;
    vary(&believed, what, share);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(f, &believed, &imu_rig.config, NULL));
    imu_flight_truth(&imu_rig.flight, T, v);
    rigid_to_pose(&pose, T);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(f, imu_rig.flight.t_ns, &pose, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(f, v, exact));
    imu_rig_fly(FRAMES);
    imu_rig_readings(IMU_RIG_EVERY / 2);
    look_at(&imu_rig.filter, o);
}

/* C = with - without must be SIGMA^2 d d^T. Returns the largest element of C. */
static double demand_share(unsigned n, const double *with, const double *without, const double *d,
                           const char *of) {
    double largest = 0;
    for (unsigned i = 0; i < n; i++)
        largest = fmax(largest, SIGMA * SIGMA * d[i] * d[i]);
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < n; j++)
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(ROUNDING * (largest + fabs(without[n * i + j])),
                                              SIGMA * SIGMA * d[i] * d[j],
                                              with[n * i + j] - without[n * i + j], of);
    return largest;
}

static void compare(void) {
    double back[16], moved[16], d[6];
    rigid_inverse(back, less.T);
    square_multiply(4, back, more.T, moved);
    rigid_log(d, moved);
    for (unsigned i = 0; i < 6; i++)
        d[i] /= 2 * step_of_belief;
    TEST_ASSERT_TRUE(demand_share(6, told.P_xi, plain.P_xi, d, "pose") > 1e-6);
    for (unsigned i = 0; i < 6; i++)
        d[i] = (more.b[i] - less.b[i]) / (2 * step_of_belief);
    demand_share(6, told.P_b, plain.P_b, d, "bias");
    for (unsigned i = 0; i < 6; i++)
        d[i] = (more.u[i] - less.u[i]) / (2 * step_of_belief);
    demand_share(6, told.P_u, plain.P_u, d, "velocity");
    TEST_ASSERT_TRUE(plain.count > 4 && more.count == plain.count && less.count == plain.count);
    for (unsigned k = 0; k < plain.count; k++) {
        TEST_ASSERT_EQUAL_UINT32(more.landmarks[k].id, less.landmarks[k].id);
        for (unsigned i = 0; i < 3; i++)
            d[i] = (more.landmarks[k].p_W_m[i] - less.landmarks[k].p_W_m[i]) / (2 * step_of_belief);
        demand_share(3, told.landmarks[k].P_W_m2, plain.landmarks[k].P_W_m2, d, "landmark");
    }
}

static void hold_against_others(void (*run)(parameter, double, double, outcome *), double step) {
    step_of_belief = PLR_REAL == 32 ? step : 1e-5;
    for (int what = 0; what < PARAMETERS; what++) {
        run((parameter)what, 0, 0, &plain);
        run((parameter)what, step_of_belief, 0, &more);
        run((parameter)what, -step_of_belief, 0, &less);
        run((parameter)what, 0, SIGMA, &told);
        TEST_ASSERT_EQUAL_MEMORY(plain.T, told.T, sizeof told.T); /* it changes no estimate */
        TEST_ASSERT_EQUAL_MEMORY(plain.b, told.b, sizeof told.b);
        compare();
        consider(&rig.config, (parameter)what, 0);
        consider(&imu_rig.config, (parameter)what, 0);
    }
}

static void test_twists_with_biases(void) {
    rig.config.bias = 1;
    hold_against_others(drive, 5e-4);
}

static void test_twists_without_biases(void) {
    rig.config.bias = 0;
    hold_against_others(drive, 5e-4);
}

static void test_the_world_model(void) {
    rig.config.model = PLR_MODEL_WORLD;
    hold_against_others(drive, 5e-4);
}

static void test_an_imu(void) {
    hold_against_others(fly, 1e-4);
}
