// SPDX-License-Identifier: MIT
/* The outside of a frame on its way out: checksum, stuffing, delimiter. A failure of the writer's
 * function is kept in w->status; nothing more of the frame is sent after it. */
#ifndef PELORUS_WIRE_FRAME_OUT_H
#define PELORUS_WIRE_FRAME_OUT_H

#include "pelorus/wire.h"

/* Begins a frame; if the last one failed, with a delimiter that ends what there is of it. */
void plr_frame_out_begin(plr_writer *w);

/* n more bytes of the body. */
void plr_frame_out_put(plr_writer *w, const uint8_t *bytes, size_t n);

/* Appends the checksum and the delimiter. Returns whether the whole frame was sent. */
plr_status plr_frame_out_end(plr_writer *w);

#endif
