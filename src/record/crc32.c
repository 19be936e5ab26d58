// SPDX-License-Identifier: MIT
#include "pelorus/wire.h"

/* Entry i: the remainder of i after four steps with the reflected polynomial 0xEDB88320. Half a
 * byte at a time takes 64 bytes of flash; a table for whole bytes would take 1024. */
static const uint32_t remainder_of_nibble[16] = {
    0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4, 0x4DB26158, 0x5005713C,
    0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C, 0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C};

uint32_t plr_crc32(uint32_t crc, const uint8_t *bytes, size_t n) {
    crc = ~crc;
    for (size_t i = 0; i < n; i++) {
        crc ^= bytes[i];
        crc = crc >> 4 ^ remainder_of_nibble[crc & 15];
        crc = crc >> 4 ^ remainder_of_nibble[crc & 15];
    }
    return ~crc;
}
