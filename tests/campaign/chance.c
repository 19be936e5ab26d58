// SPDX-License-Identifier: MIT
#include "campaign/chance.h"

#include <math.h>

static uint64_t splitmix(uint64_t *x) {
    uint64_t z = *x += UINT64_C(0x9E3779B97F4A7C15);
    z = (z ^ z >> 30) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ z >> 27) * UINT64_C(0x94D049BB133111EB);
    return z ^ z >> 31;
}

chance chance_seeded(uint64_t seed, uint64_t stream) {
    chance c = {{0}, 0, false};
    uint64_t x = seed;
    x = splitmix(&x) ^ stream * UINT64_C(0xD1342543DE82EF95);
    for (int i = 0; i < 4; i++)
        c.state[i] = splitmix(&x);
    return c;
}

static uint64_t rotate(uint64_t x, int bits) {
    return x << bits | x >> (64 - bits);
}

/* xoshiro256** */
uint64_t chance_bits(chance *c) {
    uint64_t *s = c->state;
    const uint64_t result = rotate(s[1] * 5, 7) * 9, t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = rotate(s[3], 45);
    return result;
}

double chance_uniform(chance *c, double low, double high) {
    return low + (high - low) * (double)(chance_bits(c) >> 11) * 0x1p-53;
}

/* Marsaglia's polar method. */
double chance_normal(chance *c) {
    if (c->has_spare) {
        c->has_spare = false;
        return c->spare;
    }
    double u, v, s;
    do {
        u = chance_uniform(c, -1, 1);
        v = chance_uniform(c, -1, 1);
        s = u * u + v * v;
    } while (s >= 1 || s <= 0);
    const double factor = sqrt(-2 * log(s) / s);
    c->spare = v * factor;
    c->has_spare = true;
    return u * factor;
}
