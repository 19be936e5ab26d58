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
#include "support/reseal.h"
#include "support/rigid.h"
#include "support/state_bytes.h"
#include "support/wrong_camera.h"

enum { RUNS = PELORUS_SHORT_FORM ? 3 : 12, FRAMES = PELORUS_SHORT_FORM ? 100 : 200 };
enum { REST = PELORUS_SHORT_FORM ? 1000 : 4000 };
enum { ERRORS = PLR_WHEEL_SCALE, EVERYTHING = 63 };

static double drawn[PLR_CALIBRATION_ERRORS]; /* what is to be corrected */
static unsigned late;                        /* readings by which frames are stamped late */

void setUp(void) {
    plr_config *c = &imu_rig.config;
    imu_rig_set_up();
    late = 2;
    c->calibrate = EVERYTHING;
    c->focal_sigma = 0.007;
    c->baseline_sigma = 0.006;
    c->camera_turn_sigma_rad = 0.008;
    c->centre_sigma_px = 3;
    c->camera_place_sigma_m = 0.02;
    c->camera_clock_sigma_s = 0.005;
}

/* ---------------------------------------------------------------- a wrong calibration */

static void begin(imu_rig_start start, uint64_t seed) {
    static const double exact[3] = {1e-6, 1e-6, 1e-6};
    rng chance = rng_seeded(1000 + seed);
    double T[16], v[3];
    plr_pose pose;
    wrong_camera_draw(&chance, &imu_rig.config, drawn);
    drawn[PLR_CAMERA_CLOCK] = -(double)late / imu_rig.options.rate_hz;
    imu_rig_begin(start, seed);
    const plr_calibration told = wrong_camera(&imu_rig.flight.calibration, drawn);
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
        imu_rig_readings(IMU_RIG_EVERY - late);
        plr_frame frame = imu_flight_look(&imu_rig.flight);
        memcpy(seen, frame.observations, frame.count * sizeof *seen);
        imu_rig_readings(late);
        frame.observations = seen;
        frame.t_ns = imu_rig.flight.t_ns;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&imu_rig.filter, &frame, &imu_rig.report));
    }
}

/* ---------------------------------------------------------------- what was learnt */

static void demand_consistent(void) {
    imu_rig_errors sum = {0};
    double calibration = 0;
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        begin(IMU_RIG_GIVEN, seed);
        fly(FRAMES);
        const imu_rig_errors e = imu_rig_errors_now();
        imu_rig_add(&sum, &e, 1.0 / RUNS);
        TEST_ASSERT_EQUAL_UINT(ERRORS, imu_rig.filter.camera.errors.count);
        calibration += wrong_camera_squared_error(&imu_rig.filter, drawn) / (RUNS * ERRORS);
    }
    printf("calibration %.3f\n", calibration);
    chi_square_demand("calibration", calibration, RUNS * ERRORS);
    imu_rig_demand_consistent("state", &sum, RUNS, true);
}

static void test_errors_of_calibration_and_state_stay_within_their_covariance(void) {
    demand_consistent();
}

static void test_so_do_they_with_a_late_camera_in_a_hand_that_swings(void) {
    late = 4;
    imu_rig.options.swing = 5;
    demand_consistent();
}

/* The angle between where the filter has the camera, turned back by its clock's offset, and the truth. */
static double misplaced_rad(double offset_s) {
    const plr_filter *f = &imu_rig.filter;
    imu_flight there = imu_rig.flight;
    double now[16], then[16], back[16], way[16], v[3], T_CB[16], seen[16], R[9], sum = 0;
    there.t_ns += (plr_time_ns)(int64_t)(offset_s * 1e9);
    imu_flight_truth(&imu_rig.flight, now, v);
    imu_flight_truth(&there, then, v);
    rigid_inverse(back, then);
    square_multiply(4, back, now, way);
    rigid_from_pose(T_CB, &imu_rig.flight.calibration.T_CB);
    square_multiply(4, T_CB, way, seen); /* points of the body now in the camera then */
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++) {
            R[3 * i + j] = -seen[4 * i + j];
            for (unsigned k = 0; k < 3; k++)
                R[3 * i + j] += (double)(f->camera.estimate.eye.R_CB[3 * i + k] *
                                         f->camera.given.R_CB[3 * k + j]);
            sum += R[3 * i + j] * R[3 * i + j];
        }
    return sqrt(sum / 2);
}

/* Over the offset the rate changes: by its value at the frame's time it would be 4e-4 rad with 10 ms. */
static void test_the_camera_is_where_it_was_at_its_clocks_time(void) {
    static const double offset_s[] = {-0.01, -0.005, 0.005};
    for (unsigned i = 0; i < sizeof offset_s / sizeof *offset_s; i++) {
        plr_config *c = &imu_rig.config;
        c->calibrate = PLR_CALIBRATE_CLOCK;
        c->focal_sigma = c->baseline_sigma = c->camera_turn_sigma_rad = 0;
        c->centre_sigma_px = c->camera_place_sigma_m = 0;
        imu_rig.options.swing = 5;
        imu_rig.options.gyro_noise = 1e-6;
        imu_rig.options.bias_gyro_sigma = 1e-6;
        begin(IMU_RIG_GIVEN, 1);
        imu_rig.filter.camera.estimate.moved[0] = (plr_real)offset_s[i];
        reseal(&imu_rig.filter);
        double worst = 0;
        for (unsigned k = 0; k < 60; k++) {
            imu_rig_readings(IMU_RIG_EVERY);
            const plr_frame dark = {imu_rig.flight.t_ns, PLR_NO_BUDGET, 0, NULL};
            TEST_ASSERT_EQUAL_INT(PLR_OK,
                                  plr_filter_update(&imu_rig.filter, &dark, &imu_rig.report));
            worst = fmax(worst, misplaced_rad(offset_s[i]));
        }
        printf("offset %.0f ms: %.2g rad\n", 1e3 * offset_s[i], worst);
        TEST_ASSERT_LESS_THAN_DOUBLE(1.5e-5, worst);
    }
}

static void test_a_saved_state_goes_on_with_what_was_learnt(void) {
    static plr_filter other;
    static state_bytes state;
    plr_filter *f = &imu_rig.filter;
    imu_rig.config.slots = 12;
    begin(IMU_RIG_GIVEN, 2);
    fly(40);
    const plr_calibration told = wrong_camera(&imu_rig.flight.calibration, drawn);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&other, &told, &imu_rig.config, NULL));
    state_bytes_save(&state, f);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &other));
    TEST_ASSERT_TRUE(f->camera.estimate.told[0] < 1);
    TEST_ASSERT_EQUAL_MEMORY(&f->camera.estimate, &other.camera.estimate,
                             sizeof other.camera.estimate);
    TEST_ASSERT_TRUE(state_bytes_same_filter(f, &other));
}

/* The told sigmas beside those of the prior, and how far the estimates have gone, in the latter. */
static void demand_untouched(const char *what, double least, double most_off) {
    plr_calibration_result now;
    const plr_error_columns *c = &imu_rig.filter.camera.errors;
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
