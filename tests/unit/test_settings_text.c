// SPDX-License-Identifier: MIT
/* A setting's value as text and back; the gate from a probability. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "posix/gate.h"
#include "posix/settings_text.h"
#include "support/random.h"

static const plr_setting *row(const char *name) {
    const plr_setting *setting = plr_setting_by_name(name);
    TEST_ASSERT_NOT_NULL(setting);
    return setting;
}

static void test_every_setting_reads_back_what_is_written(void) {
    rng r = rng_seeded(1);
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *s = plr_setting_at(i);
        for (int n = 0; n < 50; n++) {
            double value = rng_uniform(&r, s->minimum, s->maximum), again = -1;
            char text[64];
            if (s->kind != PLR_SETTING_NUMBER)
                value = floor(value);
            setting_value_to_text(s, value, text, sizeof text);
            TEST_ASSERT_TRUE_MESSAGE(setting_value_from_text(s, text, &again), text);
            TEST_ASSERT_EQUAL_DOUBLE(value, again);
        }
    }
}

static void test_numbers_are_written_as_short_as_they_can_be(void) {
    char text[64];
    setting_value_to_text(row("pixel-sigma"), 0.1, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("0.1", text);
    setting_value_to_text(row("bias-gyro-walk"), 1e-10, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("1e-10", text);
    setting_value_to_text(row("slots"), 100, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("100", text);
}

static void test_words_are_taken_as_they_stand_in_the_table(void) {
    double value = -1;
    TEST_ASSERT_TRUE(setting_value_from_text(row("model"), "world", &value));
    TEST_ASSERT_EQUAL_DOUBLE(PLR_MODEL_WORLD, value);
    TEST_ASSERT_TRUE(setting_value_from_text(row("mode"), "dead_reckoning", &value));
    TEST_ASSERT_EQUAL_DOUBLE(PLR_MODE_DEAD_RECKONING, value);
    TEST_ASSERT_TRUE(setting_value_from_text(row("bias"), "on", &value));
    TEST_ASSERT_EQUAL_DOUBLE(1, value);
    TEST_ASSERT_FALSE(setting_value_from_text(row("bias"), "1", &value));
    TEST_ASSERT_FALSE(setting_value_from_text(row("model"), "World", &value));
    TEST_ASSERT_FALSE(setting_value_from_text(row("model"), "", &value));
    TEST_ASSERT_EQUAL_DOUBLE(1, value);
}

static void test_text_that_is_no_finite_number_is_refused(void) {
    static const char *const bad[] = {"",      "x",  "1x",   " 1",  "1 ",  "nan",
                                      "inf",   "1e", "0x10", "1,5", "--1", "1e999",
                                      "1.2.3", "+",  "1e-",  ".",   "-inf"};
    for (unsigned i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        double value = 7;
        TEST_ASSERT_FALSE_MESSAGE(text_to_number(bad[i], &value), bad[i]);
        TEST_ASSERT_EQUAL_DOUBLE(7, value);
    }
}

static void test_limits_are_included_and_what_is_beyond_refused(void) {
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *s = plr_setting_at(i);
        double value = 0;
        char text[64];
        if (s->choices != NULL)
            continue;
        setting_value_to_text(s, s->maximum, text, sizeof text);
        TEST_ASSERT_TRUE(setting_value_from_text(s, text, &value));
        snprintf(text, sizeof text, "%.17g", s->maximum * 1.5 + 1);
        TEST_ASSERT_FALSE(setting_value_from_text(s, text, &value));
        snprintf(text, sizeof text, "%.17g", s->minimum - 1);
        TEST_ASSERT_FALSE(setting_value_from_text(s, text, &value));
    }
}

static void test_a_count_is_a_whole_number(void) {
    double value = 0;
    TEST_ASSERT_FALSE(setting_value_from_text(row("slots"), "2.5", &value));
    TEST_ASSERT_TRUE(setting_value_from_text(row("slots"), "2", &value));
}

static void test_what_is_allowed_is_said_in_words(void) {
    char text[256];
    setting_allowed_text(row("model"), text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("body or world", text);
    setting_allowed_text(row("mode"), text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("slam, mapping, localization or dead_reckoning", text);
    setting_allowed_text(row("pixel-sigma"), text, sizeof text);
    TEST_ASSERT_EQUAL_STRING("a number from 0.001 to 1000 px", text);
    setting_allowed_text(row("slots"), text, sizeof text);
    TEST_ASSERT_EQUAL_INT(0, strncmp(text, "a whole number from 1 to ", 25));
}

/* The quantiles of chi-square with 4 degrees of freedom, from printed tables. */
static void test_the_gate_is_the_chi_square_quantile(void) {
    TEST_ASSERT_DOUBLE_WITHIN(5e-4, 3.357, gate_threshold(0.5));
    TEST_ASSERT_DOUBLE_WITHIN(5e-4, 9.488, gate_threshold(0.95));
    TEST_ASSERT_DOUBLE_WITHIN(5e-4, 13.277, gate_threshold(0.99));
    TEST_ASSERT_DOUBLE_WITHIN(5e-4, 18.467, gate_threshold(0.999));
}

static void test_the_gate_solves_its_equation_from_near_0_to_near_1(void) {
    for (double p = 1e-6; p < 1; p = p < 0.5 ? 2 * p : 1 - (1 - p) / 2) {
        if (1 - p < 1e-12)
            break;
        const double x = gate_threshold(p);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9 * (1 - p), 1 - p, (1 + x / 2) * exp(-x / 2));
        TEST_ASSERT_DOUBLE_WITHIN(1e-9 * (1 - p), 1 - p, gate_excess(x));
    }
}
