// SPDX-License-Identifier: MIT
/*
 * Consistent Overhead Byte Stuffing, byte by byte. S. Cheshire, M. Baker: Consistent Overhead Byte
 * Stuffing. IEEE/ACM Transactions on Networking 7(2), 1999.
 *
 * A block is a code byte c and c - 1 data bytes, none of them zero. A zero follows each block in
 * the data, but for the last block and for full ones (c = 0xFF).
 */
#ifndef PLR_RECORD_COBS_H
#define PLR_RECORD_COBS_H

#include "pelorus/wire.h"

/* What one received (stuffed) byte means. */
typedef enum plr_cobs_step {
    PLR_COBS_NOTHING, /* no data: a code byte that stands for no zero */
    PLR_COBS_BYTE,    /* a byte of data */
    PLR_COBS_END,     /* the delimiter after a complete frame */
    PLR_COBS_BROKEN,  /* a delimiter inside a block: bytes are missing */
    PLR_COBS_EMPTY    /* a delimiter without a frame before it */
} plr_cobs_step;

/* Decodes one stuffed byte; *data is set on PLR_COBS_BYTE only. After a delimiter the decoder is
 * ready for the next frame. Initialise it with zeros. */
plr_cobs_step plr_cobs_decode(plr_cobs_decoder *d, uint8_t stuffed, uint8_t *data);

/* True between a frame's first byte and its delimiter. */
bool plr_cobs_in_frame(const plr_cobs_decoder *d);

/* Starts a frame. */
void plr_cobs_begin(plr_cobs_encoder *e);

/* Encodes a byte. Returns how many bytes of e->block to send before the next call, 0 to 255. */
unsigned plr_cobs_encode(plr_cobs_encoder *e, uint8_t data);

/* Ends the frame. Returns how many bytes of e->block must be sent, with the delimiter: 1 to 255. */
unsigned plr_cobs_end(plr_cobs_encoder *e);

#endif
