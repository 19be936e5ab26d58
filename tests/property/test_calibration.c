// SPDX-License-Identifier: MIT
/*
 * A calibration that is estimated on the way: its errors, drawn as their sigmas say, stay within the
 * covariance that is told of them, and those of the state within theirs; and where a drive shows
 * nothing of them, nothing is learnt.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "support/chi_square.h"
#include "support/imu_rig.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/rigid.h"
#include "support/state_bytes.h"

enum { RUNS = PELORUS_SHORT_FORM ? 3 : 12, FRAMES = PELORUS_SHORT_FORM ? 100 : 200 };
enum { REST = 4000 };
enum { ERRORS = PLR_CALIBRATION_ERRORS, LATE_READINGS = 2, EVERYTHING = 63 };

static double drawn[ERRORS]; /* what is to be corrected */

void setUp(void) {
    plr_config *c = &imu_rig.config;
    imu_rig_set_up();
    c->calibrate = EVERYTHING;
    c->focal_sigma = 0.007;
    c->baseline_sigma = 0.006;
    c->camera_turn_sigma_rad = 0.008;
    c->centre_sigma_px = 3;
    c->camera_place_sigma_m = 0.02;
    c->camera_clock_sigma_s = 0.005;
}

/* ---------------------------------------------------------------- a wrong calibration */

static void draw(rng *chance) {
    const plr_config *c = &imu_rig.config;
    const double sigma[ERRORS] = {c->baseline_sigma,
                                  c->focal_sigma,
                                  c->camera_turn_sigma_rad,
                                  c->camera_turn_sigma_rad,
                                  c->camera_turn_sigma_rad,
                                  c->centre_sigma_px,
                                  c->centre_sigma_px,
                                  c->camera_place_sigma_m,
                                  c->camera_place_sigma_m,
                                  c->camera_place_sigma_m,
                                  0};
    for (unsigned k = 0; k < ERRORS; k++)
        drawn[k] = sigma[k] * rng_normal(chance);
    drawn[PLR_CAMERA_CLOCK] = -LATE_READINGS / imu_rig.options.rate_hz;
}

/* The true calibration less what was drawn. */
static plr_calibration spoiled(const plr_calibration *truth) {
    plr_calibration told = *truth;
    double back[6], E[16], T[16], before[16];
    told.baseline_m /= 1 + drawn[PLR_BASELINE];
    told.fx_px /= 1 + drawn[PLR_FOCAL_LENGTH];
    told.fy_px /= 1 + drawn[PLR_FOCAL_LENGTH];
    told.cx_px -= drawn[PLR_CENTRE_X];
    told.cy_px -= drawn[PLR_CENTRE_Y];
    for (unsigned i = 0; i < 3; i++) {
        back[i] = -drawn[PLR_CAMERA_PLACE_X + i];
        back[3 + i] = -drawn[PLR_CAMERA_TURN_X + i];
    }
    rigid_exp(E, back);
    rigid_from_pose(T, &truth->T_CB);
    square_multiply(4, E, T, before);
    rigid_to_pose(&told.T_CB, before);
    return told;
}

static void begin(imu_rig_start start, uint64_t seed) {
    static const double exact[3] = {1e-6, 1e-6, 1e-6};
    rng chance = rng_seeded(1000 + seed);
    double T[16], v[3];
    plr_pose pose;
    draw(&chance);
    imu_rig_begin(start, seed);
    const plr_calibration told = spoiled(&imu_rig.flight.calibration);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&imu_rig.filter, &told, &imu_rig.config, NULL));
    if (start != IMU_RIG_GIVEN)
        return;
    imu_flight_truth(&imu_rig.flight, T, v);
    rigid_to_pose(&pose, T);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_set_pose(&imu_rig.filter, imu_rig.flight.t_ns, &pose, NULL));
    for (int i = 0; i < 3; i++)
        v[i] += 1e-3 * rng_normal(&chance);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(&imu_rig.filter, v, exact));
}

