// SPDX-License-Identifier: MIT
#include "support/random.h"

#include <math.h>

rng rng_seeded(uint64_t seed) {
    return (rng){seed};
}

uint64_t rng_bits(rng *r) {
    r->state += UINT64_C(0x9E3779B97F4A7C15);
    uint64_t z = r->state;
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

/* In [0, 1), a multiple of 2^-53. */
static double unit(rng *r) {
    return (double)(rng_bits(r) >> 11) / 9007199254740992.0;
}

double rng_uniform(rng *r, double low, double high) {
    return low + (high - low) * unit(r);
}

unsigned rng_below(rng *r, unsigned n) {
    return (unsigned)(rng_bits(r) % n);
}

double rng_normal(rng *r) {
    const double two_pi = 6.283185307179586;
    const double radius = sqrt(-2 * log(1 - unit(r)));
    return radius * cos(two_pi * unit(r));
}

void rng_normals(rng *r, double sigma, double *x, size_t n) {
    for (size_t i = 0; i < n; i++)
        x[i] = sigma * rng_normal(r);
}
