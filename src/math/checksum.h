// SPDX-License-Identifier: MIT
/* A checksum of memory, word by word, for what is summed often: two instructions a word, and fewer where words are
 * added side by side. Each sum is rotated before the next word is added, so that it depends on the order of the
 * words. A change of a single word always changes the sum. */
#ifndef PLR_MATH_CHECKSUM_H
#define PLR_MATH_CHECKSUM_H

#include <stddef.h>
#include <stdint.h>

enum { PLR_CHECKSUM_LANES = 8 }; /* sums side by side */

typedef struct plr_checksum {
    uint32_t lane[PLR_CHECKSUM_LANES];
} plr_checksum;

/* What a sum begins with: numbers that a small processor copies faster than it clears memory. */
static const plr_checksum plr_checksum_begin = {{1, 2, 3, 4, 5, 6, 7, 8}};

/* Adds whole words, `bytes` in all, of any alignment. */
void plr_checksum_add(plr_checksum *sum, const void *memory, size_t bytes);

/* The sums in one number: a change of one of them changes it. */
uint64_t plr_checksum_mixed(const plr_checksum *sum);

#endif
