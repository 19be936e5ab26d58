// SPDX-License-Identifier: MIT
#include "filter/linearisation.h"

#include "math/small.h"
#include "sensor/stereo.h"
#include "state/covariance.h"

enum { PASSES = 3 };

/* The true value is assumed to be within so many sigmas of the estimate. */
#define SIGMAS PLR_R(2)

static plr_real inverse_range(const plr_slot *slot) {
    return slot->beyond + PLR_R(1) / PLR_SQRT(plr_dot3(slot->x, slot->x));
}

/*
 * mean = sum w_i / r_i / sum w_i with w_i = 1 / (P_i + spread). spread = u^2 is how much the
 * landmarks themselves scatter: of a positive number with mean u, the exponential distribution
 * assumes least, and its variance is u^2. The first u^2 is the variance that one observation
 * leaves. The mean may be negative because of noise. u is the positive solution of u (u - mean) =
 * variance of the mean: close to the mean where that is well known, and its sigma where the mean is
 * zero.
 */
plr_real plr_linearisation_usual(const plr_filter *f) {
    const plr_real least = f->camera.min_inverse_range;
    plr_real spread = PLR_FMA(least, least, plr_stereo_inverse_range_variance(&f->camera));
    plr_real usual = least;
    for (unsigned pass = 0; pass < PASSES && f->belief.count > 0; pass++) {
        plr_real weights = 0, sum = 0;
        for (unsigned slot = 0; slot < f->belief.count; slot++) {
            const plr_real variance = plr_covariance_of_range(&f->belief, slot);
            const plr_real weight = PLR_R(1) / ((variance > 0 ? variance : 0) + spread);
            weights += weight;
            sum = PLR_FMA(weight, inverse_range(&f->belief.slots[slot]), sum);
        }
        const plr_real mean = sum / weights;
        usual = PLR_R(0.5) * (mean + PLR_SQRT(PLR_FMA(mean, mean, PLR_R(4) / weights)));
        usual = usual > least ? usual : least;
        spread = usual * usual;
    }
    return usual;
}

plr_real plr_linearisation_offset(const plr_slot *slot, plr_real usual, plr_real change,
                                  plr_real variance) {
    const plr_real known_to = variance > 0 ? SIGMAS * PLR_SQRT(variance) : 0;
    const plr_real off = usual - inverse_range(slot);
    if (off < change - known_to)
        return change - known_to;
    return off > change + known_to ? change + known_to : off;
}
