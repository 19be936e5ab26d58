// SPDX-License-Identifier: MIT
#include "math/finite.h"

bool plr_all_finite(const double *x, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        if (!(x[i] - x[i] >= 0))
            return false;
    return true;
}

bool plr_all_within(const double *x, unsigned n, double limit) {
    for (unsigned i = 0; i < n; i++)
        if (!(x[i] <= limit && x[i] >= -limit))
            return false;
    return true;
}
