// SPDX-License-Identifier: MIT
#include "math/checksum.h"

#include <string.h>

#include "pelorus/assertions.h"

enum { LANES = PLR_CHECKSUM_LANES, WORD = sizeof(uint32_t) };

static inline void add_word(uint32_t *lane, const unsigned char *at) {
    uint32_t word;
    memcpy(&word, at, WORD);
    *lane = (*lane >> 7 | *lane << 25) + word;
}

static inline void add_rows(uint32_t *restrict lane, const unsigned char *restrict at,
                            size_t rows) {
    for (; rows > 0; rows--, at += LANES * WORD)
        for (unsigned l = 0; l < LANES; l++)
            add_word(lane + l, at + WORD * l);
}

void plr_checksum_add(plr_checksum *sum, const void *memory, size_t bytes) {
    const size_t row = LANES * WORD, rows = bytes / row;
    const unsigned char *at = (const unsigned char *)memory + rows * row;
    PLR_ASSERT(bytes % WORD == 0);
    add_rows(sum->lane, memory, rows);
    for (size_t l = 0; l < bytes % row / WORD; l++, at += WORD)
        add_word(&sum->lane[l], at);
}

/* A one-to-one function of `mixed` and of `word`. */
static uint32_t step(uint32_t mixed, uint32_t word) {
    mixed = (mixed ^ word) * 0x9E3779B1U;
    return mixed ^ mixed >> 15;
}

uint64_t plr_checksum_mixed(const plr_checksum *sum) {
    uint32_t low = 0, high = 0;
    for (unsigned l = 0; l < LANES; l++) {
        low = step(low, sum->lane[l]);
        high = step(high, sum->lane[LANES - 1 - l]);
    }
    return (uint64_t)high << 32 | low;
}
