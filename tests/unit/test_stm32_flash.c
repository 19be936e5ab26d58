// SPDX-License-Identifier: MIT
/*
 * The flash driver of the STM32F405 against a model of the part's controller (RM0090, chapter 3):
 * keys, lock, busy, error flags, sectors, bits that only an erase can set. No emulator has it.
 *
 * Every access to a register first plays what the driver has written since the last one.
 */
#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#include <unity.h>

/* The driver's own includes of these are then empty. */
#define PELORUS_CORTEX_M_CORE_H
#define CORE_REGISTER(address) (*model_register(address))

static volatile uint32_t *model_register(uint32_t address);

static unsigned barriers;

static void core_write_barrier(void) {
    barriers++;
}

#include "../../port/cortex_m/drivers/stm32_flash.c"

enum {
    STORAGE = 2 * SECTOR_BYTES,
    BUSY_NS = 1000000, /* what an operation takes */
    REGISTERS = 5,

    /* The part's bits, not the driver's. */
    MODEL_PG = 0x1,
    MODEL_SER = 0x2,
    MODEL_SECTOR = 3,
    MODEL_X32 = 0x200,
    MODEL_STRT = 0x10000,
    MODEL_BSY = 0x10000,
    MODEL_ERRORS = 0xF2
};
#define MODEL_LOCK 0x80000000U

/* The region that the linker script would give. */
uint8_t _storage_start[STORAGE];
__asm__(".globl _storage_end\n.set _storage_end, _storage_start + 262144");

static struct {
    volatile uint32_t registers[REGISTERS]; /* ACR, KEYR, OPTKEYR, SR, CR */
    uint32_t sr, cr;                        /* as the controller has them */
    uint32_t shown_acr, shown_sr, shown_cr; /* as the driver has last seen them */
    uint8_t contents[STORAGE];
    unsigned key; /* right ones so far */
    uint64_t now_ns, busy_until_ns, operation_ns;
    unsigned erased[12]; /* times, by sector */
    unsigned feeds, caches_emptied;
    bool absent, stuck_busy;
    uint32_t fails_with; /* flags that the next operations end with */
    int broken_at;       /* a byte that keeps its value; -1: none */
} part;

void board_watchdog_feed(void) {
    part.feeds++;
}

uint64_t clock_ns(void) {
    part.now_ns += 100000;
    return part.now_ns;
}

/* --- the model --- */

static void play_keys(void) {
    const uint32_t key = part.registers[1];
    part.registers[1] = 0;
    if (key == 0)
        return;
    part.key = key == (part.key == 0 ? 0x45670123U : 0xCDEF89ABU) ? part.key + 1 : 0;
    if (part.key == 2)
        part.cr &= ~MODEL_LOCK;
}

static void begin_operation(void) {
    part.busy_until_ns = part.now_ns + part.operation_ns;
    part.sr |= part.fails_with;
}

static void play_erase(void) {
    const uint32_t sector = part.cr >> MODEL_SECTOR & 15;
    TEST_ASSERT_TRUE((part.cr & MODEL_SER) != 0);
    TEST_ASSERT_EQUAL_HEX32(MODEL_X32, part.cr & 3U << 8);
    TEST_ASSERT_TRUE(sector == 10 || sector == 11); /* all else is the program */
    part.erased[sector]++;
    memset(part.contents + (sector - 10) * SECTOR_BYTES, 0xFF, SECTOR_BYTES);
    memcpy(_storage_start, part.contents, STORAGE);
    part.cr &= ~(uint32_t)MODEL_STRT;
    begin_operation();
}

static void play_control(void) {
    const uint32_t written = part.registers[4];
    if (written == part.shown_cr)
        return;
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(0, part.sr & MODEL_BSY,
                                    "CR written while busy: the bus stalls");
    if ((part.cr & MODEL_LOCK) == 0)
        part.cr = written;
    if ((part.cr & MODEL_LOCK) != 0)
        part.key = 0;
    if ((part.cr & MODEL_STRT) != 0)
        play_erase();
}

static void play_status(void) {
    if (part.registers[3] != part.shown_sr)
        part.sr &= ~(part.registers[3] & MODEL_ERRORS);
}

/* What was stored in the region: programs zeros into bits, where a program is allowed. */
static void play_stores(void) {
    if (memcmp(_storage_start, part.contents, STORAGE) == 0)
        return;
    const bool programs = (part.cr & (MODEL_PG | MODEL_LOCK)) == MODEL_PG;
    for (int i = 0; i < STORAGE; i++)
        if (programs && i != part.broken_at)
            part.contents[i] &= _storage_start[i];
    if (programs)
        begin_operation();
    if (programs && (part.cr & 3U << 8) != MODEL_X32)
        part.sr |= 1U << 6; /* parallelism: words were stored */
    if (!programs)
        part.sr |= 1U << 7; /* sequence */
}

