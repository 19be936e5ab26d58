// SPDX-License-Identifier: MIT
/* Command line and config file of the replay: what they give together, and what they refuse. */
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "posix/config_file.h"
#include "posix/options.h"
#include "posix/settings_text.h"

static replay_options options;
static char problem[PROBLEM_SIZE];
static char path[] = "test_settings_text_options.XXXXXX";

void setUp(void) {
    problem[0] = '\0';
    strcpy(path + strlen(path) - 6, PLR_REAL == 32 ? "32.tmp" : "64.tmp");
}

void tearDown(void) {
    remove(path);
}

/* The words behind the program's name, ended by NULL. */
static bool parse(const char *const *words) {
    char copies[16][128], *argv[17] = {(char *)"pelorus-replay"};
    int argc = 1;
    for (; words[argc - 1] != NULL; argc++) {
        snprintf(copies[argc - 1], sizeof copies[0], "%s", words[argc - 1]);
        argv[argc] = copies[argc - 1];
    }
    return options_parse(&options, argc, argv, problem);
}

#define PARSE(...) parse((const char *const[]){__VA_ARGS__, NULL})

/* The value that the overrides leave a setting with; -1 if they do not touch it. */
static double override_of(const char *name) {
    double value = -1;
    for (unsigned i = 0; i < options.override_count; i++)
        if (options.overrides[i].id == plr_setting_by_name(name)->id)
            value = options.overrides[i].value;
    return value;
}

static void write_file(const char *text) {
    FILE *file = fopen(path, "w");
    TEST_ASSERT_NOT_NULL(file);
    fputs(text, file);
    fclose(file);
}

static void assert_problem(const char *words) {
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(problem, words), problem);
}

/* --- command line --- */

static void test_both_ways_of_giving_a_value_are_the_same(void) {
    TEST_ASSERT_TRUE(PARSE("in.plr", "--slots", "7", "--pixel-sigma=2.5", "--bias", "on"));
    TEST_ASSERT_EQUAL_STRING("in.plr", options.input);
    TEST_ASSERT_EQUAL_DOUBLE(7, override_of("slots"));
    TEST_ASSERT_EQUAL_DOUBLE(2.5, override_of("pixel-sigma"));
    TEST_ASSERT_EQUAL_DOUBLE(1, override_of("bias"));
    TEST_ASSERT_EQUAL_DOUBLE(-1, override_of("model"));
}

static void test_every_row_of_the_table_is_an_option(void) {
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *s = plr_setting_at(i);
        char name[80], text[128];
        snprintf(name, sizeof name, "--%s", s->name);
        if (s->choices != NULL)
            setting_value_to_text(s, s->maximum, text, sizeof text);
        else
            snprintf(text, sizeof text, "%.17g", s->maximum);
        TEST_ASSERT_TRUE_MESSAGE(PARSE("in.plr", name, text), name);
        TEST_ASSERT_EQUAL_DOUBLE(s->maximum, override_of(s->name));
    }
}

static void test_paths_flags_and_start_are_taken(void) {
    TEST_ASSERT_TRUE(PARSE("--trajectory", "a", "--out=d", "--json", "--quiet", "--start",
                           "identity", "--deadline", "1500", "in.plr"));
    TEST_ASSERT_EQUAL_STRING("a", options.trajectory);
    TEST_ASSERT_EQUAL_STRING("d", options.out);
    TEST_ASSERT_TRUE(options.json && options.quiet && !options.help && !options.print_config);
    TEST_ASSERT_EQUAL_INT(PLR_START_IDENTITY, options.start);
    TEST_ASSERT_EQUAL_UINT32(1500, options.deadline_us);
}

static void test_behind_two_dashes_everything_is_a_path(void) {
    TEST_ASSERT_TRUE(PARSE("--json", "--", "--slots"));
    TEST_ASSERT_EQUAL_STRING("--slots", options.input);
    TEST_ASSERT_TRUE(PARSE("-"));
    TEST_ASSERT_EQUAL_STRING("-", options.input);
}

static void test_what_is_wrong_is_named_with_what_would_be_right(void) {
    TEST_ASSERT_FALSE(PARSE("in.plr", "--gate", "1.5"));
    assert_problem("--gate 1.5: should be a probability above 0 and below 1, or off");
    TEST_ASSERT_FALSE(PARSE("in.plr", "--model", "mars"));
    assert_problem("--model mars: should be body or world");
    TEST_ASSERT_FALSE(PARSE("in.plr", "--slots", "0"));
    assert_problem("--slots 0: should be a whole number from 1 to");
    TEST_ASSERT_FALSE(PARSE("in.plr", "--pixel-sgima", "2"));
    assert_problem("is --pixel-sigma meant?");
    TEST_ASSERT_FALSE(PARSE("in.plr", "--set", "slots=8"));
    assert_problem("each setting is one here");
    TEST_ASSERT_FALSE(PARSE("in.plr", "--frobnicate"));
    assert_problem("--help");
    TEST_ASSERT_FALSE(PARSE("in.plr", "-q"));
    assert_problem("unknown option");
    TEST_ASSERT_FALSE(PARSE("in.plr", "--slots"));
    assert_problem("a value is missing");
    TEST_ASSERT_FALSE(PARSE("in.plr", "--json=yes"));
    assert_problem("takes no value");
    TEST_ASSERT_FALSE(PARSE("one.plr", "two.plr"));
    assert_problem("one recording at a time");
    TEST_ASSERT_FALSE(PARSE("in.plr", "--start", "home"));
    assert_problem("truth, identity, recorded");
    TEST_ASSERT_FALSE(PARSE("in.plr", "--preset", "fast"));
    assert_problem("should be course");
    TEST_ASSERT_FALSE(PARSE("in.plr", "--deadline", "-5"));
    assert_problem("microseconds");
    TEST_ASSERT_FALSE(PARSE("in.plr", "--out="));
    assert_problem("path of a file");
}

