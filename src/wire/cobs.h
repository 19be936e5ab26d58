// SPDX-License-Identifier: MIT
/*
 * Consistent Overhead Byte Stuffing, byte by byte. S. Cheshire, M. Baker: Consistent Overhead Byte
 * Stuffing. IEEE/ACM Transactions on Networking 7(2), 1999.
 *
 * A block is a code byte c and c - 1 data bytes, none of them zero. A zero follows each block in
 * the data, but for the last block and for full ones (c = 0xFF).
 */
#ifndef PELORUS_WIRE_COBS_H
#define PELORUS_WIRE_COBS_H

#include "pelorus/wire.h"

/* What a stuffed byte came to. */
typedef enum plr_cobs_step {
    PLR_COBS_NOTHING, /* a code byte without a zero before it */
    PLR_COBS_BYTE,    /* a byte of data */
    PLR_COBS_END,     /* the delimiter behind a whole frame */
    PLR_COBS_BROKEN,  /* the delimiter within a block */
    PLR_COBS_EMPTY    /* a delimiter without a frame */
} plr_cobs_step;

/* Takes one stuffed byte; *data is set on PLR_COBS_BYTE only. A delimiter makes ready for the next
 * frame. Start with a decoder of zeros. */
plr_cobs_step plr_cobs_decode(plr_cobs_decoder *d, uint8_t stuffed, uint8_t *data);

/* True between a frame's first byte and its delimiter. */
bool plr_cobs_in_frame(const plr_cobs_decoder *d);

/* Makes ready for a frame. */
void plr_cobs_begin(plr_cobs_encoder *e);

/* Takes one byte of data. Returns how many bytes of e->block are now to be sent, 0 to 255; after
 * that the block is the encoder's again. */
unsigned plr_cobs_encode(plr_cobs_encoder *e, uint8_t data);

/* Ends the frame: the bytes of e->block still to be sent, the delimiter last, 1 to 255. */
unsigned plr_cobs_end(plr_cobs_encoder *e);

#endif
