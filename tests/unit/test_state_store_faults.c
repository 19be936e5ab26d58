// SPDX-License-Identifier: MIT
/* A device that fails, and states that are damaged or not ours: refused, and nothing else happens. */
#include <string.h>
#include <unity.h>

#include "pelorus/wire.h"
#include "support/reseal.h"
#include "support/shelf.h"

enum { STATE_AT = 32 /* in a slot */ };

/* Where the state's fields stand (docs/STATE-FORMAT.md). */
enum { STATE_VERSION_AT = 4, FINGERPRINT_AT = 8, FIRST_SETTING_AT = 14 };

static plr_filter untouched;
static faulty_flash good;

void setUp(void) {
    shelf_set_up();
}

void tearDown(void) {
    shelf_tear_down();
}

static void restores(unsigned k) {
    faulty_flash_restart(&flash);
    TEST_ASSERT_EQUAL_INT(PLR_OK, shelf_restore());
    TEST_ASSERT_EQUAL_UINT(k, shelf_restored());
}

static void refuses(plr_status expected) {
    memcpy(&untouched, &restored, sizeof untouched);
    TEST_ASSERT_EQUAL_INT(expected, shelf_restore());
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &restored, sizeof restored);
    TEST_ASSERT_EQUAL_UINT64(0, found.generation);
}

static uint8_t *slot(unsigned k) {
    return flash.bytes + k * store.slot_size;
}

static void put(uint8_t *bytes, uint32_t value) {
    for (unsigned i = 0; i < 4; i++)
        bytes[i] = (uint8_t)(value >> (8 * i));
}

/* Both CRCs of a slot made right again, for what a forger or another version would write. */
static void make_whole(unsigned k) {
    uint8_t *header = slot(k);
    uint32_t length = 0;
    for (unsigned i = 4; i-- > 0;)
        length = length << 8 | header[16 + i];
    if (length <= store.slot_size - STATE_AT)
        put(header + 20, plr_crc32(0, header + STATE_AT, length));
    put(header + 24, plr_crc32(0, header, 24));
}

/* ---------------------------------------------------------------- damage */

static void test_a_flipped_bit_anywhere_is_found(void) {
    shelf_saves(0);
    const uint32_t length = STATE_AT + states[0].length;
    for (uint32_t bit = 0; bit < 8 * length; bit++) {
        const uint32_t at = bit / 8;
        if (at >= PLR_STORE_HEADER && at < STATE_AT)
            continue; /* padding */
        flash.bytes[at] ^= (uint8_t)(1U << bit % 8);
        const plr_status status = shelf_restore();
        TEST_ASSERT_EQUAL_INT(at < 4 ? PLR_E_NOT_READY : PLR_E_CORRUPT, status);
        TEST_ASSERT_EQUAL_UINT(at < 4 ? 0 : 1, found.damaged);
        flash.bytes[at] ^= (uint8_t)(1U << bit % 8);
    }
    restores(0);
}

static void test_a_refusal_of_damage_changes_nothing(void) {
    shelf_saves(0);
    slot(0)[STATE_AT + 200] ^= 4;
    refuses(PLR_E_CORRUPT);
}

static void test_a_flipped_bit_in_the_newest_state_leaves_the_one_before(void) {
    shelf_saves(0);
    shelf_saves(1);
    for (uint32_t at = 0; at < STATE_AT + states[1].length; at += 3) {
        if (at >= PLR_STORE_HEADER && at < STATE_AT)
            continue;
        slot(1)[at] ^= 0x10;
        restores(0);
        TEST_ASSERT_EQUAL_UINT64(1, found.generation);
        TEST_ASSERT_EQUAL_UINT(at < 4 ? 0 : 1, found.damaged);
        slot(1)[at] ^= 0x10;
    }
    restores(1);
}

static void test_damage_in_both_slots_is_refused_and_the_next_save_mends_it(void) {
    shelf_saves(0);
    shelf_saves(1);
    slot(0)[STATE_AT] ^= 1;
    slot(1)[STATE_AT] ^= 1;
    refuses(PLR_E_CORRUPT);
    TEST_ASSERT_EQUAL_UINT(2, found.damaged);
    shelf_saves(2);
    restores(2);
    TEST_ASSERT_EQUAL_UINT(1, found.damaged);
}

static void test_bits_that_do_not_program_fail_the_save_and_leave_the_old_state(void) {
    shelf_saves(0);
    memcpy(&good, &flash, sizeof good);
    const uint32_t length = STATE_AT + states[1].length;
    unsigned failed = 0, harmless = 0;
    for (uint32_t at = 0; at < length; at++) {
        memcpy(&flash, &good, sizeof flash);
        flash.stuck_at = store.slot_size + at;
        flash.stuck_mask = 0x24;
        const plr_status status = shelf_save(1);
        failed += status != PLR_OK;
        harmless += status == PLR_OK; /* padding, or bits that should be as they are */
        TEST_ASSERT_TRUE(status == PLR_OK || status == PLR_E_IO);
        restores(status == PLR_OK ? 1 : 0);
    }
    TEST_ASSERT_GREATER_THAN_UINT(length / 2, failed);
    TEST_ASSERT_GREATER_THAN_UINT(0, harmless);
}

