// SPDX-License-Identifier: MIT
#include <math.h>
#include <unity.h>

#include "math/log_product.h"
#include "support/matrices.h"

static double value_of(const double *factors, unsigned count) {
    plr_log_product p = {1, 0};
    for (unsigned i = 0; i < count; i++)
        plr_log_product_multiply(&p, (plr_real)factors[i]);
    return (double)plr_log_product_value(&p);
}

static void test_nothing_multiplied_is_one(void) {
    TEST_ASSERT_EQUAL_DOUBLE(0, value_of(NULL, 0));
}

static void test_the_logarithm_of_one_factor_is_that_of_the_library(void) {
    for (double x = 1e-12; x < 1e13; x *= 1.37) {
        const double due = log((double)(plr_real)x);
        TEST_ASSERT_DOUBLE_WITHIN(2e-9 + 4 * REAL_EPSILON * (1 + fabs(due)), due, value_of(&x, 1));
    }
}

static void test_a_product_beyond_every_exponent_is_kept(void) {
    double factors[400], due = 0;
    for (unsigned i = 0; i < 400; i++) {
        factors[i] = i < 200 ? 3.5e8 + i : 0.25 + i;
        due += log((double)(plr_real)factors[i]);
    }
    TEST_ASSERT_DOUBLE_WITHIN(500 * REAL_EPSILON * due + 1e-8, due, value_of(factors, 400));
    for (unsigned i = 0; i < 400; i++)
        factors[i] = 1e-9;
    due = 400 * log((double)(plr_real)1e-9);
    TEST_ASSERT_DOUBLE_WITHIN(-500 * REAL_EPSILON * due + 1e-8, due, value_of(factors, 400));
}

static void test_what_is_no_positive_number_changes_nothing(void) {
    const double with[] = {2, 0, -3, (double)NAN, (double)INFINITY, 5}, without[] = {2, 5};
    TEST_ASSERT_EQUAL_DOUBLE(value_of(without, 2), value_of(with, 6));
}
