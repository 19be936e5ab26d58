// SPDX-License-Identifier: MIT
/* Single flipped bits in a filter's memory, and what comes of them. */
#ifndef CAMPAIGN_FLIP_H
#define CAMPAIGN_FLIP_H

#include <stdint.h>

/* From bad to good; the worst that is seen counts. */
typedef enum flip_verdict {
    FLIP_CRASHED = 0, /* or hung: the process that tried it never came back */
    FLIP_OUT_OF_BOUNDS,
    FLIP_NOT_FINITE, /* a call said PLR_OK and gave NaN, no rotation, or a negative variance */
    FLIP_SILENT,     /* GOOD, and a component of the error beyond 5 sigma */
    FLIP_TOLD,       /* refused, or not GOOD where the unharmed filter is */
    FLIP_HARMLESS,
    FLIP_VERDICTS
} flip_verdict;

typedef struct flip {
    uint32_t offset; /* byte in plr_filter */
    uint8_t bit;
    uint8_t life;       /* which of the filters */
    uint8_t after;      /* 1: between the readings and the frame; 0: before the readings */
    uint8_t verdict;    /* flip_verdict */
    int16_t told_frame; /* first that told; -1 */
} flip;

enum { FLIP_LIVES = 16, FLIP_FRAMES = 30 };

/* Drives the filters into the middle of their lives. Ends the program if it cannot. */
void flip_prepare(uint64_t seed);

/* Chooses the bit of flip `index`; every bit of the struct is as likely as any other. */
void flip_choose(flip *f, uint64_t seed, unsigned index);

/* Tries it, in this process, and writes its verdict at the end. */
void flip_try(flip *f);

#endif
