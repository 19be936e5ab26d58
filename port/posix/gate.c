// SPDX-License-Identifier: MIT
#include "posix/gate.h"

#include <math.h>

/* log of the tail (1 + x/2) exp(-x/2): it falls strictly, and is exact in the far tail too. */
static double log_tail(double x) {
    return log1p(x / 2) - x / 2;
}

double gate_excess(double x) {
    return exp(log_tail(x));
}

double gate_threshold(double probability) {
    const double wanted = log1p(-probability);
    double low = 0, high = 1;
    while (log_tail(high) > wanted)
        high *= 2;
    for (int i = 0; i < 200 && high - low > 1e-14 * high; i++) {
        const double middle = 0.5 * (low + high);
        if (log_tail(middle) > wanted)
            low = middle;
        else
            high = middle;
    }
    return 0.5 * (low + high);
}
