// SPDX-License-Identifier: MIT
#include "retained_ram.h"

#include <string.h>

#include "../board.h"

enum { BLOCK = 1024, UNIT = 4, ERASED = 0xFF };

/* The region, from the linker script. */
extern uint8_t _retained_start[], _retained_end[];

static uint32_t region_size(void) {
    return (uint32_t)((uintptr_t)_retained_end - (uintptr_t)_retained_start);
}

static int is_outside(uint32_t offset, uint32_t n) {
    return offset > region_size() || n > region_size() - offset;
}

static int ram_read(void *context, uint32_t offset, uint8_t *bytes, uint32_t n) {
    (void)context;
    if (is_outside(offset, n)) {
        return -1;
    }
    board_watchdog_feed(); /* with many landmarks a save is half a second of checksums */
    memcpy(bytes, _retained_start + offset, n);
    return 0;
}

static int ram_program(void *context, uint32_t offset, const uint8_t *bytes, uint32_t n) {
    (void)context;
    if (is_outside(offset, n)) {
        return -1;
    }
    memcpy(_retained_start + offset, bytes, n);
    return 0;
}

static int ram_erase(void *context, uint32_t offset, uint32_t n) {
    (void)context;
    if (is_outside(offset, n)) {
        return -1;
    }
    memset(_retained_start + offset, ERASED, n);
    return 0;
}

plr_block_device retained_ram(void) {
    return (plr_block_device){.size = region_size() / BLOCK * BLOCK,
                              .erase_size = BLOCK,
                              .program_size = UNIT,
                              .read = ram_read,
                              .program = ram_program,
                              .erase = ram_erase};
}
