// SPDX-License-Identifier: MIT
/*
 * The saved state of a filter on a block device, in two slots, so that a power cut at any moment
 * leaves the old state or the new one.
 *
 *     static plr_state_store store;
 *     plr_state_store_init(&store, &device);
 *     plr_state_store_restore(&store, &filter, NULL);  // after plr_filter_init
 *     plr_state_store_save(&store, &filter, NULL);     // between two frames, now and then
 *
 * A save uses the slot that does not hold the newest state: it erases the slot, writes the state,
 * reads it back, and writes the header last. A slot without a valid header counts as empty. The
 * bytes: docs/STATE-FORMAT.md.
 *
 * A save lasts as long as the device needs, on flash up to seconds: a board with a watchdog feeds
 * it in the device's functions. Each save erases the blocks of one slot once.
 */
#ifndef PELORUS_STATE_STORE_H
#define PELORUS_STATE_STORE_H

#include "pelorus/filter.h"
#include "pelorus/port.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    PLR_STORE_SLOTS = 2,
    PLR_STORE_HEADER = 28, /* bytes; in a slot it takes whole program units */
    PLR_STORE_BUFFER = 256 /* bytes programmed at once, at most */
};

/* For the library alone. Between two calls only device and slot_size are needed. */
typedef struct plr_state_store {
    plr_block_device device;
    uint32_t slot_size; /* bytes, whole erase blocks */
    uint8_t buffer[PLR_STORE_BUFFER];
} plr_state_store;

/* The state that was found on the device, or saved there. */
typedef struct plr_stored_state {
    uint64_t generation; /* counts the saves, from 1; 0: nothing was saved or restored */
    uint32_t length;     /* bytes of the state */
    uint8_t slot;        /* 0 or 1: where the state stands */
    uint8_t damaged;     /* slots that are not empty and whose bytes fail their check */
} plr_stored_state;

/* Prepares a store. The device is copied, what it points to is not; it is not read or written yet.
 * PLR_E_ARGUMENT a null pointer, or sizes that contradict port.h; PLR_E_FULL the device is too
 * small for two slots of one erase block, or a slot for the header. */
plr_status plr_state_store_init(plr_state_store *store, const plr_block_device *device);

/* Bytes that a device needs for filters like this one. 0 if the filter is not initialised. */
uint32_t plr_state_store_needs(const plr_state_store *store, const plr_filter *f);

/* Saves the filter, which is not changed. After an error the state saved before is still there.
 * `saved` may be NULL; it is filled in any case.
 * PLR_E_FULL a slot is too small for this filter with all slots in use: nothing is written;
 * PLR_E_IO the device failed, or read back other bytes; otherwise as plr_filter_save. */
plr_status plr_state_store_save(plr_state_store *store, const plr_filter *f,
                                plr_stored_state *saved);

/* Restores the newest undamaged state. The filter must have been initialised with the calibration
 * and settings that it had when the state was saved. After an error it is as before, or as after
 * plr_filter_reset if the device gave different bytes in the two readings (plr_filter_restore).
 * `found` may be NULL; it is filled in any case.
 * PLR_E_NOT_READY nothing was ever saved here; PLR_E_CORRUPT what was saved is damaged, in both
 * slots; PLR_E_FOREIGN the newest state was saved by another version or build, or with another
 * calibration or setting (an older state in the other slot is then not used either); PLR_E_IO. */
plr_status plr_state_store_restore(plr_state_store *store, plr_filter *f, plr_stored_state *found);

#ifdef __cplusplus
}
#endif

#endif