static void play_caches(void) {
    const uint32_t acr = part.registers[0];
    if ((part.shown_acr & 0x1800) != 0)
        TEST_ASSERT_EQUAL_HEX32_MESSAGE(0, acr & 0x600, "a cache is enabled in its reset");
    if ((acr & 0x1800) == 0 || acr == part.shown_acr)
        return;
    TEST_ASSERT_EQUAL_HEX32(0, (acr | part.shown_acr) & 0x600); /* only while they are off */
    part.caches_emptied++;
}

static void show(void) {
    const bool busy = part.stuck_busy ? part.busy_until_ns > 0 : part.now_ns < part.busy_until_ns;
    memcpy(_storage_start, part.contents, STORAGE);
    part.sr = (part.sr & ~(uint32_t)MODEL_BSY) | (busy ? MODEL_BSY : 0);
    part.shown_acr = part.registers[0];
    part.registers[3] = part.shown_sr = part.sr;
    part.registers[4] = part.shown_cr = part.cr;
}

static volatile uint32_t *model_register(uint32_t address) {
    const uint32_t number = (address - 0x40023C00U) / 4;
    TEST_ASSERT_LESS_THAN_UINT32(REGISTERS, number);
    if (part.absent) {
        memset((void *)(uintptr_t)part.registers, 0, sizeof part.registers);
        memcpy(_storage_start, part.contents, STORAGE);
        return &part.registers[number];
    }
    play_keys();
    play_caches();
    play_status();
    play_stores();
    play_control();
    show();
    return &part.registers[number];
}

/* --- tests --- */

static plr_block_device device;

static int program(uint32_t offset, const uint8_t *bytes, uint32_t n) {
    const int result = device.program(device.context, offset, bytes, n);
    (void)model_register(0x40023C10U); /* play the last of it */
    return result;
}

static int erase(uint32_t offset, uint32_t n) {
    const int result = device.erase(device.context, offset, n);
    (void)model_register(0x40023C10U);
    return result;
}

void setUp(void) {
    memset(&part, 0, sizeof part);
    part.cr = MODEL_LOCK;
    part.registers[0] = 0x705;
    part.operation_ns = BUSY_NS;
    part.broken_at = -1;
    barriers = 0;
    memset(part.contents, 0x55, STORAGE);
    show();
    device = stm32_flash();
}

void tearDown(void) {
    TEST_ASSERT_TRUE(part.absent || (part.cr & MODEL_LOCK) != 0);
    TEST_ASSERT_EQUAL_HEX32(part.absent ? 0 : 0x705, part.registers[0]);
}

static void assert_all(uint8_t value, uint32_t from, uint32_t to) {
    for (uint32_t i = from; i < to; i++)
        TEST_ASSERT_EQUAL_HEX8(value, part.contents[i]);
}

static void test_it_is_two_sectors_of_128_kilobytes(void) {
    TEST_ASSERT_EQUAL_UINT32(256 * 1024, device.size);
    TEST_ASSERT_EQUAL_UINT32(128 * 1024, device.erase_size);
    TEST_ASSERT_EQUAL_UINT32(4, device.program_size);
}

static void test_an_erase_clears_its_sector_and_no_other(void) {
    TEST_ASSERT_EQUAL_INT(0, erase(SECTOR_BYTES, SECTOR_BYTES));
    assert_all(0x55, 0, SECTOR_BYTES);
    assert_all(0xFF, SECTOR_BYTES, STORAGE);
    TEST_ASSERT_EQUAL_UINT(1, part.erased[11]);
    TEST_ASSERT_EQUAL_INT(0, erase(0, STORAGE));
    assert_all(0xFF, 0, STORAGE);
    TEST_ASSERT_EQUAL_UINT(1, part.erased[10]);
    TEST_ASSERT_EQUAL_UINT(2, part.erased[11]);
    TEST_ASSERT_EQUAL_UINT(2, part.caches_emptied);
}

static void test_what_is_programmed_reads_back(void) {
    uint8_t bytes[256], back[256];
    for (unsigned i = 0; i < sizeof bytes; i++)
        bytes[i] = (uint8_t)(7 * i + 1);
    TEST_ASSERT_EQUAL_INT(0, erase(0, SECTOR_BYTES));
    TEST_ASSERT_EQUAL_INT(0, program(1024, bytes, sizeof bytes));
    TEST_ASSERT_EQUAL_INT(0, device.read(device.context, 1024, back, sizeof back));
    TEST_ASSERT_EQUAL_MEMORY(bytes, back, sizeof bytes);
    TEST_ASSERT_EQUAL_INT(0, device.read(device.context, 1023, back, 3));
    TEST_ASSERT_EQUAL_HEX8(0xFF, back[0]);
    TEST_ASSERT_EQUAL_HEX8(1, back[1]);
    assert_all(0xFF, 1024 + 256, SECTOR_BYTES);
    TEST_ASSERT_EQUAL_UINT(sizeof bytes / 4, barriers); /* each word is out before its wait */
}

static void test_what_was_not_erased_does_not_take(void) {
    const uint8_t bytes[4] = {0xFF, 0, 0, 0};
    TEST_ASSERT_EQUAL_INT(-1, program(0, bytes, 4));
}

