// SPDX-License-Identifier: MIT
#include <string.h>

#include "record/bytes.h"
#include "record/frame_out.h"
#include "record/layout.h"

plr_status plr_writer_init(plr_writer *w, plr_write_function write, void *context) {
    if (!w || !write)
        return PLR_E_ARGUMENT;
    *w = (plr_writer){.write = write, .context = context};
    return PLR_OK;
}

/* A layout takes what it could write to; in the directions CHECK and WRITE it only looks. */
static plr_fault pass_payload(plr_pass p, plr_writer *w, const plr_message *message) {
    if (message->kind == PLR_KIND_END) {
        plr_end end = w->counts;
        end.differs = message->as.end.differs;
        memcpy(end.arrived, message->as.end.arrived, sizeof end.arrived);
        plr_layout_end(&p, &end);
    } else {
        plr_layout(&p, (plr_message *)message);
    }
    return p.fault;
}

static plr_status send_frame(plr_writer *w, const plr_message *message) {
    uint8_t head[3] = {(uint8_t)message->kind};
    plr_bytes_put(head + 1, 2, w->sequence);
    w->sequence = (uint16_t)(w->sequence + 1);
    plr_frame_out_begin(w);
    plr_frame_out_put(w, head, sizeof head);
    pass_payload((plr_pass){.direction = PLR_PASS_WRITE, .writer = w}, w, message);
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
    if (pass_payload((plr_pass){.direction = PLR_PASS_CHECK}, w, message) != PLR_FAULT_NONE)
        return PLR_E_ARGUMENT;
    plr_status status = send_frame(w, message);
    if (status == PLR_OK)
        count(&w->counts, message->kind);
    return status;
}
