// SPDX-License-Identifier: MIT
/*
 * A calibration that is estimated by twists: a drawn one is found where the twists' errors are white, and
 * where they last for seconds, as those of wheels do, it stays within what is told of it.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "pelorus/filter.h"
#include "support/chi_square.h"
#include "support/scene.h"
#include "support/state_bytes.h"
#include "support/wrong_camera.h"

enum { RUNS = PELORUS_SHORT_FORM ? 3 : 12, FRAMES = PELORUS_SHORT_FORM ? 200 : 600 };
enum { ERRORS = PLR_CAMERA_TURN_Z + 1, STEP_NS = 100000000 };

static plr_filter filter;
static plr_config config;
static scene world;
static double drawn[PLR_CALIBRATION_ERRORS]; /* what is to be corrected */

void setUp(void) {
    plr_config_default(&config);
    config.calibrate = PLR_CALIBRATE_BASELINE | PLR_CALIBRATE_FOCAL | PLR_CALIBRATE_TURN;
    config.twist_timing = PLR_TWIST_START;
}

static void begin(uint64_t seed) {
    static const plr_pose start = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};
    rng chance = rng_seeded(500 + seed);
    scene_options options;
    wrong_camera_draw(&chance, &config, drawn);
    scene_options_default(&options);
    options.seed = seed;
    scene_start(&world, &options);
    for (unsigned i = 0; i < 3; i++) {
        config.velocity_sigma[i] = options.velocity_sigma_mps;
        config.gyro_sigma[i] = options.gyro_sigma_radps;
    }
    config.pixel_sigma_px = options.pixel_sigma_px;
    const plr_calibration told = wrong_camera(&world.calibration, drawn);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &told, &config, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&filter, world.t_ns, &start, NULL));
}

/* Twists whose errors, of the stated sigma, keep `share` of themselves from one to the next. */
static void drive(double share) {
    rng chance = rng_seeded(700 + world.is.seed);
    double error[6] = {0};
    for (unsigned k = 0; k < FRAMES; k++) {
        plr_twist u;
        scene_true_twist(&world, &u);
        for (unsigned i = 0; i < 6; i++) {
            const double sigma = i < 3 ? world.is.velocity_sigma_mps : world.is.gyro_sigma_radps;
            error[i] = share * error[i] + sqrt(1 - share * share) * sigma * rng_normal(&chance);
            *(i < 3 ? &u.v_B_mps[i] : &u.w_B_radps[i - 3]) += error[i];
        }
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, world.t_ns, &u));
        scene_move(&world, STEP_NS);
        plr_frame frame = scene_look(&world);
        plr_report report;
        frame.t_ns = world.t_ns;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &frame, &report));
    }
}

/* The mean of e^T Sigma^-1 e a degree of freedom, Sigma = G D G^T; and the largest told sigma of the focal
 * length beside its prior's. */
static double squared_errors(double share, double *focal_left) {
    double sum = 0;
    *focal_left = 0;
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        double Sigma[ERRORS * ERRORS];
        begin(seed);
        drive(share);
        TEST_ASSERT_EQUAL_UINT(ERRORS, filter.camera.errors.count);
        wrong_camera_covariance(&filter, Sigma);
        *focal_left = fmax(*focal_left, sqrt(Sigma[ERRORS + 1]) / config.focal_sigma);
        sum += wrong_camera_squared_error(&filter, drawn) / (RUNS * ERRORS);
    }
    printf("share %.2f: calibration %.3f, focal length's sigma at most %.3f of the prior's\n",
           share, sum, *focal_left);
    return sum;
}

static void test_a_calibration_is_found_where_errors_of_twists_are_white(void) {
    double left;
    chi_square_demand("calibration", squared_errors(0, &left), RUNS * ERRORS);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.5, left);
}

/* Without a look at how the residuals add up it is 5.6. */
static void test_errors_that_last_for_seconds_are_not_taken_for_the_calibration(void) {
    double left;
    TEST_ASSERT_LESS_THAN_DOUBLE(2, squared_errors(0.95, &left));
}

static void test_a_saved_state_goes_on_with_what_is_usual(void) {
    static plr_filter other;
    static state_bytes state;
    config.slots = 12;
    begin(1);
    drive(0.95);
    const plr_calibration told = wrong_camera(&world.calibration, drawn);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&other, &told, &config, NULL));
    state_bytes_save(&state, &filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &other));
    TEST_ASSERT_TRUE(filter.camera.estimate.excess > 2);
    TEST_ASSERT_EQUAL_MEMORY(&filter.camera.estimate, &other.camera.estimate,
                             sizeof other.camera.estimate);
    TEST_ASSERT_TRUE(state_bytes_same_filter(&filter, &other));
}
