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
 * A save goes into the slot that does not hold the newest state: erase, state, read back, and last
 * of all the header, without which a slot counts for nothing. The bytes: docs/STATE-FORMAT.md.
 *
 * A save takes as long as the device does, which on flash may be seconds: a board with a watchdog
 * feeds it in the device's functions. Each save erases the blocks of one slot once.
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

/* Its own; nothing in it lives longer than a call but the device and slot_size. */
typedef struct plr_state_store {
    plr_block_device device;
    uint32_t slot_size; /* bytes, whole erase blocks */
    uint8_t buffer[PLR_STORE_BUFFER];
} plr_state_store;

/* What was found on the device, or put there. */
typedef struct plr_stored_state {
    uint64_t generation; /* counts the saves, from 1; 0: nothing was saved or restored */
    uint32_t length;     /* bytes of the state */
    uint8_t slot;        /* 0 or 1: where the state stands */
    uint8_t damaged;     /* slots that hold something, but not what was saved */
} plr_stored_state;

/* Prepares a store; the device is copied, what it points to is not, and not touched yet.
 * PLR_E_ARGUMENT a null pointer, or sizes that contradict port.h; PLR_E_FULL the device is too
 * small for two slots of one erase block, or a slot for the header. */
plr_status plr_state_store_init(plr_state_store *store, const plr_block_device *device);

/* Bytes that a device needs for filters like this one, with its erase and program sizes. 0 if the
 * filter is not initialised. */
uint32_t plr_state_store_needs(const plr_state_store *store, const plr_filter *f);

/* Saves the filter, which is not changed. After an error the state that was saved before is still
 * there, and the newest. `saved` may be NULL; it is filled in any case.
 * PLR_E_FULL a slot could not hold this filter with all its landmarks: nothing is written, and it
 * is said at the first save, not when the map has grown; PLR_E_IO the device fails, or does not
 * give back what was programmed; else what plr_filter_save says. */
plr_status plr_state_store_save(plr_state_store *store, const plr_filter *f,
                                plr_stored_state *saved);

/* Brings back the newest state that is whole. The filter must have been initialised as it was when
 * the state was saved; on an error it is as it was before, but as after plr_filter_reset if the
 * device gave other bytes while they were taken over. `found` may be NULL; it is filled in any
 * case. PLR_E_NOT_READY nothing was ever saved here; PLR_E_CORRUPT what was saved is damaged, in
 * both slots; PLR_E_FOREIGN the newest state is of another version, build, calibration or setting:
 * an older one of our own is not taken for it; PLR_E_IO. */
plr_status plr_state_store_restore(plr_state_store *store, plr_filter *f, plr_stored_state *found);

#ifdef __cplusplus
}
#endif

#endif
