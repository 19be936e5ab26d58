// SPDX-License-Identifier: MIT
#include "record/frame_out.h"

#include "record/bytes.h"
#include "record/cobs.h"

static void send(plr_writer *w, const uint8_t *bytes, size_t n) {
    if (w->status == PLR_OK && n > 0 && w->write(w->context, bytes, n) != 0)
        w->status = PLR_E_IO;
}

void plr_frame_out_begin(plr_writer *w) {
    static const uint8_t delimiter = 0;
    w->status = PLR_OK;
    if (w->torn)
        send(w, &delimiter, 1);
    w->crc = 0;
    plr_cobs_begin(&w->cobs);
}

void plr_frame_out_put(plr_writer *w, const uint8_t *bytes, size_t n) {
    w->crc = plr_crc32(w->crc, bytes, n);
    for (size_t i = 0; i < n; i++)
        send(w, w->cobs.block, plr_cobs_encode(&w->cobs, bytes[i]));
}

plr_status plr_frame_out_end(plr_writer *w) {
    uint8_t crc[4];
    plr_bytes_put(crc, sizeof crc, w->crc);
    plr_frame_out_put(w, crc, sizeof crc);
    send(w, w->cobs.block, plr_cobs_end(&w->cobs));
    w->torn = w->status != PLR_OK;
    return w->status;
}
