// SPDX-License-Identifier: MIT
/*
 * What is told of covariances contains what an error of the camera's calibration does to the
 * estimate: held against filters that believe in another focal length, baseline or attitude of the
 * camera on the body and are given the same readings and pictures. Without noise, an estimate
 * moves by d where the believed number grows by one; with a sigma for it, each covariance must be
 * larger by sigma^2 d d^T.
 */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/imu_rig.h"
#include "support/rig.h"
#include "support/rigid.h"

enum { MOST_LANDMARKS = 40, FRAMES = 30 };

/* By which the believed number is varied, either way: so little that no test contradicts it, and more than
 * float32 rounds in a landmark. */
static double step_of_belief;
static const double SIGMA = 0.05;
static const double ROUNDING = PLR_REAL == 32 ? 0.05 : 0.02; /* of the largest element of a block */
/* Small, because an uncertain range is linearised at another place than the estimate: P and S agree
 * about that place, but a difference of two estimates is taken at theirs. */
static const double PIXEL_SIGMA = 0.02;

/* What has a sigma of its own, for all its axes. */
typedef enum parameter { FOCAL_LENGTH, BASELINE, TURN, CENTRE, PLACE, PARAMETERS } parameter;
enum { AXES = 3 };
static const unsigned axes_of[PARAMETERS] = {1, 1, AXES, 2, AXES};
/* What moves pixels by about as much as a radian does: px, and m. */
static const double unit[PARAMETERS] = {1, 1, 1, 400, 5};

/* What is believed beside the truth: a parameter, about or along which axis, by how much. */
typedef struct belief {
    parameter what;
    unsigned axis;
    double by;
} belief;

typedef struct outcome {
    double T[16], b[6], u[6], P_xi[36], P_b[36], P_u[36];
    unsigned count;
    plr_landmark landmarks[MOST_LANDMARKS];
} outcome;

static outcome plain, more[AXES], less[AXES], told;

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

/* The camera turns about its own middle: T_CB <- Exp(0, turn) T_CB. */
static void turn_camera(plr_calibration *calibration, unsigned axis, double angle) {
    double xi[6] = {0}, turn[16], T_CB[16], turned[16];
    xi[3 + axis] = angle;
    rigid_exp(turn, xi);
    rigid_from_pose(T_CB, &calibration->T_CB);
    square_multiply(4, turn, T_CB, turned);
    rigid_to_pose(&calibration->T_CB, turned);
}

static void vary(plr_calibration *calibration, const belief *other) {
    if (other->what == BASELINE) {
        calibration->baseline_m *= 1 + other->by;
    } else if (other->what == FOCAL_LENGTH) {
        calibration->fx_px *= 1 + other->by;
        calibration->fy_px *= 1 + other->by;
    } else if (other->what == CENTRE) {
        *(other->axis == 0 ? &calibration->cx_px : &calibration->cy_px) += unit[CENTRE] * other->by;
    } else if (other->what == PLACE) {
        calibration->T_CB.p[other->axis] += unit[PLACE] * other->by;
    } else {
        turn_camera(calibration, other->axis, other->by);
    }
}

static void consider(plr_config *config, parameter what, double sigma) {
    double *const sigmas[PARAMETERS] = {&config->focal_sigma, &config->baseline_sigma,
                                        &config->camera_turn_sigma_rad, &config->centre_sigma_px,
                                        &config->camera_place_sigma_m};
    *sigmas[what] = unit[what] * sigma;
}

/* Ends between two frames, with motion that no frame has taken into the covariance yet. */
static void drive(const belief *other, double sigma, outcome *o) {
    scene_calibration(&rig.calibration);
    vary(&rig.calibration, other);
    consider(&rig.config, other->what, sigma);
    rig_begin();
    rig_drive(FRAMES);
    for (unsigned i = 0; i < RIG_TWISTS / 2; i++)
        rig_twist();
    look_at(&rig.filter, o);
}

static void fly(const belief *other, double sigma, outcome *o) {
    static const double exact[3] = {1e-6, 1e-6, 1e-6};
    plr_filter *f = &imu_rig.filter;
    double T[16], v[3];
    plr_pose pose;
    consider(&imu_rig.config, other->what, sigma);
    imu_rig_begin(IMU_RIG_GIVEN, 3);
    plr_calibration believed = imu_rig.flight.calibration;
    vary(&believed, other);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(f, &believed, &imu_rig.config, NULL));
    imu_flight_truth(&imu_rig.flight, T, v);
    rigid_to_pose(&pose, T);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(f, imu_rig.flight.t_ns, &pose, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(f, v, exact));
    imu_rig_fly(FRAMES);
    imu_rig_readings(IMU_RIG_EVERY / 2);
    look_at(&imu_rig.filter, o);
}

