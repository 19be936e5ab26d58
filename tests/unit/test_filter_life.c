// SPDX-License-Identifier: MIT
/* Init and reset: what a new filter is, and whom init turns away. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/flush_to_zero.h"
#include "support/matrices.h"
#include "support/reseal.h"
#include "support/rig.h"

void setUp(void) {
    rig_set_up();
}

/* ---------------------------------------------------------------- init */

static void test_a_new_filter_stands_at_the_origin(void) {
    double P[36], b[6];
    const plr_pose pose = pose_of(&rig.filter);
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(rig_identity.R, pose.R, 9);
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(rig_identity.p, pose.p, 3);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    for (int i = 0; i < 36; i++)
        TEST_ASSERT_DOUBLE_WITHIN(
            1e-14, i % 7 == 0 ? rig.config.start_sigma * rig.config.start_sigma : 0, P[i]);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, largest(b, 6));
    TEST_ASSERT_EQUAL_UINT(0, plr_filter_landmark_count(&rig.filter));
    TEST_ASSERT_EQUAL_UINT64(0, plr_filter_time(&rig.filter));
}

static void test_the_bias_prior_is_that_of_the_settings(void) {
    double b[6], P[36];
    rig_begin_with(PLR_MODE_SLAM, true);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
    for (int i = 0; i < 36; i++) {
        const double sigma =
            i / 6 < 3 ? rig.config.bias_velocity_sigma_mps : rig.config.bias_gyro_sigma_radps;
        TEST_ASSERT_DOUBLE_WITHIN(2e-7 * sigma * sigma, i % 7 == 0 ? sigma * sigma : 0, P[i]);
    }
}

/* After a failed init the filter refuses every call. */
static void demand_dead(void) {
    plr_pose pose;
    plr_twist twist = {{0}, {0}};
    plr_frame frame = {0, PLR_NO_BUDGET, 0, NULL};
    plr_report report;
    plr_landmark landmark = {0};
    plr_totals totals;
    double x[36] = {0};
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_reset(&rig.filter));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY,
                          plr_filter_set_pose(&rig.filter, 1, &rig_identity, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_set_bias(&rig.filter, x, x));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_predict(&rig.filter, 1, &twist));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_move_to(&rig.filter, 1, &rig_identity));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_update(&rig.filter, &frame, &report));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, report.status);
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_pose(&rig.filter, &pose));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_pose_covariance(&rig.filter, x));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_velocity(&rig.filter, &twist));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_velocity_covariance(&rig.filter, x));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_bias(&rig.filter, x, x));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_landmark(&rig.filter, 0, &landmark));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_insert_known(&rig.filter, &landmark));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_flush_map(&rig.filter));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_totals(&rig.filter, &totals));
    TEST_ASSERT_EQUAL_UINT(0, plr_filter_landmark_count(&rig.filter));
    TEST_ASSERT_EQUAL_UINT64(0, plr_filter_time(&rig.filter));
    TEST_ASSERT_EQUAL_DOUBLE(0, plr_filter_trace(&rig.filter));
    TEST_ASSERT_NULL(plr_filter_config(&rig.filter));
}

static void demand_init_refusal(plr_status expected) {
    rig_drive(5); /* so that there is a life to end */
    TEST_ASSERT_EQUAL_INT(expected,
                          plr_filter_init(&rig.filter, &rig.calibration, &rig.config, NULL));
    demand_dead();
    setUp();
}

static void test_init_refuses_null_pointers(void) {
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT,
                          plr_filter_init(NULL, &rig.calibration, &rig.config, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_init(&rig.filter, NULL, &rig.config, NULL));
    demand_dead();
    setUp();
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT,
                          plr_filter_init(&rig.filter, &rig.calibration, NULL, NULL));
    demand_dead();
}

static void test_init_refuses_a_config_without_sense(void) {
    rig.config.pixel_sigma_px = -1;
    demand_init_refusal(PLR_E_CONFIG);
}

/* Of each number of the calibration: what is no such number. */
static void test_init_refuses_an_impossible_calibration(void) {
    static const double never[] = {(double)NAN, (double)INFINITY, -(double)INFINITY, 1e300, -1e300};
    static const double not_positive[] = {0, -1, 1e-300, 1e-40};
    double *const any[] = {&rig.calibration.cx_px, &rig.calibration.cy_px,
                           &rig.calibration.T_CB.p[0], &rig.calibration.T_CB.p[2]};
    double *const positive[] = {&rig.calibration.fx_px, &rig.calibration.fy_px,
                                &rig.calibration.baseline_m};
    for (unsigned k = 0; k < sizeof never / sizeof *never; k++) {
        for (unsigned i = 0; i < sizeof any / sizeof *any; i++) {
            *any[i] = never[k];
            demand_init_refusal(PLR_E_CALIBRATION);
        }
        for (unsigned i = 0; i < sizeof positive / sizeof *positive; i++) {
            *positive[i] = never[k];
            demand_init_refusal(PLR_E_CALIBRATION);
        }
        rig.calibration.T_CB.R[4] = never[k];
        demand_init_refusal(PLR_E_CALIBRATION);
    }
    for (unsigned k = 0; k < sizeof not_positive / sizeof *not_positive; k++)
        for (unsigned i = 0; i < sizeof positive / sizeof *positive; i++) {
            *positive[i] = not_positive[k];
            demand_init_refusal(PLR_E_CALIBRATION);
        }
}

