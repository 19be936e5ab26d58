// SPDX-License-Identifier: MIT
/* Readings of an IMU on their way from its interrupt, the only writer, to the loop, the only reader. */
#ifndef PELORUS_CORTEX_M_READINGS_H
#define PELORUS_CORTEX_M_READINGS_H

#include <stdbool.h>
#include <stdint.h>

#include "barrier.h"

/* A power of two; 0.64 s at 200 Hz: a cut link may hold the loop for half a second. */
enum { READINGS = 128 };

/* As the chip has it. */
typedef struct reading {
    uint64_t t_ns;
    int16_t accel[3], gyro[3];
} reading;

typedef struct readings {
    reading ring[READINGS];
    volatile uint32_t put, taken, lost;
} readings;

/* Interrupt. */
static inline void readings_put(readings *r, const reading *one) {
    if (r->put - r->taken == READINGS) {
        ++r->lost;
        return;
    }
    compiler_barrier(); /* the loop has read what was there */
    r->ring[r->put % READINGS] = *one;
    compiler_barrier();
    ++r->put;
}

/* Loop: the oldest reading, if it is not later than that. */
static inline bool readings_take(readings *r, uint64_t until_ns, reading *one) {
    if (r->put == r->taken) {
        return false;
    }
    compiler_barrier();
    const reading *oldest = &r->ring[r->taken % READINGS];
    if (oldest->t_ns > until_ns) {
        return false;
    }
    *one = *oldest;
    compiler_barrier();
    ++r->taken;
    return true;
}

#endif
