// SPDX-License-Identifier: MIT
/* The table of settings: names, numbers, limits, and what it refuses. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "pelorus/config.h"
#include "pelorus/settings.h"

static plr_config config;

void setUp(void) {
    plr_config_default(&config);
}

static const plr_setting *by_name(const char *name) {
    const plr_setting *setting = plr_setting_by_name(name);
    TEST_ASSERT_NOT_NULL_MESSAGE(setting, name);
    return setting;
}

static double get(const char *name) {
    return plr_config_get(&config, by_name(name));
}

static plr_status set(const char *name, double value) {
    return plr_config_set(&config, by_name(name), value);
}

/* ---------------------------------------------------------------- the table */

static void test_every_row_is_found_by_its_id_and_its_name(void) {
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *row = plr_setting_at(i);
        TEST_ASSERT_NOT_NULL(row);
        TEST_ASSERT_EQUAL_PTR(row, plr_setting_by_id(row->id)); /* so no id stands twice */
        TEST_ASSERT_EQUAL_PTR(row, plr_setting_by_name(row->name));
        TEST_ASSERT_GREATER_THAN_UINT(0, strlen(plr_setting_about(row)));
        TEST_ASSERT_TRUE(row->minimum <= row->standard && row->standard <= row->maximum);
    }
}

static void test_beyond_the_table_there_is_nothing(void) {
    TEST_ASSERT_NULL(plr_setting_at(plr_setting_count()));
    TEST_ASSERT_NULL(plr_setting_by_id(0));
    TEST_ASSERT_NULL(plr_setting_by_id(255));
    TEST_ASSERT_NULL(plr_setting_by_name("pixel_sigma"));
    TEST_ASSERT_NULL(plr_setting_by_name(""));
    TEST_ASSERT_NULL(plr_setting_by_name(NULL));
}

/* docs/REPLAY-FORMAT.md, CONFIG: a number is never used again for another setting. */
static void test_ids_are_those_of_the_frame_format(void) {
    static const char *const names[] = {"model",
                                        "mode",
                                        "bias",
                                        "slots",
                                        "known-map",
                                        "twist-timing",
                                        "noise",
                                        "pixel-sigma",
                                        "velocity-sigma",
                                        "gyro-sigma",
                                        "bias-velocity-sigma",
                                        "bias-gyro-sigma",
                                        "bias-velocity-walk",
                                        "bias-gyro-walk",
                                        "gate-d2",
                                        "gate-residual",
                                        "min-disparity",
                                        "max-depth",
                                        "max-row-gap",
                                        "min-depth",
                                        "start-sigma",
                                        "landmark-sigma",
                                        "max-range",
                                        "max-gap",
                                        "twist-delay",
                                        "landmark-prior",
                                        "velocity-sigma-y",
                                        "velocity-sigma-z",
                                        "gyro-sigma-y",
                                        "gyro-sigma-z"};
    for (unsigned i = 0; i < sizeof names / sizeof *names; i++)
        TEST_ASSERT_EQUAL_UINT_MESSAGE(i + 1, by_name(names[i])->id, names[i]);
}

static void test_words_of_choices_have_their_numbers(void) {
    const plr_setting *model = by_name("model"), *mode = by_name("mode"), *bias = by_name("bias");
    const plr_setting *timing = by_name("twist-timing"), *noise = by_name("noise");
    TEST_ASSERT_EQUAL_STRING("body", model->choices[PLR_MODEL_BODY]);
    TEST_ASSERT_EQUAL_STRING("world", model->choices[PLR_MODEL_WORLD]);
    TEST_ASSERT_EQUAL_STRING("slam", mode->choices[PLR_MODE_SLAM]);
    TEST_ASSERT_EQUAL_STRING("mapping", mode->choices[PLR_MODE_MAPPING]);
    TEST_ASSERT_EQUAL_STRING("localization", mode->choices[PLR_MODE_LOCALIZATION]);
    TEST_ASSERT_EQUAL_STRING("dead_reckoning", mode->choices[PLR_MODE_DEAD_RECKONING]);
    TEST_ASSERT_EQUAL_STRING("start", timing->choices[PLR_TWIST_START]);
    TEST_ASSERT_EQUAL_STRING("end", timing->choices[PLR_TWIST_END]);
    TEST_ASSERT_EQUAL_STRING("mid", timing->choices[PLR_TWIST_MID]);
    TEST_ASSERT_EQUAL_STRING("twist", noise->choices[PLR_NOISE_TWIST]);
    TEST_ASSERT_EQUAL_STRING("step", noise->choices[PLR_NOISE_STEP]);
    const plr_setting *prior = by_name("landmark-prior");
    TEST_ASSERT_EQUAL_STRING("correlated", prior->choices[PLR_PRIOR_CORRELATED]);
    TEST_ASSERT_EQUAL_STRING("independent", prior->choices[PLR_PRIOR_INDEPENDENT]);
    TEST_ASSERT_EQUAL_STRING("off", bias->choices[0]);
    TEST_ASSERT_EQUAL_STRING("on", bias->choices[1]);
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *row = plr_setting_at(i);
        const bool is_list = row->kind == PLR_SETTING_LIST;
        const bool is_one = row->kind == PLR_SETTING_CHOICE || row->kind == PLR_SETTING_SWITCH;
        unsigned words = 0;
        TEST_ASSERT_EQUAL(is_one || is_list, row->choices != NULL);
        while (row->choices != NULL && row->choices[words] != NULL)
            words++;
        if (is_one || is_list)
            TEST_ASSERT_EQUAL_UINT((unsigned)row->maximum + 1, is_list ? 1U << words : words);
    }
}

