// SPDX-License-Identifier: MIT
/* Numbers as little-endian bytes, at any alignment and on any processor. */
#ifndef PLR_RECORD_BYTES_H
#define PLR_RECORD_BYTES_H

#include <stdint.h>
#include <string.h>

#include "pelorus/assertions.h"

/* The unsigned number in n bytes, n <= 8, least significant first. */
static inline uint64_t plr_bytes_get(const uint8_t *bytes, unsigned n) {
    PLR_ASSERT(n <= 8);
    uint64_t value = 0;
    for (unsigned i = n; i > 0; i--)
        value = value << 8 | bytes[i - 1];
    return value;
}

/* The lowest n bytes of value, n <= 8, least significant first. */
static inline void plr_bytes_put(uint8_t *bytes, unsigned n, uint64_t value) {
    PLR_ASSERT(n <= 8);
    for (unsigned i = 0; i < n; i++) {
        bytes[i] = (uint8_t)(value & 0xFF);
        value >>= 8;
    }
}

/* The bits of a floating-point number, and the number with given bits. They pass pointers, because
 * passing a signalling NaN by value may change it. */
static inline uint32_t plr_bits_of_f32(const float *x) {
    uint32_t bits;
    memcpy(&bits, x, sizeof bits);
    return bits;
}

static inline void plr_f32_of_bits(float *x, uint32_t bits) {
    memcpy(x, &bits, sizeof bits);
}

static inline uint64_t plr_bits_of_f64(const double *x) {
    uint64_t bits;
    memcpy(&bits, x, sizeof bits);
    return bits;
}

static inline void plr_f64_of_bits(double *x, uint64_t bits) {
    memcpy(x, &bits, sizeof bits);
}

#endif
