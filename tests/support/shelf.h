// SPDX-License-Identifier: MIT
/* A state store over a flash that can fail, and a few states of one filter: what the store's tests have in
 * common. */
#ifndef PELORUS_TEST_SHELF_H
#define PELORUS_TEST_SHELF_H

#include "pelorus/state_store.h"
#include "support/faulty_flash.h"
#include "support/state_bytes.h"

enum { STATES = 4, LANDMARKS = 2, ERASE = 512, PROGRAM = 8 };

extern plr_filter filter, restored;
extern plr_state_store store;
extern faulty_flash flash;
extern state_bytes states[STATES];
extern plr_stored_state found; /* by the last restore */

/* A specimen, its states, and a new store: for setUp. */
void shelf_set_up(void);

/* The device was used as port.h wants: for tearDown. */
void shelf_tear_down(void);

/* A new device and store of those sizes. */
void shelf_begin(uint32_t size, uint32_t erase_size, uint32_t program_size);

/* The filter becomes itself a moment later: state k. */
void shelf_become(unsigned k);

/* Saves state k. */
plr_status shelf_save(unsigned k);
void shelf_saves(unsigned k);

/* Into the filter `restored`. */
plr_status shelf_restore(void);

/* The number of the state that it is, to the byte; STATES if it is none. */
unsigned shelf_restored(void);

#endif
