// SPDX-License-Identifier: MIT
#include "support/covariance_twin.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "state/covariance.h"
#include "support/matrices.h"
#include "support/specimens.h"

covariance_twin twin;

void twin_for_each_size(void (*check)(void)) {
    static const unsigned landmarks[] = {0, 1, 2, 7, TWIN_MOST_LANDMARKS};
    for (int bias = 0; bias < 2; bias++)
        for (unsigned size = 0; size < sizeof landmarks / sizeof *landmarks; size++) {
            snprintf(twin.at, sizeof twin.at, "%u landmarks, bias %d", landmarks[size], bias);
            specimen_filter(&twin.filter, &twin.chance, PLR_MODEL_BODY, bias, landmarks[size]);
            twin.n = plr_covariance_dim(&twin.filter.belief);
            twin.P = specimen_covariance(&twin.filter);
            twin.expected = specimen_covariance(&twin.filter);
            check();
            free(twin.expected);
            free(twin.P);
        }
}

void twin_demand_expected(double roundings) {
    double *got = specimen_covariance(&twin.filter);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(roundings * REAL_EPSILON, 0,
                                      specimen_gap(twin.n, twin.expected, got), twin.at);
    free(got);
}

void twin_random(plr_real *out, double *same, unsigned count) {
    rng_normals(&twin.chance, 1, same, count);
    to_reals(out, same, count);
    to_doubles(same, out, count);
}

double *twin_identity(void) {
    double *I = specimen_zeros(twin.n, twin.n);
    for (unsigned i = 0; i < twin.n; i++)
        I[i * twin.n + i] = 1;
    return I;
}
