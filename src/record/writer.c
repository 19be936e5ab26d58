// SPDX-License-Identifier: MIT
#include <string.h>

#include "record/bytes.h"
#include "record/frame_out.h"
#include "record/messages.h"

plr_status plr_writer_init(plr_writer *w, plr_write_function write, void *context) {
    if (!w || !write)
        return PLR_E_ARGUMENT;
    *w = (plr_writer){.write = write, .context = context};
    return PLR_OK;
}

static bool put(void *writer, uint8_t *bytes, unsigned n) {
    plr_frame_out_put(writer, bytes, n);
    return true; /* a failure is kept in the writer */
}

/* The codec takes what it could read into; in these directions it only looks at it. END says what was
 * written, whatever the message says. */
static plr_status pass_payload(plr_direction direction, plr_writer *w, const plr_message *message) {
    plr_codec codec = {.direction = direction, .move = put, .context = w};
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
    uint8_t head[3] = {(uint8_t)message->kind};
    plr_bytes_put(head + 1, 2, w->sequence);
    w->sequence = (uint16_t)(w->sequence + 1);
    plr_frame_out_begin(w);
    plr_frame_out_put(w, head, sizeof head);
    (void)pass_payload(PLR_CODEC_WRITE, w, message);
    return plr_frame_out_end(w);
}

static void count(plr_end *counts, plr_kind kind) {
    counts->frames++;
    if (kind == PLR_KIND_TWIST)
        counts->twists++;
    if (kind == PLR_KIND_STEREO)
        counts->stereos++;
    if (kind == PLR_KIND_TRUTH)
        counts->truths++;
    if (kind == PLR_KIND_LANDMARK)
        counts->landmarks++;
    if (kind == PLR_KIND_READING)
        counts->readings++;
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