/* ---------------------------------------------------------------- values */

static void test_default_is_the_standard_of_every_row_and_passes_the_check(void) {
    const plr_setting *culprit;
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *row = plr_setting_at(i);
        TEST_ASSERT_EQUAL_DOUBLE(row->standard, plr_config_get(&config, row));
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_config_check(&config, &culprit));
    TEST_ASSERT_NULL(culprit);
}

static void test_defaults_are_those_that_the_documentation_gives(void) {
    TEST_ASSERT_EQUAL_UINT(PLR_MODEL_BODY, config.model);
    TEST_ASSERT_EQUAL_UINT(PLR_MODE_SLAM, config.mode);
    TEST_ASSERT_EQUAL_UINT(1, config.bias);
    TEST_ASSERT_EQUAL_DOUBLE(2, config.pixel_sigma_px);
    TEST_ASSERT_EQUAL_DOUBLE(1e-8, config.bias_velocity_walk);
    TEST_ASSERT_EQUAL_DOUBLE(1e-10, config.bias_gyro_walk);
    TEST_ASSERT_EQUAL_DOUBLE(0.3, config.min_depth_m);
    TEST_ASSERT_EQUAL_DOUBLE(0, config.landmark_sigma_m);
    /* chi-square, 4 degrees of freedom: (1 + x/2) exp(-x/2) = 1 % lie beyond */
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.01, (1 + config.gate_d2 / 2) * exp(-config.gate_d2 / 2));
}

static void test_every_setting_takes_its_limits_and_gives_them_back(void) {
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *row = plr_setting_at(i);
        const double ends[2] = {row->minimum, row->maximum};
        for (int end = 0; end < 2; end++) {
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_config_set(&config, row, ends[end]));
            TEST_ASSERT_EQUAL_DOUBLE(ends[end], plr_config_get(&config, row));
        }
    }
}

static void test_values_outside_the_limits_are_refused_and_change_nothing(void) {
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *row = plr_setting_at(i);
        const double wrong[] = {row->minimum - 1, nextafter(row->minimum, -1e300),
                                row->maximum + 1, row->maximum * 1.001 + 1e-9,
                                (double)NAN,      (double)INFINITY,
                                -(double)INFINITY};
        for (unsigned k = 0; k < sizeof wrong / sizeof *wrong; k++) {
            const plr_config before = config;
            TEST_ASSERT_EQUAL_INT_MESSAGE(PLR_E_CONFIG, plr_config_set(&config, row, wrong[k]),
                                          row->name);
            TEST_ASSERT_EQUAL_MEMORY(&before, &config, sizeof config);
        }
    }
}

static void test_whole_numbers_take_no_fractions(void) {
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, set("slots", 1.5));
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, set("bias", 0.5));
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, set("mode", 2.0001));
    TEST_ASSERT_EQUAL_INT(PLR_OK, set("pixel-sigma", 1.5));
}