static void test_very_long_words_are_refused_and_overflow_nothing(void) {
    char name[600], *argv[] = {(char *)"pelorus-replay", name, name};
    memset(name, 'x', sizeof name - 1);
    name[sizeof name - 1] = '\0';
    name[0] = name[1] = '-';
    TEST_ASSERT_FALSE(options_parse(&options, 2, argv, problem));
    memcpy(name, "--model=", 8);
    TEST_ASSERT_FALSE(options_parse(&options, 2, argv, problem));
    name[0] = 'a';
    TEST_ASSERT_FALSE(options_parse(&options, 3, argv, problem));
}

/* --- gate and preset --- */

static void test_the_gate_by_probability_switches_the_courses_off(void) {
    TEST_ASSERT_TRUE(PARSE("in.plr", "--preset", "course", "--gate", "0.95"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 9.488, override_of("gate-d2"));
    TEST_ASSERT_EQUAL_DOUBLE(0, override_of("gate-residual"));
    TEST_ASSERT_TRUE(PARSE("in.plr", "--gate", "off"));
    TEST_ASSERT_EQUAL_DOUBLE(0, override_of("gate-d2"));
}

static void test_the_preset_is_under_the_options_wherever_it_stands(void) {
    plr_config course;
    plr_config_course(&course);
    TEST_ASSERT_TRUE(PARSE("in.plr", "--pixel-sigma", "7", "--preset", "course"));
    TEST_ASSERT_EQUAL_DOUBLE(7, override_of("pixel-sigma"));
    TEST_ASSERT_EQUAL_DOUBLE(PLR_MODEL_WORLD, override_of("model"));
    TEST_ASSERT_EQUAL_DOUBLE(PLR_NOISE_STEP, override_of("noise"));
    TEST_ASSERT_EQUAL_DOUBLE(PLR_TWIST_START, override_of("twist-timing"));
    TEST_ASSERT_EQUAL_DOUBLE(course.landmark_sigma_m, override_of("landmark-sigma"));
    TEST_ASSERT_EQUAL_DOUBLE(course.gate_residual_px, override_of("gate-residual"));
    TEST_ASSERT_EQUAL_DOUBLE(-1, override_of("slots"));
    TEST_ASSERT_EQUAL_DOUBLE(-1, override_of("mode"));
}

/* --- config file --- */

static void test_options_win_over_the_file_and_the_files_preset_over_nothing_of_them(void) {
    write_file("# a comment\n\n  slots = 9  # another\npixel-sigma=4\npreset = course\r\n"
               "start = truth\nmodel = body");
    TEST_ASSERT_TRUE(PARSE("in.plr", "--config", path, "--slots", "5"));
    TEST_ASSERT_EQUAL_DOUBLE(5, override_of("slots"));
    TEST_ASSERT_EQUAL_DOUBLE(4, override_of("pixel-sigma"));
    TEST_ASSERT_EQUAL_DOUBLE(PLR_MODEL_BODY, override_of("model"));
    TEST_ASSERT_EQUAL_DOUBLE(PLR_NOISE_STEP, override_of("noise"));
    TEST_ASSERT_EQUAL_INT(PLR_START_TRUTH, options.start);
    TEST_ASSERT_TRUE(PARSE("in.plr", "--config", path, "--start", "recorded"));
    TEST_ASSERT_EQUAL_INT(PLR_START_RECORDED, options.start);
}

static void check_bad_file(const char *text, const char *words) {
    write_file(text);
    TEST_ASSERT_FALSE_MESSAGE(PARSE("in.plr", "--config", path), text);
    assert_problem(path);
    assert_problem(words);
}

static void test_a_bad_line_is_named_by_file_and_number(void) {
    char longest[1200];
    check_bad_file("slots = 3\n\nmodel = mars\n", "line 3: model mars: should be body or world");
    check_bad_file("slots 3\n", "line 1: slots 3: should be `name = value`");
    check_bad_file("\nsize = 3\n", "line 2: size is not a setting");
    check_bad_file("out = x.plr\n", "out is not a setting");
    check_bad_file("slots = 8\n# eight\nslots = 9\n", "line 3: slots is set in line 1 already");
    check_bad_file("gate = off\n\ngate = 0.9\n", "line 3: gate is set in line 1 already");
    check_bad_file("slots =\n", "should be a whole number");
    memset(longest, '#', sizeof longest - 1);
    longest[sizeof longest - 1] = '\0';
    check_bad_file(longest, "longer than");
}

static void test_a_file_that_is_not_there_is_named(void) {
    TEST_ASSERT_FALSE(PARSE("in.plr", "--config", "no/such.conf"));
    assert_problem("no/such.conf: No such file");
}