static void test_init_refuses_an_extrinsic_that_is_no_rotation(void) {
    rig.calibration.T_CB.R[0] = -rig.calibration.T_CB.R[0];
    demand_init_refusal(PLR_E_CALIBRATION);
    for (int i = 0; i < 9; i++)
        rig.calibration.T_CB.R[i] = -rig.calibration.T_CB.R[i]; /* a mirror */
    demand_init_refusal(PLR_E_CALIBRATION);
}

static bool no_source(void *context, uint32_t id, plr_landmark *landmark) {
    (void)context;
    (void)id;
    (void)landmark;
    return false;
}

static void test_localization_wants_a_source(void) {
    const plr_map empty = {NULL, NULL, NULL}, map = {.source = no_source};
    rig.config.mode = PLR_MODE_LOCALIZATION;
    TEST_ASSERT_EQUAL_INT(PLR_E_MODE,
                          plr_filter_init(&rig.filter, &rig.calibration, &rig.config, &empty));
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_init(&rig.filter, &rig.calibration, &rig.config, &map));
    demand_init_refusal(PLR_E_MODE);
}

static void test_init_refuses_a_processor_that_flushes_subnormals(void) {
    if (!flush_to_zero(true))
        TEST_IGNORE_MESSAGE("this processor cannot be told to flush subnormals to zero");
    const plr_status status = plr_filter_init(&rig.filter, &rig.calibration, &rig.config, NULL);
    flush_to_zero(false);
    TEST_ASSERT_EQUAL_INT(PLR_E_CPU, status);
    demand_dead();
}

static void test_init_copies_what_it_is_given(void) {
    plr_map map = {.source = no_source};
    rig.config.mode = PLR_MODE_LOCALIZATION;
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_init(&rig.filter, &rig.calibration, &rig.config, &map));
    const plr_config given = rig.config;
    memset(&map, 0xFF, sizeof map);
    memset(&rig.config, 0xFF, sizeof rig.config);
    memset(&rig.calibration, 0xFF, sizeof rig.calibration);
    TEST_ASSERT_EQUAL_MEMORY(&given, plr_filter_config(&rig.filter), sizeof given);
    const plr_frame frame = scene_look(&rig.world);
    plr_report report;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &report));
    TEST_ASSERT_EQUAL_UINT16(frame.count, report.poor); /* the source knows none of them */
}

/* ---------------------------------------------------------------- reset */

static void test_reset_gives_the_filter_of_the_first_day(void) {
    static plr_filter second;
    rig.config.bias = true;
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_init(&rig.filter, &rig.calibration, &rig.config, NULL));
    rig_drive(5);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_reset(&rig.filter));
    TEST_ASSERT_EQUAL_UINT64(0, plr_filter_time(&rig.filter));
    TEST_ASSERT_EQUAL_UINT(0, plr_filter_landmark_count(&rig.filter));
    const plr_totals none = {0};
    TEST_ASSERT_EQUAL_MEMORY(&none, &rig.filter.totals, sizeof none);

    /* and lives as a new one does, bit for bit */
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&second, &rig.calibration, &rig.config, NULL));
    const scene start = rig.world;
    rig_drive(5);
    memcpy(&rig.before, &rig.filter, sizeof rig.before);
    rig.world = start;
    memcpy(&rig.filter, &second, sizeof rig.filter);
    rig_drive(5);
    const unsigned n = 12 + 3 * rig.filter.belief.count;
    TEST_ASSERT_EQUAL_UINT(rig.before.belief.count, rig.filter.belief.count);
    TEST_ASSERT_TRUE(same_bits(rig.before.belief.P, rig.filter.belief.P, n * (n + 1) / 2));
    TEST_ASSERT_TRUE(same_bits(rig.before.belief.R_WB, rig.filter.belief.R_WB, 9));
    TEST_ASSERT_EQUAL_MEMORY(rig.before.belief.p_WB, rig.filter.belief.p_WB,
                             sizeof rig.filter.belief.p_WB);
    TEST_ASSERT_EQUAL_MEMORY(&rig.before.totals, &rig.filter.totals, sizeof rig.filter.totals);
}

static void test_reset_heals_a_diverged_filter(void) {
    rig_drive(5);
    spoil_covariance(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_reset(&rig.filter));
    setUp();
    rig_drive(5); /* demands PLR_OK of every frame */
}

static void test_reset_wants_a_filter(void) {
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_reset(NULL));
}