static void test_setting_one_value_leaves_all_others(void) {
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        setUp();
        TEST_ASSERT_EQUAL_INT(
            PLR_OK, plr_config_set(&config, plr_setting_at(i), plr_setting_at(i)->maximum));
        for (unsigned j = 0; j < plr_setting_count(); j++)
            if (j != i && plr_setting_of_axis(plr_setting_at(j)) != plr_setting_at(i))
                TEST_ASSERT_EQUAL_DOUBLE(plr_setting_at(j)->standard,
                                         plr_config_get(&config, plr_setting_at(j)));
    }
}

static void test_a_sigma_is_of_all_axes_or_of_each(void) {
    static const char *const names[2][3] = {
        {"velocity-sigma", "velocity-sigma-y", "velocity-sigma-z"},
        {"gyro-sigma", "gyro-sigma-y", "gyro-sigma-z"}};
    const double *const sigmas[2] = {config.velocity_sigma, config.gyro_sigma};
    for (unsigned k = 0; k < 2; k++) {
        const plr_setting *const whole = by_name(names[k][0]);
        TEST_ASSERT_EQUAL_INT(PLR_OK, set(names[k][0], 0.5));
        for (unsigned axis = 0; axis < 3; axis++) {
            TEST_ASSERT_EQUAL_DOUBLE(0.5, sigmas[k][axis]);
            TEST_ASSERT_EQUAL_PTR(by_name(names[k][axis]), plr_setting_axis(whole, axis));
            TEST_ASSERT_EQUAL_PTR(axis > 0 ? whole : NULL,
                                  plr_setting_of_axis(by_name(names[k][axis])));
        }
        TEST_ASSERT_NULL(plr_setting_axis(whole, 3));
        TEST_ASSERT_EQUAL_INT(PLR_OK, set(names[k][1], 0.25));
        TEST_ASSERT_EQUAL_INT(PLR_OK, set(names[k][2], 0.125));
        TEST_ASSERT_EQUAL_DOUBLE(0.5, sigmas[k][0]);
        TEST_ASSERT_EQUAL_DOUBLE(0.25, sigmas[k][1]);
        TEST_ASSERT_EQUAL_DOUBLE(0.125, sigmas[k][2]);
    }
    TEST_ASSERT_NULL(plr_setting_axis(by_name("pixel-sigma"), 0));
    TEST_ASSERT_NULL(plr_setting_axis(by_name("gyro-sigma-y"), 0));
    TEST_ASSERT_NULL(plr_setting_axis(NULL, 0));
    TEST_ASSERT_NULL(plr_setting_of_axis(by_name("pixel-sigma")));
    TEST_ASSERT_NULL(plr_setting_of_axis(NULL));
}

static void test_null_pointers_and_foreign_rows_are_refused(void) {
    const plr_setting foreign = *plr_setting_at(0);
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, plr_config_set(NULL, plr_setting_at(0), 0));
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, plr_config_set(&config, NULL, 0));
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, plr_config_set(&config, &foreign, 0));
    TEST_ASSERT_EQUAL_DOUBLE(0, plr_config_get(NULL, plr_setting_at(7)));
    TEST_ASSERT_EQUAL_DOUBLE(0, plr_config_get(&config, NULL));
}

/* ---------------------------------------------------------------- the check */

static void demand_culprit(const char *name) {
    const plr_setting *culprit = NULL;
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, plr_config_check(&config, &culprit));
    TEST_ASSERT_NOT_NULL(culprit);
    TEST_ASSERT_EQUAL_STRING(name, culprit->name);
    TEST_ASSERT_EQUAL_INT(PLR_E_CONFIG, plr_config_check(&config, NULL));
    TEST_ASSERT_NOT_NULL(plr_config_why(&config, &culprit));
    TEST_ASSERT_EQUAL_STRING(name, culprit->name);
}

static void test_the_check_names_the_field_that_is_wrong(void) {
    config.slots = 0;
    demand_culprit("slots");
    setUp();
    config.slots = PLR_MAX_LANDMARKS + 1;
    demand_culprit("slots");
    setUp();
    config.model = 2;
    demand_culprit("model");
    setUp();
    config.pixel_sigma_px = 0;
    demand_culprit("pixel-sigma");
    setUp();
    config.gyro_sigma[0] = (double)NAN;
    demand_culprit("gyro-sigma");
    setUp();
    config.velocity_sigma[2] = -1;
    demand_culprit("velocity-sigma-z");
    setUp();
    config.gate_d2 = -1;
    demand_culprit("gate-d2");
    setUp();
    config.max_gap_s = (double)INFINITY;
    demand_culprit("max-gap");
}

