// SPDX-License-Identifier: MIT
/* A timer of 32 bits, as time that never wraps. */
#ifndef PELORUS_CORTEX_M_TICKS_H
#define PELORUS_CORTEX_M_TICKS_H

#include <stdint.h>

/* The 64-bit time of a timer's value that was captured less than half a turn before or after *latest, which
 * follows. At 10 MHz half a turn is 214 s: ask more often than that. */
static inline uint64_t ticks_extend(uint64_t *latest, uint32_t captured) {
    const int32_t since = (int32_t)(captured - (uint32_t)*latest);
    const uint64_t at = *latest + (uint64_t)(int64_t)since;
    if (since > 0) {
        *latest = at;
    }
    return at;
}

/* The middle between two values of the timer, the first of which came first. */
static inline uint32_t ticks_middle(uint32_t first, uint32_t second) {
    return first + (second - first) / 2;
}

#endif
