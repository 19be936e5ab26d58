// SPDX-License-Identifier: MIT
#include "math/finite.h"

#include <stdint.h>
#include <string.h>

/* By its bits: of double, which a small processor has to emulate, a sum takes forty instructions. */
static bool is_finite(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits >> 52 & 0x7FFU) != 0x7FFU;
}

bool plr_all_finite(const double *x, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        if (!is_finite(x[i]))
            return false;
    return true;
}

bool plr_all_within(const double *x, unsigned n, double limit) {
    for (unsigned i = 0; i < n; i++)
        if (!(x[i] <= limit && x[i] >= -limit))
            return false;
    return true;
}
