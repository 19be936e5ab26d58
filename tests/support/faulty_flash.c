// SPDX-License-Identifier: MIT
#include "support/faulty_flash.h"

#include <string.h>

/* True if the call may go on: there is power, and it keeps to the rules. */
static bool may(faulty_flash *flash, uint32_t offset, uint32_t n, uint32_t unit) {
    const bool inside = offset <= flash->device.size && n <= flash->device.size - offset;
    if (!inside || offset % unit != 0 || n % unit != 0 || n == 0)
        flash->violations++;
    return flash->power && inside;
}

static int read_bytes(void *context, uint32_t offset, uint8_t *bytes, uint32_t n) {
    faulty_flash *flash = context;
    if (!may(flash, offset, n, 1) || ++flash->reads == flash->read_fails_at)
        return -1;
    memcpy(bytes, flash->bytes + offset, n);
    if (flash->reads == flash->read_flips_at)
        bytes[0] ^= (uint8_t)(1U << rng_below(&flash->random, 8));
    return 0;
}

/* The power fails in the middle of a unit that begins at `start`, at the byte `at`. */
static void tear(faulty_flash *flash, uint32_t start, uint32_t unit, uint32_t at, uint8_t wanted) {
    flash->power = false;
    const uint8_t mask = (uint8_t)rng_bits(&flash->random);
    if (flash->tear == FAULTY_FLASH_HALF)
        flash->bytes[at] = (uint8_t)((flash->bytes[at] & mask) | (wanted & (uint8_t)~mask));
    if (flash->tear == FAULTY_FLASH_NOISE)
        for (uint32_t i = start; i < start + unit; i++)
            flash->bytes[i] = (uint8_t)rng_bits(&flash->random);
    for (uint32_t i = start; i < start + unit; i++)
        flash->erased[i] = false;
}

/* False if the power fails before this byte. */
static bool spend(faulty_flash *flash) {
    if (flash->power_left == 0)
        return false;
    if (flash->power_left > 0)
        flash->power_left--;
    flash->work++;
    return true;
}

static int program_bytes(void *context, uint32_t offset, const uint8_t *bytes, uint32_t n) {
    faulty_flash *flash = context;
    const uint32_t unit = flash->device.program_size;
    if (!may(flash, offset, n, unit) || flash->program_fails)
        return -1;
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t at = offset + i;
        if (!spend(flash)) {
            tear(flash, at / unit * unit, unit, at, bytes[i]);
            return -1;
        }
        if (!flash->erased[at])
            flash->violations++;
        flash->erased[at] = false;
        const uint8_t stuck = at == flash->stuck_at ? flash->stuck_mask : 0;
        flash->bytes[at] = (uint8_t)((bytes[i] & ~stuck) | (flash->erased_value & stuck));
    }
    return 0;
}

static int erase_bytes(void *context, uint32_t offset, uint32_t n) {
    faulty_flash *flash = context;
    const uint32_t block = flash->device.erase_size;
    if (!may(flash, offset, n, block) || flash->erase_fails)
        return -1;
    for (uint32_t at = offset; at < offset + n; at++) {
        if (at % block == 0)
            flash->erases[at / block]++;
        if (!spend(flash)) {
            tear(flash, at / block * block, block, at, flash->erased_value);
            return -1;
        }
        flash->bytes[at] = flash->erased_value;
        flash->erased[at] = true;
    }
    return 0;
}

void faulty_flash_init(faulty_flash *flash, uint64_t seed, uint32_t size, uint32_t erase_size,
                       uint32_t program_size) {
    memset(flash, 0, sizeof *flash);
    flash->device = (plr_block_device){.context = flash,
                                       .size = size,
                                       .erase_size = erase_size,
                                       .program_size = program_size,
                                       .read = read_bytes,
                                       .program = program_bytes,
                                       .erase = erase_bytes};
    flash->random = rng_seeded(seed);
    flash->erased_value = 0xFF;
    for (uint32_t i = 0; i < FAULTY_FLASH_BYTES; i++)
        flash->bytes[i] = (uint8_t)rng_bits(&flash->random);
    faulty_flash_restart(flash);
}

void faulty_flash_restart(faulty_flash *flash) {
    flash->power = true;
    flash->power_left = FAULTY_FLASH_ALWAYS;
    flash->stuck_mask = 0;
    flash->read_fails_at = flash->read_flips_at = 0;
    flash->program_fails = flash->erase_fails = false;
    flash->reads = 0;
}