static void test_bits_that_flip_while_they_are_taken_over_reset_the_filter(void) {
    shelf_saves(0);
    faulty_flash_restart(&flash);
    TEST_ASSERT_EQUAL_INT(PLR_OK, shelf_restore());
    const unsigned reads = flash.reads;
    unsigned reset = 0;
    for (unsigned call = 1; call <= reads; call++) {
        faulty_flash_restart(&flash);
        memcpy(&untouched, &filter, sizeof untouched);
        memcpy(&restored, &filter, sizeof restored);
        flash.read_flips_at = call;
        if (shelf_restore() == PLR_OK) { /* it was in bytes that were only looked at */
            TEST_ASSERT_EQUAL_UINT(0, shelf_restored());
            continue;
        }
        if (memcmp(&untouched, &restored, sizeof restored) == 0)
            continue;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_reset(&untouched));
        TEST_ASSERT_TRUE(state_bytes_same_filter(&untouched, &restored));
        reset++;
    }
    TEST_ASSERT_GREATER_THAN_UINT(10, reset);
}

/* ---------------------------------------------------------------- foreign */

static void test_a_state_of_another_build_is_refused(void) {
    shelf_saves(0);
    for (unsigned byte = 0; byte < 4; byte++) {
        slot(0)[STATE_AT + FINGERPRINT_AT + byte] ^= 1;
        make_whole(0);
        refuses(PLR_E_FOREIGN);
        slot(0)[STATE_AT + FINGERPRINT_AT + byte] ^= 1;
    }
    make_whole(0);
    restores(0);
}

static void test_a_state_of_another_version_is_refused(void) {
    shelf_saves(0);
    slot(0)[STATE_AT + STATE_VERSION_AT]++;
    make_whole(0);
    refuses(PLR_E_FOREIGN);
}

static void test_a_slot_of_another_version_is_refused(void) {
    shelf_saves(0);
    slot(0)[4]++;
    make_whole(0);
    refuses(PLR_E_FOREIGN);
}

static void test_a_state_of_other_settings_is_refused(void) {
    shelf_saves(0);
    slot(0)[STATE_AT + FIRST_SETTING_AT + 9] ^= 1;
    make_whole(0);
    refuses(PLR_E_FOREIGN);
}

static void test_an_old_state_of_ours_is_not_taken_for_a_newer_foreign_one(void) {
    shelf_saves(0);
    shelf_saves(1);
    slot(1)[STATE_AT + FINGERPRINT_AT] ^= 1;
    make_whole(1);
    refuses(PLR_E_FOREIGN);
    shelf_saves(2);
    restores(2);
    TEST_ASSERT_EQUAL_UINT64(3, found.generation);
    TEST_ASSERT_EQUAL_UINT(0, found.slot);
}

static void test_an_old_state_of_ours_is_not_taken_for_a_newer_slot_of_another_version(void) {
    shelf_saves(0);
    shelf_saves(1);
    slot(1)[4]++;
    make_whole(1);
    refuses(PLR_E_FOREIGN);
    TEST_ASSERT_EQUAL_UINT(0, found.damaged);
    shelf_saves(2);
    restores(2);
    TEST_ASSERT_EQUAL_UINT64(3, found.generation);
}

static void test_a_length_that_leaves_the_slot_is_damage(void) {
    const uint32_t lengths[] = {0, store.slot_size - STATE_AT + 1, store.slot_size, 0x7FFFFFFF,
                                0xFFFFFFFF};
    shelf_saves(0);
    shelf_saves(1);
    for (unsigned i = 0; i < sizeof lengths / sizeof *lengths; i++) {
        put(slot(1) + 16, lengths[i]);
        if (lengths[i] == 0)
            put(slot(1) + 20, 0); /* the CRC of nothing */
        make_whole(1);
        restores(0);
        TEST_ASSERT_EQUAL_UINT(1, found.damaged);
        TEST_ASSERT_EQUAL_UINT(0, flash.violations); /* nothing is read from beyond the device */
    }
    put(slot(1) + 16, store.slot_size - STATE_AT); /* just inside, but no state is so long */
    make_whole(1);
    refuses(PLR_E_CORRUPT);
}

/* ---------------------------------------------------------------- a device that fails */

static void test_a_device_that_does_not_read_is_said_to_fail(void) {
    shelf_saves(0);
    shelf_saves(1);
    faulty_flash_restart(&flash);
    TEST_ASSERT_EQUAL_INT(PLR_OK, shelf_restore());
    const unsigned reads = flash.reads;
    unsigned refused = 0;
    for (unsigned call = 1; call <= reads; call++) {
        faulty_flash_restart(&flash);
        flash.read_fails_at = call;
        const plr_status status = shelf_restore();
        TEST_ASSERT_TRUE(status == PLR_E_IO || (status == PLR_OK && found.damaged == 1));
        refused += status != PLR_OK;
    }
    TEST_ASSERT_GREATER_THAN_UINT(0, refused);
    flash.power = false;
    refuses(PLR_E_IO);
}

