// SPDX-License-Identifier: MIT
/*
 * A block device in memory, with the faults of real flash: power that fails at any byte of an erase
 * or a program, bits that do not program, bits that flip, functions that report failure. It also
 * holds the caller to the rules of port.h: alignment, and erase before program.
 */
#ifndef PELORUS_TEST_FAULTY_FLASH_H
#define PELORUS_TEST_FAULTY_FLASH_H

#include <stdbool.h>

#include "pelorus/port.h"
#include "support/random.h"

enum { FAULTY_FLASH_BYTES = 1 << 15, FAULTY_FLASH_ALWAYS = -1 };

/* What the byte holds at which the power failed. */
typedef enum faulty_flash_tear {
    FAULTY_FLASH_UNTOUCHED, /* what it held before */
    FAULTY_FLASH_HALF,      /* some bits of before, some of what was to be */
    FAULTY_FLASH_NOISE      /* anything, and so does the rest of its program unit or erase block */
} faulty_flash_tear;

typedef struct faulty_flash {
    plr_block_device device; /* to hand to a store */

    /* Faults; all off after faulty_flash_init. */
    long power_left; /* bytes erased or programmed until the power fails; ALWAYS: it stays */
    faulty_flash_tear tear;
    uint32_t stuck_at; /* a byte of which the bits of stuck_mask stay erased */
    uint8_t stuck_mask;
    unsigned read_fails_at; /* number of the read that fails, from 1; 0: none */
    unsigned read_flips_at; /* number of the read whose first byte comes with a flipped bit */
    bool program_fails, erase_fails;

    /* What happened. */
    unsigned reads, violations;          /* of the rules of port.h */
    uint64_t work;                       /* bytes erased or programmed */
    unsigned erases[FAULTY_FLASH_BYTES]; /* of each block */

    rng random;
    bool power;
    uint8_t erased_value;
    uint8_t bytes[FAULTY_FLASH_BYTES];
    bool erased[FAULTY_FLASH_BYTES]; /* may be programmed */
} faulty_flash;

/* A faultless device that holds noise, as one that was never used. */
void faulty_flash_init(faulty_flash *flash, uint64_t seed, uint32_t size, uint32_t erase_size,
                       uint32_t program_size);

/* Power again, without faults. */
void faulty_flash_restart(faulty_flash *flash);

#endif
