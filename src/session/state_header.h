// SPDX-License-Identifier: MIT
/* The header of a slot: docs/STATE-FORMAT.md. */
#ifndef PLR_SESSION_STATE_HEADER_H
#define PLR_SESSION_STATE_HEADER_H

#include "pelorus/state_store.h"
#include "pelorus/wire.h"

typedef struct plr_state_header {
    uint64_t generation;
    uint32_t length, crc; /* of the state */
} plr_state_header;

void plr_state_header_write(uint8_t bytes[PLR_STORE_HEADER], const plr_state_header *header);

/* PLR_OK; PLR_E_NOT_READY the bytes are no header at all; PLR_E_CORRUPT one that is damaged;
 * PLR_E_FOREIGN of another version: only the generation is set. */
plr_status plr_state_header_read(const uint8_t bytes[PLR_STORE_HEADER], plr_state_header *header);

#endif
