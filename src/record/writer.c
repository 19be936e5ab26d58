// SPDX-License-Identifier: MIT
#include <string.h>

#include "record/bytes.h"
#include "record/cobs.h"
#include "record/messages.h"

plr_status plr_writer_init(plr_writer *w, plr_write_function write, void *context) {
    if (!w || !write)
        return PLR_E_ARGUMENT;
    *w = (plr_writer){.write = write, .context = context};
    return PLR_OK;
}

/* If the function of the caller fails, w->status says so, and the rest of the frame is not sent. */
static void send(plr_writer *w, const uint8_t *bytes, size_t n) {
    if (w->status == PLR_OK && n > 0 && w->write(w->context, bytes, n) != 0)
        w->status = PLR_E_IO;
}

/* Sends n more bytes of a frame's body. */
static bool to_frame(void *writer, uint8_t *bytes, unsigned n) {
    plr_writer *w = writer;
    w->crc = plr_crc32(w->crc, bytes, n);
    for (unsigned i = 0; i < n; i++)
        send(w, w->cobs.block, plr_cobs_encode(&w->cobs, bytes[i]));
    return true; /* w->status has the failure */
}

/* The codec takes what it could read into; in these directions it only looks at it. END says what
 * was written, whatever the message says. */
static plr_status pass_payload(plr_direction direction, plr_writer *w, const plr_message *message) {
    plr_codec codec = {.direction = direction, .move = to_frame, .context = w};
    if (message->kind == PLR_KIND_END) {
        plr_end end = w->counts;
        end.differs = message->as.end.differs;
        memcpy(end.arrived, message->as.end.arrived, sizeof end.arrived);
        plr_message_pass(&codec, PLR_KIND_END, &end, NULL);
    } else {
        plr_message_pass(&codec, message->kind, (void *)&message->as, NULL);
    }
    return codec.status;
}

static plr_status send_frame(plr_writer *w, const plr_message *message) {
    static const uint8_t delimiter = 0;
    uint8_t head[3] = {(uint8_t)message->kind}, crc[4];
    plr_bytes_put(head + 1, 2, w->sequence);
    w->sequence = (uint16_t)(w->sequence + 1);
    w->status = PLR_OK;
    w->crc = 0;
    if (w->torn) /* the remains of the last frame end here */
        send(w, &delimiter, 1);
    plr_cobs_begin(&w->cobs);
    to_frame(w, head, sizeof head);
    (void)pass_payload(PLR_CODEC_WRITE, w, message);
    plr_bytes_put(crc, sizeof crc, w->crc);
    to_frame(w, crc, sizeof crc);
    send(w, w->cobs.block, plr_cobs_end(&w->cobs));
    w->torn = w->status != PLR_OK;
    return w->status;
}

static void count(plr_end *counts, plr_kind kind) {
    static const plr_kind kinds[PLR_COUNTED] = {PLR_KIND_TWIST,    PLR_KIND_STEREO,  PLR_KIND_TRUTH,
                                                PLR_KIND_LANDMARK, PLR_KIND_READING, PLR_KIND_IMU};
    counts->frames++;
    for (unsigned i = 0; i < PLR_COUNTED; i++)
        counts->sent[i] += kinds[i] == kind;
}

plr_status plr_writer_put(plr_writer *w, const plr_message *message) {
    if (!w || !message || !w->write)
        return PLR_E_ARGUMENT;
    if (pass_payload(PLR_CODEC_CHECK, w, message) != PLR_OK)
        return PLR_E_ARGUMENT;
    plr_status status = send_frame(w, message);
    if (status == PLR_OK)
        count(&w->counts, message->kind);
    return status;
}
