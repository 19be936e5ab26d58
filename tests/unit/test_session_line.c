// SPDX-License-Identifier: MIT
/* Lines of text without stdio, held against stdio's. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "session/line.h"
#include "support/random.h"

static plr_text line;

void setUp(void) {
    plr_line_begin(&line, PLR_SEVERITY_WARNING, "");
}

static const char *number(double x) {
    plr_line_begin(&line, PLR_SEVERITY_INFO, "");
    plr_line_number(&line, x);
    return line.text;
}

static void test_words_are_joined_and_the_severity_kept(void) {
    plr_line_text(&line, "one ");
    plr_line_text(&line, "two");
    TEST_ASSERT_EQUAL_STRING("one two", line.text);
    TEST_ASSERT_EQUAL_UINT8(PLR_SEVERITY_WARNING, line.severity);
}

static void test_counts_are_printed_in_full(void) {
    plr_line_count(&line, "", 0);
    plr_line_text(&line, " ");
    plr_line_count(&line, "", UINT64_MAX);
    TEST_ASSERT_EQUAL_STRING("0 18446744073709551615", line.text);
}

static void test_what_does_not_fit_is_cut_at_a_whole_character(void) {
    for (int i = 0; i < 100; i++)
        plr_line_text(&line, "\xc3\xa9_"); /* three bytes: 240 is 80 of them */
    TEST_ASSERT_EQUAL_size_t(240, strlen(line.text));
    plr_line_begin(&line, PLR_SEVERITY_INFO, "");
    for (int i = 0; i < 239; i++)
        plr_line_text(&line, "x");
    plr_line_text(&line, "\xc3\xa9");
    TEST_ASSERT_EQUAL_size_t(239, strlen(line.text));
}

static void test_times_are_seconds_with_three_decimals(void) {
    plr_line_time(&line, UINT64_C(12045000000));
    TEST_ASSERT_EQUAL_STRING("12.045 s", line.text);
}

static void test_known_numbers_read_as_a_human_writes_them(void) {
    TEST_ASSERT_EQUAL_STRING("0", number(0));
    TEST_ASSERT_EQUAL_STRING("300", number(300));
    TEST_ASSERT_EQUAL_STRING("-1.5", number(-1.5));
    TEST_ASSERT_EQUAL_STRING("0.001", number(0.001));
    TEST_ASSERT_EQUAL_STRING("999999", number(999999));
    TEST_ASSERT_EQUAL_STRING("1e+06", number(999999.9));
    TEST_ASSERT_EQUAL_STRING("1e-08", number(1e-8));
    TEST_ASSERT_EQUAL_STRING("NaN", number((double)NAN));
    TEST_ASSERT_EQUAL_STRING("-infinity", number(-(double)INFINITY));
}

static void test_any_number_reads_back_to_six_digits(void) {
    rng r = rng_seeded(11);
    for (int i = 0; i < 5000; i++) {
        const double x = rng_normal(&r) * pow(10, rng_uniform(&r, -300, 300));
        TEST_ASSERT_DOUBLE_WITHIN(6e-6 * fabs(x), x, strtod(number(x), NULL));
        const double y = rng_normal(&r) * pow(10, rng_uniform(&r, -4, 6));
        TEST_ASSERT_DOUBLE_WITHIN(6e-6 * fabs(y), y, strtod(number(y), NULL));
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-320, 5e-324, strtod(number(5e-324), NULL));
}
