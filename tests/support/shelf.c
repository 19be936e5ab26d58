// SPDX-License-Identifier: MIT
#include "support/shelf.h"

#include <string.h>
#include <unity.h>

#include "support/reseal.h"
#include "support/specimens.h"

plr_filter filter, restored;
plr_state_store store;
faulty_flash flash;
state_bytes states[STATES];
plr_stored_state found;

void shelf_begin(uint32_t size, uint32_t erase_size, uint32_t program_size) {
    faulty_flash_init(&flash, 11, size, erase_size, program_size);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_state_store_init(&store, &flash.device));
}

void shelf_set_up(void) {
    rng chance = rng_seeded(3);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, true, LANDMARKS);
    filter.config.slots = LANDMARKS;
    reseal(&filter);
    memcpy(&restored, &filter, sizeof restored);
    for (unsigned k = 0; k < STATES; k++) {
        shelf_become(k);
        state_bytes_save(&states[k], &filter);
    }
    shelf_begin(FAULTY_FLASH_BYTES, ERASE, PROGRAM);
}

void shelf_tear_down(void) {
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, flash.violations, "the device was used against port.h");
}

void shelf_become(unsigned k) {
    filter.belief.t_ns = 1000000000u * (k + 1);
    filter.belief.p_WB[0] = k;
    filter.belief.slots[0].times_seen = 10 * k;
    filter.belief.P[0] = PLR_R(0.5) + (plr_real)k;
    reseal(&filter);
}

plr_status shelf_save(unsigned k) {
    shelf_become(k);
    return plr_state_store_save(&store, &filter, NULL);
}

void shelf_saves(unsigned k) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, shelf_save(k));
}

plr_status shelf_restore(void) {
    return plr_state_store_restore(&store, &restored, &found);
}

unsigned shelf_restored(void) {
    static state_bytes back;
    state_bytes_save(&back, &restored);
    for (unsigned k = 0; k < STATES; k++)
        if (state_bytes_same(&back, &states[k]))
            return k;
    return STATES;
}