static void test_a_cell_that_does_not_program_is_found_at_once(void) {
    const uint8_t bytes[12] = {0};
    TEST_ASSERT_EQUAL_INT(0, erase(0, SECTOR_BYTES));
    part.broken_at = 5;
    TEST_ASSERT_EQUAL_INT(-1, program(0, bytes, sizeof bytes));
    assert_all(0xFF, 8, SECTOR_BYTES); /* nothing was tried behind it */
}

static void test_every_error_flag_ends_it_and_is_cleared_for_the_next(void) {
    const uint8_t bytes[4] = {0};
    static const unsigned flags[] = {1, 4, 5, 6, 7};
    for (unsigned i = 0; i < sizeof flags / sizeof *flags; i++) {
        part.fails_with = 1U << flags[i];
        TEST_ASSERT_EQUAL_INT(-1, erase(0, SECTOR_BYTES));
        TEST_ASSERT_EQUAL_INT(-1, program(0, bytes, 4));
        part.fails_with = 0;
        TEST_ASSERT_EQUAL_INT(0, erase(0, SECTOR_BYTES));
        TEST_ASSERT_EQUAL_INT(0, program(0, bytes, 4));
    }
}

static void test_a_controller_that_stays_busy_is_given_up_before_the_watchdog_bites(void) {
    const uint8_t bytes[8] = {0};
    part.stuck_busy = true;
    TEST_ASSERT_EQUAL_INT(-1, device.erase(device.context, 0, STORAGE));
    TEST_ASSERT_LESS_THAN_UINT64(UINT64_C(3000000000), part.now_ns);
    TEST_ASSERT_EQUAL_UINT(1, part.erased[10]);
    const uint64_t then_ns = part.now_ns;
    TEST_ASSERT_EQUAL_INT(-1, device.program(device.context, 0, bytes, 8));
    TEST_ASSERT_LESS_THAN_UINT64(UINT64_C(100000000), part.now_ns - then_ns);
    part.stuck_busy = false;
    part.now_ns += UINT64_C(10000000000);
    TEST_ASSERT_EQUAL_INT(0, erase(0, SECTOR_BYTES)); /* it recovers, and is locked again */
}

static void test_a_word_that_never_ends_is_given_up_soon(void) {
    const uint8_t bytes[8] = {0};
    part.stuck_busy = true; /* from the first operation on */
    TEST_ASSERT_EQUAL_INT(-1, device.program(device.context, 0, bytes, 8));
    TEST_ASSERT_LESS_THAN_UINT64(UINT64_C(100000000), part.now_ns);
    assert_all(0x55, 4, STORAGE);
    part.stuck_busy = false;
    part.now_ns += UINT64_C(10000000000);
    TEST_ASSERT_EQUAL_INT(0, erase(0, SECTOR_BYTES));
}

static void test_reading_and_programming_feed_the_watchdog(void) {
    uint8_t bytes[4] = {0};
    TEST_ASSERT_EQUAL_INT(0, device.read(device.context, 0, bytes, 4));
    TEST_ASSERT_EQUAL_UINT(1, part.feeds);
    TEST_ASSERT_EQUAL_INT(0, program(0, (const uint8_t[4]){0}, 4));
    TEST_ASSERT_EQUAL_UINT(2, part.feeds);
}

static void test_the_longest_erase_is_waited_for_and_the_watchdog_fed_around_it(void) {
    part.operation_ns = UINT64_C(2000000000);
    TEST_ASSERT_EQUAL_INT(0, erase(0, SECTOR_BYTES));
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(2, part.feeds);
}

static void test_a_controller_that_is_not_there_fails_at_once(void) {
    const uint8_t bytes[4] = {0};
    part.absent = true;
    TEST_ASSERT_EQUAL_INT(-1, device.erase(device.context, 0, SECTOR_BYTES));
    TEST_ASSERT_EQUAL_INT(-1, device.program(device.context, 0, bytes, 4));
    assert_all(0x55, 0, STORAGE);
    TEST_ASSERT_LESS_THAN_UINT64(UINT64_C(1000000), part.now_ns);
}

static void test_nothing_outside_or_out_of_step_is_touched(void) {
    uint8_t bytes[8] = {0};
    static const uint32_t beyond[][2] = {{STORAGE, 4}, {STORAGE - 4, 8}, {UINT32_MAX - 3, 8}};
    for (unsigned i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL_INT(-1, program(beyond[i][0], bytes, beyond[i][1]));
        TEST_ASSERT_EQUAL_INT(-1, device.read(NULL, beyond[i][0], bytes, beyond[i][1]));
    }
    TEST_ASSERT_EQUAL_INT(-1, erase(STORAGE, SECTOR_BYTES));
    TEST_ASSERT_EQUAL_INT(-1, erase(SECTOR_BYTES, STORAGE));
    TEST_ASSERT_EQUAL_INT(-1, erase(4, SECTOR_BYTES));
    TEST_ASSERT_EQUAL_INT(-1, erase(0, 4));
    TEST_ASSERT_EQUAL_INT(-1, program(2, bytes, 4));
    TEST_ASSERT_EQUAL_INT(-1, program(0, bytes, 2));
    assert_all(0x55, 0, STORAGE);
}
