// SPDX-License-Identifier: MIT
#include "pelorus/assertions.h"
#include "record/bytes.h"
#include "record/cobs.h"
#include "record/messages.h"

/* The checksum of a body together with its own checksum: the same for every good body. */
static const uint32_t GOOD_CRC = 0x2144DF1C;

enum { AT_SEQUENCE = 1, AT_PAYLOAD = 3, STEP_BACK = 0x8000 };

plr_status plr_reader_init(plr_reader *r, uint8_t *buffer, size_t buffer_size,
                           plr_observation *observations, unsigned max_observations) {
    if (!r || !buffer || buffer_size < PLR_WIRE_MIN_BUFFER || (!observations && max_observations))
        return PLR_E_ARGUMENT;
    *r = (plr_reader){.buffer = buffer,
                      .buffer_size = buffer_size,
                      .observations = observations,
                      .max_observations = max_observations};
    return PLR_OK;
}

/* The message of a body whose checksum is good. PLR_OK, or as plr_message_pass. */
static plr_status decode(plr_reader *r, plr_message *message) {
    PLR_ASSERT(r->length >= PLR_WIRE_OVERHEAD && r->length <= r->buffer_size);
    const uint16_t sequence = (uint16_t)plr_bytes_get(r->buffer + AT_SEQUENCE, 2);
    const uint16_t gap = (uint16_t)(sequence - r->next_sequence);
    if (gap < STEP_BACK) /* else it is no gap of almost 2^16 frames: the sender began anew */
        r->counts.missing += gap;
    r->next_sequence = (uint16_t)(sequence + 1);
    if (r->overrun)
        return PLR_E_FULL;
    const uint8_t *payload = r->buffer + AT_PAYLOAD;
    const plr_observation_room room = {r->observations, r->max_observations};
    plr_codec codec = {.direction = PLR_CODEC_READ,
                       .move = plr_codec_take,
                       .context = &payload,
                       .left = r->length - PLR_WIRE_OVERHEAD};
    message->kind = (plr_kind)r->buffer[0];
    message->sequence = sequence;
    plr_message_pass(&codec, message->kind, &message->as, &room);
    return codec.status;
}

static plr_read_event skip(plr_reader *r, plr_skip why, uint32_t *count) {
    ++*count;
    r->skipped_at = r->frame_start;
    r->skipped_why = why;
    r->skipped_kind = why == PLR_SKIP_DAMAGED ? PLR_KIND_NONE : r->buffer[0];
    return PLR_READ_SKIPPED;
}

static plr_read_event refuse(plr_reader *r, plr_status fault, plr_message *message) {
    if (fault == PLR_E_FOREIGN && message->kind == PLR_KIND_HEADER) {
        r->future = true;
        return PLR_READ_FUTURE;
    }
    message->kind = PLR_KIND_NONE;
    if (fault == PLR_E_FOREIGN)
        return skip(r, PLR_SKIP_UNKNOWN, &r->counts.unknown);
    if (fault == PLR_E_FULL)
        return skip(r, PLR_SKIP_TOO_LONG, &r->counts.too_long);
    return skip(r, PLR_SKIP_MALFORMED, &r->counts.malformed);
}

/* `whole`: the stuffing came out even. */
static plr_read_event end_frame(plr_reader *r, bool whole, plr_message *message) {
    if (!whole || r->length < PLR_WIRE_OVERHEAD || r->crc != GOOD_CRC)
        return skip(r, PLR_SKIP_DAMAGED, &r->counts.damaged);
    const plr_status fault = decode(r, message);
    if (fault != PLR_OK)
        return refuse(r, fault, message);
    r->counts.frames++;
    return PLR_READ_MESSAGE;
}

static plr_cobs_step take_byte(plr_reader *r, uint8_t stuffed) {
    uint8_t byte;
    if (!plr_cobs_in_frame(&r->cobs)) {
        r->frame_start = r->counts.bytes;
        r->length = 0;
        r->crc = 0;
        r->overrun = false;
    }
    PLR_ASSERT(r->length <= r->buffer_size);
    r->counts.bytes++;
    plr_cobs_step step = plr_cobs_decode(&r->cobs, stuffed, &byte);
    if (step != PLR_COBS_BYTE)
        return step;
    r->crc = plr_crc32(r->crc, &byte, 1); /* of what does not fit, too: is it long, or damaged? */
    if (r->length < r->buffer_size)
        r->buffer[r->length++] = byte;
    else
        r->overrun = true;
    return step;
}

plr_read_event plr_reader_feed(plr_reader *r, const uint8_t *bytes, size_t n, size_t *taken,
                               plr_message *message) {
    PLR_ASSERT(r->buffer && (bytes || n == 0));
    message->kind = PLR_KIND_NONE;
    if (r->future) {
        r->counts.bytes += n;
        *taken = n;
        return PLR_READ_FUTURE;
    }
    for (size_t i = 0; i < n; i++) {
        plr_cobs_step step = take_byte(r, bytes[i]);
        if (step == PLR_COBS_END || step == PLR_COBS_BROKEN) {
            *taken = i + 1;
            return end_frame(r, step == PLR_COBS_END, message);
        }
    }
    *taken = n;
    return PLR_READ_MORE;
}

bool plr_reader_mid_frame(const plr_reader *r) {
    return plr_cobs_in_frame(&r->cobs);
}