/* Frames whose stamps are late by some readings. */
static void fly(unsigned frames) {
    static plr_observation seen[IMU_FLIGHT_MOST_SEEN];
    for (unsigned k = 0; k < frames; k++) {
        imu_rig_readings(IMU_RIG_EVERY - LATE_READINGS);
        plr_frame frame = imu_flight_look(&imu_rig.flight);
        memcpy(seen, frame.observations, frame.count * sizeof *seen);
        imu_rig_readings(LATE_READINGS);
        frame.observations = seen;
        frame.t_ns = imu_rig.flight.t_ns;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&imu_rig.filter, &frame, &imu_rig.report));
    }
}

/* ---------------------------------------------------------------- what was learnt */

/* e^T Sigma^-1 e of all errors together, Sigma = G D G^T. */
static double squared_error(void) {
    const plr_filter *f = &imu_rig.filter;
    const unsigned n = f->par.calibrated.count;
    double Sigma[ERRORS * ERRORS] = {0}, e[ERRORS], x[ERRORS], sum = 0;
    TEST_ASSERT_EQUAL_UINT(ERRORS, n);
    for (unsigned k = 0; k < n; k++) {
        const plr_real *G = f->calibration.factor + PLR_CALIBRATIONS * k;
        for (unsigned i = 0; i <= k; i++)
            for (unsigned j = 0; j <= k; j++)
                Sigma[n * i + j] +=
                    (double)(f->par.calibrated.variance[k] * f->calibration.told[k] * G[i] * G[j]);
        x[k] = e[k] = (double)f->calibration.moved[k] - drawn[f->par.calibrated.kind[k]];
    }
    TEST_ASSERT_TRUE(oracle_solve_spd(n, 1, Sigma, x));
    for (unsigned k = 0; k < n; k++)
        sum += x[k] * e[k];
    return sum;
}

static void test_errors_of_calibration_and_state_stay_within_their_covariance(void) {
    imu_rig_errors sum = {0};
    double calibration = 0;
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        begin(IMU_RIG_GIVEN, seed);
        fly(FRAMES);
        const imu_rig_errors e = imu_rig_errors_now();
        imu_rig_add(&sum, &e, 1.0 / RUNS);
        calibration += squared_error() / (RUNS * ERRORS);
    }
    printf("calibration %.3f\n", calibration);
    chi_square_demand("calibration", calibration, RUNS * ERRORS);
    imu_rig_demand_consistent("state", &sum, RUNS, true);
}

static void test_a_saved_state_goes_on_with_what_was_learnt(void) {
    static plr_filter other;
    static state_bytes state;
    plr_filter *f = &imu_rig.filter;
    imu_rig.config.slots = 12;
    begin(IMU_RIG_GIVEN, 2);
    fly(40);
    const plr_calibration told = spoiled(&imu_rig.flight.calibration);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&other, &told, &imu_rig.config, NULL));
    state_bytes_save(&state, f);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &other));
    TEST_ASSERT_TRUE(f->calibration.told[0] < 1);
    TEST_ASSERT_EQUAL_MEMORY(&f->calibration, &other.calibration, sizeof other.calibration);
    TEST_ASSERT_TRUE(state_bytes_same_filter(f, &other));
}

/* The told sigmas beside those of the prior, and how far the estimates have gone, in the latter. */
static void demand_untouched(const char *what, double least, double most_off) {
    plr_calibration_result now;
    const plr_calibrated *c = &imu_rig.filter.par.calibrated;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_calibration(&imu_rig.filter, &now));
    for (unsigned k = 0; k < c->count; k++) {
        const double prior = sqrt((double)c->variance[k]);
        const double left = now.sigma[c->kind[k]] / prior, off = now.corrected[c->kind[k]] / prior;
        printf("%s: error %u: sigma %.3f, moved %.3f of the prior's\n", what, c->kind[k], left,
               off);
        TEST_ASSERT_TRUE_MESSAGE(left > least, what);
        TEST_ASSERT_TRUE_MESSAGE(fabs(off) < most_off, what);
    }
}

