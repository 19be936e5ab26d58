// SPDX-License-Identifier: MIT
/* Two slots, a power cut, and what is there after the restart: the old state or the new one. */
#include <string.h>
#include <unity.h>

#include "support/shelf.h"

/* In the short form the power is cut at every seventh byte: at each place of a program unit in turn. */
enum { STRIDE = PELORUS_SHORT_FORM ? 7 : 1 };

static faulty_flash worn;

void setUp(void) {
    shelf_set_up();
}

void tearDown(void) {
    shelf_tear_down();
}

/* What a restart finds. */
static plr_status restart(void) {
    faulty_flash_restart(&flash);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_state_store_init(&store, &flash.device));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_reset(&restored));
    return shelf_restore();
}

static void restart_finds(unsigned k) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, restart());
    TEST_ASSERT_EQUAL_UINT(k, shelf_restored());
}

/* ---------------------------------------------------------------- without faults */

static void test_the_newest_state_comes_back(void) {
    for (unsigned k = 0; k < STATES; k++) {
        shelf_saves(k);
        restart_finds(k);
        TEST_ASSERT_EQUAL_UINT64(k + 1, found.generation);
        TEST_ASSERT_EQUAL_UINT(k % 2, found.slot);
        TEST_ASSERT_EQUAL_UINT(0, found.damaged);
    }
}

static void test_a_new_device_holds_nothing(void) {
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, restart());
    TEST_ASSERT_EQUAL_UINT64(0, found.generation);
}

static void test_the_slots_are_worn_alike(void) {
    const unsigned second = store.slot_size / ERASE;
    const unsigned before = flash.erases[0] + flash.erases[second];
    for (unsigned i = 0; i < 10; i++)
        shelf_saves(i % STATES);
    TEST_ASSERT_EQUAL_UINT(0, before);
    TEST_ASSERT_EQUAL_UINT(5, flash.erases[0]);
    TEST_ASSERT_EQUAL_UINT(5, flash.erases[second]);
}

static void test_any_program_and_erase_size_will_do(void) {
    const uint32_t programs[] = {1, 2, 3, 4, 8, 16, 28, 29, 64, 100, 255, 256};
    for (unsigned i = 0; i < sizeof programs / sizeof *programs; i++)
        for (unsigned blocks = 1; blocks <= 2; blocks++) {
            const uint32_t erase_size = programs[i] * (blocks == 1 ? 1 : 32);
            shelf_begin(FAULTY_FLASH_BYTES / erase_size * erase_size, erase_size, programs[i]);
            for (unsigned k = 0; k < STATES; k++)
                shelf_saves(k);
            restart_finds(STATES - 1);
            TEST_ASSERT_EQUAL_UINT(0, flash.violations);
        }
}

static void test_the_erased_value_does_not_matter(void) {
    flash.erased_value = 0;
    for (unsigned k = 0; k < STATES; k++) {
        shelf_saves(k);
        restart_finds(k);
    }
}

static void test_what_fills_the_last_units_is_zero(void) {
    shelf_begin(2 * 9000, 9000, 100);
    shelf_saves(0);
    for (uint32_t at = PLR_STORE_HEADER; at < 100; at++)
        TEST_ASSERT_EQUAL_UINT8(0, flash.bytes[at]);
    for (uint32_t at = 100 + states[0].length; at % 100 != 0; at++)
        TEST_ASSERT_EQUAL_UINT8(0, flash.bytes[at]);
}

static void test_saving_changes_no_bit_of_the_filter(void) {
    shelf_become(1);
    static plr_filter before;
    memcpy(&before, &filter, sizeof before);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_state_store_save(&store, &filter, NULL));
    TEST_ASSERT_EQUAL_MEMORY(&before, &filter, sizeof before);
}

/* ---------------------------------------------------------------- cuts */

/* Cuts the power at every STRIDEth byte of the save of state k, after `saved` earlier ones, and behind the
 * last, and restarts. */
static void cut_everywhere(unsigned saved, faulty_flash_tear tear) {
    unsigned olds = 0, news = 0;
    for (unsigned k = 0; k < saved; k++)
        shelf_saves(k);
    memcpy(&worn, &flash, sizeof worn);
    shelf_saves(saved);
    const uint64_t work = flash.work - worn.work;
    for (uint64_t cut = work % STRIDE; cut <= work; cut += STRIDE) {
        memcpy(&flash, &worn, sizeof flash);
        flash.random = rng_seeded(cut);
        flash.tear = tear;
        flash.power_left = (long)cut;
        const plr_status status = shelf_save(saved);
        TEST_ASSERT_EQUAL_INT(cut < work ? PLR_E_IO : PLR_OK, status);
        const plr_status after = restart();
        if (saved == 0 && after != PLR_OK) {
            TEST_ASSERT_TRUE(after == PLR_E_NOT_READY || after == PLR_E_CORRUPT);
            olds++;
            continue;
        }
        TEST_ASSERT_EQUAL_INT(PLR_OK, after);
        const unsigned state = shelf_restored();
        TEST_ASSERT_TRUE(state == saved || (saved > 0 && state + 1 == saved));
        TEST_ASSERT_TRUE(status != PLR_OK || state == saved);
        olds += state != saved;
        news += state == saved;
        /* and the next save is as good as any */
        if (cut % 64 == 0) {
            shelf_saves(STATES - 1);
            restart_finds(STATES - 1);
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT(0, news);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT64((work - PROGRAM) / STRIDE, olds);
    TEST_ASSERT_EQUAL_UINT(0, flash.violations);
}

static void test_a_cut_in_the_first_save_leaves_nothing_or_the_whole(void) {
    cut_everywhere(0, FAULTY_FLASH_HALF);
}

static void test_a_cut_in_the_second_save_leaves_the_first_or_the_second(void) {
    cut_everywhere(1, FAULTY_FLASH_HALF);
}

static void test_a_cut_in_the_third_save_leaves_the_second_or_the_third(void) {
    cut_everywhere(2, FAULTY_FLASH_HALF);
}

static void test_a_cut_that_leaves_the_byte_as_it_was_does_no_harm_either(void) {
    cut_everywhere(2, FAULTY_FLASH_UNTOUCHED);
}

static void test_a_cut_that_leaves_noise_in_the_whole_unit_does_no_harm_either(void) {
    cut_everywhere(2, FAULTY_FLASH_NOISE);
}

static void test_cut_after_cut_the_last_whole_state_stays(void) {
    rng chance = rng_seeded(5);
    shelf_saves(0);
    for (unsigned i = 0; i < 300; i++) {
        flash.tear = (faulty_flash_tear)rng_below(&chance, 3);
        flash.power_left = (long)rng_below(&chance, 3 * ERASE);
        TEST_ASSERT_EQUAL_INT(PLR_E_IO, shelf_save(1));
        restart_finds(0);
        TEST_ASSERT_EQUAL_UINT64(1, found.generation);
    }
    shelf_saves(2);
    restart_finds(2);
    TEST_ASSERT_EQUAL_UINT64(2, found.generation);
}