static void test_combinations_without_sense_are_refused(void) {
    config.landmark_sigma_m = 1; /* `body` knows its landmarks from the pixels alone */
    demand_culprit("landmark-sigma");
    config.model = PLR_MODEL_WORLD;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_config_check(&config, NULL));
    config.track_drift_px = 0.5; /* `body` alone tells a landmark by bearings */
    demand_culprit("track-drift");
    setUp();
    config.track_drift_px = 0.5;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_config_check(&config, NULL));
    config.min_depth_m = 50;
    config.max_range_m = 50;
    demand_culprit("min-depth");
    setUp();
    config.min_depth_m = 10;
    config.max_depth_m = 10; /* no landmark could be made */
    demand_culprit("max-depth");
    config.max_depth_m = 0; /* no limit */
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_config_check(&config, NULL));
}

static void test_an_independent_prior_needs_world_and_a_sigma_of_its_own(void) {
    config.landmark_prior = PLR_PRIOR_INDEPENDENT;
    demand_culprit("landmark-prior"); /* in `body` no landmark shares the pose's error anyway */
    config.model = PLR_MODEL_WORLD;
    demand_culprit("landmark-sigma"); /* from the pixels alone it would be far too sure */
    config.landmark_sigma_m = 1;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_config_check(&config, NULL));
}

static void demand_words(const char *words) {
    const plr_setting *culprit;
    const char *why = plr_config_why(&config, &culprit);
    TEST_ASSERT_NOT_NULL(why);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, words), why);
}

static void test_calibrate_beyond_the_builds_room_names_the_room(void) {
    const plr_setting *culprit;
    char room[48];
    snprintf(room, sizeof room, "PLR_MAX_CALIBRATION above %d,", PLR_MAX_CALIBRATION);
    config.calibrate = 63; /* 11 numbers */
    config.centre_sigma_px = 1;
    config.camera_place_sigma_m = 0.01;
    config.camera_clock_sigma_s = 0;
    demand_culprit("camera-clock-sigma");
    demand_words("above 0");
    config.camera_clock_sigma_s = 0.01;
    if (PLR_MAX_CALIBRATION >= 11) {
        TEST_ASSERT_NULL(plr_config_why(&config, &culprit));
        return;
    }
    demand_culprit("calibrate");
    demand_words(room);
}

static void test_an_option_that_a_build_lacks_is_named(void) {
    const plr_setting *culprit;
    config.known_map = 1;
    if (PLR_KNOWN_MAP)
        TEST_ASSERT_NULL(plr_config_why(&config, &culprit));
    else
        demand_words("PLR_KNOWN_MAP = 1");
    setUp();
    config.scene = PLR_SCENE_MAY_MOVE;
    if (PLR_SUPERVISE)
        TEST_ASSERT_NULL(plr_config_why(&config, &culprit));
    else
        demand_words("PLR_SUPERVISE = 1");
}

static void test_the_check_wants_a_config(void) {
    const plr_setting *culprit = plr_setting_at(0);
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_config_check(NULL, &culprit));
    TEST_ASSERT_NULL(culprit);
}

static void test_the_course_preset_has_the_numbers_of_the_report(void) {
    plr_config_course(&config);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_config_check(&config, NULL));
    TEST_ASSERT_EQUAL_DOUBLE(PLR_MODEL_WORLD, get("model"));
    TEST_ASSERT_EQUAL_DOUBLE(0, get("bias"));
    TEST_ASSERT_EQUAL_DOUBLE(PLR_TWIST_START, get("twist-timing"));
    TEST_ASSERT_EQUAL_DOUBLE(PLR_NOISE_STEP, get("noise"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 2, get("landmark-sigma") * get("landmark-sigma"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-18, 5e-4, get("start-sigma") * get("start-sigma"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 5, get("pixel-sigma") * get("pixel-sigma"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-18, 1e-3, get("velocity-sigma") * get("velocity-sigma"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-18, 1e-3, get("gyro-sigma") * get("gyro-sigma"));
    TEST_ASSERT_EQUAL_DOUBLE(PLR_PRIOR_INDEPENDENT, get("landmark-prior"));
    TEST_ASSERT_EQUAL_DOUBLE(20, get("gate-residual"));
    TEST_ASSERT_EQUAL_DOUBLE(30, get("max-depth"));
}
