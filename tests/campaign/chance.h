// SPDX-License-Identifier: MIT
/* Seeded random numbers of the campaign: the same on every machine. */
#ifndef CAMPAIGN_CHANCE_H
#define CAMPAIGN_CHANCE_H

#include <stdbool.h>
#include <stdint.h>

typedef struct chance {
    uint64_t state[4];
    double spare; /* the second number of a pair of normal ones */
    bool has_spare;
} chance;

/* A stream of its own for each pair (seed, stream). */
chance chance_seeded(uint64_t seed, uint64_t stream);

uint64_t chance_bits(chance *c);

/* Uniform in [low, high). */
double chance_uniform(chance *c, double low, double high);

/* Normal, mean 0, variance 1. */
double chance_normal(chance *c);

#endif
