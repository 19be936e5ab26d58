// SPDX-License-Identifier: MIT
#include "session/state_header.h"

#include <string.h>

#include "wire/bytes.h"

enum { STORE_VERSION = 1, MAGIC = 0, VERSION = 4, GENERATION = 8, LENGTH = 16, CRC = 20, OWN = 24 };

static const uint8_t magic[4] = {'P', 'L', 'R', 'S'};

void plr_state_header_write(uint8_t bytes[PLR_STORE_HEADER], const plr_state_header *header) {
    memcpy(bytes + MAGIC, magic, sizeof magic);
    plr_bytes_put(bytes + VERSION, 4, STORE_VERSION);
    plr_bytes_put(bytes + GENERATION, 8, header->generation);
    plr_bytes_put(bytes + LENGTH, 4, header->length);
    plr_bytes_put(bytes + CRC, 4, header->crc);
    plr_bytes_put(bytes + OWN, 4, plr_crc32(0, bytes, OWN));
}

plr_status plr_state_header_read(const uint8_t bytes[PLR_STORE_HEADER], plr_state_header *header) {
    memset(header, 0, sizeof *header);
    if (memcmp(bytes + MAGIC, magic, sizeof magic) != 0)
        return PLR_E_NOT_READY;
    if (plr_bytes_get(bytes + OWN, 4) != plr_crc32(0, bytes, OWN))
        return PLR_E_CORRUPT;
    header->generation = plr_bytes_get(bytes + GENERATION, 8);
    if (plr_bytes_get(bytes + VERSION, 4) != STORE_VERSION)
        return PLR_E_FOREIGN;
    header->length = (uint32_t)plr_bytes_get(bytes + LENGTH, 4);
    header->crc = (uint32_t)plr_bytes_get(bytes + CRC, 4);
    return PLR_OK;
}
