// SPDX-License-Identifier: MIT
/* Numbers as little-endian bytes, at any alignment and on any processor. */
#ifndef PLR_RECORD_BYTES_H
#define PLR_RECORD_BYTES_H

#include <stdint.h>

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

#endif