/* How far an estimate moves where a number that is believed grows by one: of each axis that is
 * varied. */
typedef struct moves {
    unsigned axes;
    double d[AXES][6];
} moves;

/* A shift of the camera is seen by the inverse range, and its part of that by the square of it: there the
 * other place counts twice. */
static double tolerance;

/* C = with - without must be SIGMA^2 sum d d^T. Returns the largest element of C. */
static double demand_share(unsigned n, const double *with, const double *without, const moves *m,
                           const char *of) {
    double share[36] = {0}, largest = 0;
    for (unsigned axis = 0; axis < m->axes; axis++)
        for (unsigned i = 0; i < n * n; i++)
            share[i] += SIGMA * SIGMA * m->d[axis][i / n] * m->d[axis][i % n];
    for (unsigned i = 0; i < n; i++)
        largest = fmax(largest, share[n * i + i]);
    for (unsigned i = 0; i < n * n; i++)
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(tolerance * (largest + fabs(without[i])), share[i],
                                          with[i] - without[i], of);
    return largest;
}

static void difference(unsigned n, const double *higher, const double *lower, double *d) {
    for (unsigned i = 0; i < n; i++)
        d[i] = (higher[i] - lower[i]) / (2 * step_of_belief);
}

static void compare_landmarks(unsigned axes) {
    TEST_ASSERT_TRUE(plain.count > 4);
    for (unsigned k = 0; k < plain.count; k++) {
        moves m = {axes, {{0}}};
        for (unsigned axis = 0; axis < axes; axis++) {
            const plr_landmark *high = &more[axis].landmarks[k], *low = &less[axis].landmarks[k];
            TEST_ASSERT_EQUAL_UINT32(high->id, low->id);
            difference(3, high->p_W_m, low->p_W_m, m.d[axis]);
        }
        demand_share(3, told.landmarks[k].P_W_m2, plain.landmarks[k].P_W_m2, &m, "landmark");
    }
}

static void compare(unsigned axes) {
    moves pose = {axes, {{0}}}, bias = {axes, {{0}}}, velocity = {axes, {{0}}};
    for (unsigned axis = 0; axis < axes; axis++) {
        const outcome *high = &more[axis], *low = &less[axis];
        double back[16], moved[16], xi[6];
        rigid_inverse(back, low->T);
        square_multiply(4, back, high->T, moved);
        rigid_log(xi, moved);
        for (unsigned i = 0; i < 6; i++)
            pose.d[axis][i] = xi[i] / (2 * step_of_belief);
        difference(6, high->b, low->b, bias.d[axis]);
        difference(6, high->u, low->u, velocity.d[axis]);
        TEST_ASSERT_TRUE(high->count == plain.count && low->count == plain.count);
    }
    TEST_ASSERT_TRUE(demand_share(6, told.P_xi, plain.P_xi, &pose, "pose") > 1e-6);
    demand_share(6, told.P_b, plain.P_b, &bias, "bias");
    demand_share(6, told.P_u, plain.P_u, &velocity, "velocity");
    compare_landmarks(axes);
}

static void hold_against_others(void (*run)(const belief *, double, outcome *), double step) {
    step_of_belief = PLR_REAL == 32 ? step : 1e-5;
    for (int what = 0; what < PARAMETERS; what++) {
        const unsigned axes = axes_of[what];
        tolerance = what == PLACE ? 2 * ROUNDING : ROUNDING;
        const belief truth = {(parameter)what, 0, 0};
        run(&truth, 0, &plain);
        for (unsigned axis = 0; axis < axes; axis++) {
            const belief higher = {(parameter)what, axis, step_of_belief};
            const belief lower = {(parameter)what, axis, -step_of_belief};
            run(&higher, 0, &more[axis]);
            run(&lower, 0, &less[axis]);
        }
        run(&truth, SIGMA, &told);
        TEST_ASSERT_EQUAL_MEMORY(plain.T, told.T, sizeof told.T); /* it changes no estimate */
        TEST_ASSERT_EQUAL_MEMORY(plain.b, told.b, sizeof told.b);
        compare(axes);
        consider(&rig.config, (parameter)what, 0);
        consider(&imu_rig.config, (parameter)what, 0);
    }
}

static void test_twists_with_biases(void) {
    rig.config.bias = 1;
    hold_against_others(drive, 1e-3);
}

static void test_twists_without_biases(void) {
    rig.config.bias = 0;
    hold_against_others(drive, 1e-3);
}

static void test_the_world_model(void) {
    rig.config.model = PLR_MODEL_WORLD;
    hold_against_others(drive, 1e-3);
}

static void test_an_imu(void) {
    hold_against_others(fly, 3e-4);
}
