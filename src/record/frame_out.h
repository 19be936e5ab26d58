// SPDX-License-Identifier: MIT
/* Sends the body of a frame with checksum, stuffing and delimiter. If the writer's function fails,
 * w->status says so and the rest of the frame is not sent. */
#ifndef PLR_RECORD_FRAME_OUT_H
#define PLR_RECORD_FRAME_OUT_H

#include "pelorus/wire.h"

/* Begins a frame. If the last frame failed, first sends a delimiter that ends its remains. */
void plr_frame_out_begin(plr_writer *w);

/* Sends n more bytes of the body. */
void plr_frame_out_put(plr_writer *w, const uint8_t *bytes, size_t n);

/* Sends the checksum and the delimiter. PLR_OK, or PLR_E_IO if any part of the frame failed. */
plr_status plr_frame_out_end(plr_writer *w);

#endif