static void test_a_device_that_does_not_write_fails_the_save_alone(void) {
    shelf_saves(0);
    flash.erase_fails = true;
    TEST_ASSERT_EQUAL_INT(PLR_E_IO, shelf_save(1));
    restores(0);
    flash.program_fails = true;
    TEST_ASSERT_EQUAL_INT(PLR_E_IO, shelf_save(1));
    restores(0);
    shelf_saves(1);
    restores(1);
}

static void test_damage_in_one_slot_does_not_hide_that_the_other_cannot_be_read(void) {
    shelf_saves(0);
    slot(0)[STATE_AT] ^= 1;
    faulty_flash_restart(&flash);
    TEST_ASSERT_EQUAL_INT(PLR_E_CORRUPT, shelf_restore());
    const unsigned reads = flash.reads; /* the last one was of slot 1 */
    faulty_flash_restart(&flash);
    flash.read_fails_at = reads;
    refuses(PLR_E_IO);
    TEST_ASSERT_EQUAL_UINT(2, found.damaged);
}

static void test_if_slot_0_cannot_be_read_slot_1_is_used(void) {
    flash.read_fails_at = 1;
    shelf_saves(0);
    restores(0);
    TEST_ASSERT_EQUAL_UINT(1, found.slot);
}

/* ---------------------------------------------------------------- what cannot be */

static plr_status init_with(uint32_t size, uint32_t erase_size, uint32_t program_size) {
    flash.device.size = size;
    flash.device.erase_size = erase_size;
    flash.device.program_size = program_size;
    return plr_state_store_init(&store, &flash.device);
}

static void test_a_device_that_contradicts_itself_is_refused(void) {
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, init_with(4096, 512, 0));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, init_with(4096, 512, 257));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, init_with(4096, 0, 8));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, init_with(4096, 100, 8));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, init_with(4000, 512, 8));
    TEST_ASSERT_EQUAL_INT(PLR_E_FULL, init_with(0, 512, 8));
    TEST_ASSERT_EQUAL_INT(PLR_E_FULL, init_with(512, 512, 8));
    TEST_ASSERT_EQUAL_INT(PLR_E_FULL, init_with(64, 32, 8));
    TEST_ASSERT_EQUAL_INT(PLR_OK, init_with(1024, 512, 8));
    flash.device.erase = NULL;
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, init_with(1024, 512, 8));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_state_store_init(&store, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_state_store_init(NULL, &flash.device));
}

static void test_a_device_that_could_not_hold_a_full_map_is_refused_at_the_first_save(void) {
    const uint32_t needs = plr_state_store_needs(&store, &filter);
    TEST_ASSERT_EQUAL_UINT32(0, needs % ERASE);
    TEST_ASSERT_EQUAL_INT(PLR_OK, init_with(needs, ERASE, PROGRAM));
    shelf_saves(0);
    TEST_ASSERT_EQUAL_INT(PLR_OK, init_with(needs - ERASE, ERASE, PROGRAM));
    const uint64_t work = flash.work;
    TEST_ASSERT_EQUAL_INT(PLR_E_FULL, shelf_save(1));
    TEST_ASSERT_EQUAL_UINT64(work, flash.work);
    TEST_ASSERT_EQUAL_INT(PLR_OK, init_with(needs, ERASE, PROGRAM));
    filter.config.slots = 3 * LANDMARKS; /* two of six are there: they would fit */
    TEST_ASSERT_EQUAL_INT(PLR_E_FULL, shelf_save(1));
}

static void test_a_broken_filter_is_not_saved_over_a_good_one(void) {
    shelf_saves(0);
    const uint64_t work = flash.work;
    const plr_real sound = filter.belief.P[2];
    filter.belief.P[2] = -1; /* the variance of rho_y */
    reseal(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_E_DIVERGED, shelf_save(1));
    filter.belief.P[2] = sound;
    reseal(&filter);
    filter.belief.bias[1] = (plr_real)NAN;
    reseal(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_FINITE, shelf_save(1));
    filter.magic = 0;
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, shelf_save(1));
    TEST_ASSERT_EQUAL_UINT32(0, plr_state_store_needs(&store, &filter));
    TEST_ASSERT_EQUAL_UINT64(work, flash.work);
    restores(0);
}

static void test_null_pointers_are_refused(void) {
    shelf_saves(0);
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_state_store_save(NULL, &filter, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_state_store_save(&store, NULL, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_state_store_restore(NULL, &filter, &found));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_state_store_restore(&store, NULL, &found));
    TEST_ASSERT_EQUAL_UINT64(0, found.generation);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_state_store_restore(&store, &restored, NULL));
    restored.magic = 0;
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, shelf_restore());
}