static void test_a_body_at_rest_learns_nothing(void) {
    imu_rig.options.rest_s = REST;
    begin(IMU_RIG_AT_REST, 3);
    imu_flight_start(&imu_rig.flight, &imu_rig.options);
    fly(REST);
    demand_untouched("at rest", 0.99, 0.05);
}

/* ---------------------------------------------------------------- constant speed */

enum { POINTS = 40 };

/* A corridor of points along x, seen from `way` metres on; they come again every 24 m with other ids. */
static plr_frame corridor(const plr_calibration *c, double way, rng *chance) {
    static plr_observation seen[POINTS];
    rng places = rng_seeded(77);
    unsigned count = 0;
    for (unsigned i = 0; i < POINTS; i++) {
        double s[3] = {rng_uniform(&places, 0, 24), rng_uniform(&places, -5, 5),
                       rng_uniform(&places, -3, 3)};
        double q[3];
        const double laps = ceil((way + 2 - s[0]) / 24), lap = laps > 0 ? laps : 0;
        s[0] += 24 * lap - way;
        for (int k = 0; k < 3; k++)
            q[k] = c->T_CB.R[3 * k] * s[0] + c->T_CB.R[3 * k + 1] * s[1] +
                   c->T_CB.R[3 * k + 2] * s[2] + c->T_CB.p[k];
        plr_observation *o = &seen[count];
        const double uL = c->fx_px * q[0] / q[2] + c->cx_px;
        const double uR = uL - c->fx_px * c->baseline_m / q[2];
        const double v = c->fy_px * q[1] / q[2] + c->cy_px;
        if (fabs(uL - c->cx_px) > 400 || fabs(v - c->cy_px) > 300)
            continue;
        o->id = (uint32_t)(POINTS * lap) + i + 1;
        o->uL_px = (float)(uL + rng_normal(chance));
        o->uR_px = (float)(uR + rng_normal(chance));
        o->vL_px = (float)(v + rng_normal(chance));
        o->vR_px = (float)(v + rng_normal(chance));
        count++;
    }
    return (plr_frame){0, PLR_NO_BUDGET, (uint16_t)count, seen};
}

/* Neither turns nor changes of speed: scale, focal length and the camera's attitude cannot be told from a
 * velocity that is not known. */
static void test_constant_speed_without_a_turn_shows_no_scale(void) {
    static const double unknown[3] = {0.09, 0.09, 0.09}, v[3] = {1.5, 0, 0};
    static const plr_pose start = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};
    plr_filter *f = &imu_rig.filter;
    rng chance = rng_seeded(5);
    imu_rig_begin(IMU_RIG_GIVEN, 1);
    const plr_calibration camera = imu_rig.flight.calibration;
    plr_time_ns t_ns = 1000000000;
    imu_rig.config.calibrate = PLR_CALIBRATE_FOCAL | PLR_CALIBRATE_BASELINE | PLR_CALIBRATE_TURN;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(f, &camera, &imu_rig.config, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(f, t_ns, &start, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(f, v, unknown));
    const double a = imu_rig.options.accel_noise * 20, w = imu_rig.options.gyro_noise * 20;
    for (unsigned k = 1; k <= 40 * FRAMES; k++) {
        plr_imu imu = {{0, 0, imu_rig.config.gravity_mps2}, {0}};
        t_ns += 2500000;
        for (int i = 0; i < 3; i++) {
            imu.a_B_mps2[i] += a * rng_normal(&chance);
            imu.w_B_radps[i] += w * rng_normal(&chance);
        }
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(f, t_ns, &imu));
        if (k % 40 != 0)
            continue;
        plr_frame frame = corridor(&camera, v[0] * k / 400, &chance);
        frame.t_ns = t_ns;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(f, &frame, &imu_rig.report));
        TEST_ASSERT_TRUE(k < 400 || imu_rig.report.used > 5);
    }
    demand_untouched("constant speed", 0.8, 1);
}
