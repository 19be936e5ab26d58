// SPDX-License-Identifier: MIT
#include "support/chi_square.h"

#include <math.h>
#include <stdio.h>
#include <unity.h>

void chi_square_bounds(unsigned freedom, double *low, double *high) {
    const double z = 3.2905, v = 2.0 / (9.0 * freedom);
    *low = pow(1 - v - z * sqrt(v), 3);
    *high = pow(1 - v + z * sqrt(v), 3);
}

void chi_square_demand(const char *what, double per_freedom, unsigned freedom) {
    char message[96];
    double low, high;
    chi_square_bounds(freedom, &low, &high);
    snprintf(message, sizeof message,
             "%s: NEES %.3f per degree of freedom, %.3f to %.3f is expected", what, per_freedom,
             low, high);
    TEST_ASSERT_TRUE_MESSAGE(per_freedom > low && per_freedom < high, message);
}
