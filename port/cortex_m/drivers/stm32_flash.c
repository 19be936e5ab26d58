// SPDX-License-Identifier: MIT
/* Registers, keys and the order of the steps: RM0090, section 3.6 and 3.9. */
#include "stm32_flash.h"

#include <stdbool.h>
#include <string.h>

#include "../board.h"
#include "../clock.h"
#include "../core.h"

#define FLASH_ACR  CORE_REGISTER(0x40023C00U)
#define FLASH_KEYR CORE_REGISTER(0x40023C04U)
#define FLASH_SR   CORE_REGISTER(0x40023C0CU)
#define FLASH_CR   CORE_REGISTER(0x40023C10U)

#define KEY1    0x45670123U
#define KEY2    0xCDEF89ABU
#define CR_LOCK 0x80000000U

enum {
    ACR_ICEN = 1 << 9, /* the instruction cache, the data cache, and their resets */
    ACR_DCEN = 1 << 10,
    ACR_ICRST = 1 << 11,
    ACR_DCRST = 1 << 12,

    SR_ERRORS = 1 << 1 | 1 << 4 | 1 << 5 | 1 << 6 | 1 << 7, /* operation, write protection,
                                              alignment, parallelism, sequence; cleared by ones */
    SR_BSY = 1 << 16,

    CR_PG = 1 << 0,
    CR_SER = 1 << 1,
    CR_SECTOR = 3, /* the place of the sector's number */
    CR_PSIZE_X32 = 2 << 8,
    CR_STRT = 1 << 16,

    SECTOR_BYTES = 128 * 1024,
    FIRST_SECTOR = 10,
    WORD = 4
};

/* A sector takes 2 s at most, a word 0.1 ms. Below the watchdog's shortest period, which begins anew
 * before each. Where the core stands still its clock does too, but then the wait is over as well. */
#define ERASE_NS UINT64_C(2500000000)
#define WORD_NS  UINT64_C(10000000)

/* The region, from the linker script. */
extern uint8_t _storage_start[], _storage_end[];

static uint32_t region_size(void) {
    return (uint32_t)((uintptr_t)_storage_end - (uintptr_t)_storage_start);
}

/* True if the controller is idle, and the last operation went well. */
static bool finishes(uint64_t within_ns) {
    const uint64_t start_ns = clock_ns();
    while ((FLASH_SR & SR_BSY) != 0) {
        if (clock_ns() - start_ns > within_ns) {
            return false;
        }
    }
    return (FLASH_SR & SR_ERRORS) == 0;
}

/* Ready to erase or program, as `command` says. A controller that does not keep the command is none,
 * or stays locked. */
static bool unlocks(uint32_t command) {
    if ((FLASH_CR & CR_LOCK) != 0) {
        FLASH_KEYR = KEY1;
        FLASH_KEYR = KEY2;
    }
    if ((FLASH_SR & SR_BSY) != 0) {
        return false;
    }
    FLASH_SR = SR_ERRORS;
    FLASH_CR = command;
    return FLASH_CR == command;
}

/* A write to CR would wait for a controller that is still busy, without end perhaps. */
static void lock(void) {
    if ((FLASH_SR & SR_BSY) == 0) {
        FLASH_CR = CR_LOCK;
    }
}

/* The caches know the old contents, or what was meant to be written, and the store wants to read what
 * the flash holds. They may be emptied only while they are off. */
static void empty_caches(void) {
    const uint32_t as_it_was = FLASH_ACR;
    const uint32_t off = as_it_was & ~(uint32_t)(ACR_ICEN | ACR_DCEN);
    FLASH_ACR = off;
    FLASH_ACR = off | ACR_ICRST | ACR_DCRST;
    FLASH_ACR = off;
    FLASH_ACR = as_it_was;
}

static bool erases_sector(uint32_t number) {
    const uint32_t command = CR_SER | CR_PSIZE_X32 | number << CR_SECTOR;
    board_watchdog_feed();
    if (!unlocks(command)) {
        return false;
    }
    FLASH_CR = command | CR_STRT;
    const bool done = finishes(ERASE_NS);
    board_watchdog_feed();
    return done;
}

static bool programs_word(volatile uint32_t *at, const uint8_t *bytes) {
    uint32_t word;
    memcpy(&word, bytes, sizeof word);
    *at = word;
    core_write_barrier();
    return finishes(WORD_NS) && *at == word;
}

/* ---------------------------------------------------------------- the device */

static bool is_inside(uint32_t offset, uint32_t n) {
    return offset <= region_size() && n <= region_size() - offset;
}

static int flash_read(void *context, uint32_t offset, uint8_t *bytes, uint32_t n) {
    (void)context;
    if (!is_inside(offset, n)) {
        return -1;
    }
    board_watchdog_feed();
    memcpy(bytes, _storage_start + offset, n);
    return 0;
}

static int flash_program(void *context, uint32_t offset, const uint8_t *bytes, uint32_t n) {
    (void)context;
    bool good = is_inside(offset, n) && offset % WORD == 0 && n % WORD == 0;
    board_watchdog_feed();
    good = good && unlocks(CR_PG | CR_PSIZE_X32);
    for (uint32_t at = 0; good && at < n; at += WORD) {
        good = programs_word((volatile uint32_t *)(_storage_start + offset + at), bytes + at);
    }
    lock();
    empty_caches();
    return good ? 0 : -1;
}

static int flash_erase(void *context, uint32_t offset, uint32_t n) {
    (void)context;
    bool good = is_inside(offset, n) && offset % SECTOR_BYTES == 0 && n % SECTOR_BYTES == 0;
    for (uint32_t at = offset; good && at < offset + n; at += SECTOR_BYTES) {
        good = erases_sector(FIRST_SECTOR + at / SECTOR_BYTES);
    }
    lock();
    empty_caches();
    return good ? 0 : -1;
}

plr_block_device stm32_flash(void) {
    return (plr_block_device){.size = region_size() / SECTOR_BYTES * SECTOR_BYTES,
                              .erase_size = SECTOR_BYTES,
                              .program_size = WORD,
                              .read = flash_read,
                              .program = flash_program,
                              .erase = flash_erase};
}
