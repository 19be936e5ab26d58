// SPDX-License-Identifier: MIT
/* Seeded random numbers, the same on every machine: a failing test can be run again. */
#ifndef PELORUS_TEST_RANDOM_H
#define PELORUS_TEST_RANDOM_H

#include <stddef.h>
#include <stdint.h>

typedef struct rng {
    uint64_t state;
} rng;

rng rng_seeded(uint64_t seed);

/* 64 random bits: splitmix64 (Steele, Lea and Flood, 2014). */
uint64_t rng_bits(rng *r);

/* Evenly in [low, high). */
double rng_uniform(rng *r, double low, double high);

/* Evenly in 0 to n - 1; n > 0. */
unsigned rng_below(rng *r, unsigned n);

/* Mean 0, variance 1 (Box and Muller, 1958). */
double rng_normal(rng *r);

/* x[i] = sigma times a normal number. */
void rng_normals(rng *r, double sigma, double *x, size_t n);

#endif
