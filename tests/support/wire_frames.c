// SPDX-License-Identifier: MIT
#include "support/wire_frames.h"

#include <string.h>
#include <unity.h>

#include "record/codec.h"
#include "record/messages.h"

byte_sink byte_sink_over(uint8_t *bytes, size_t capacity) {
    return (byte_sink){
        .bytes = bytes, .capacity = capacity, .fail_at = capacity, .shortest_call = capacity};
}

int byte_sink_write(void *sink, const uint8_t *bytes, size_t n) {
    byte_sink *s = sink;
    size_t fits = s->fail_at - s->length < n ? s->fail_at - s->length : n;
    memcpy(s->bytes + s->length, bytes, fits);
    s->length += fits;
    s->calls++;
    if (n > s->longest_call)
        s->longest_call = n;
    if (n < s->shortest_call)
        s->shortest_call = n;
    return fits < n;
}

/* Bit by bit, as the polynomial says. */
static uint32_t crc_of(const uint8_t *bytes, size_t n) {
    uint32_t crc = 0xFFFFFFFF;
    for (size_t i = 0; i < 8 * n; i++) {
        uint32_t bit = (uint32_t)(bytes[i / 8] >> i % 8 & 1);
        crc = crc >> 1 ^ ((crc ^ bit) & 1 ? 0xEDB88320 : 0);
    }
    return crc ^ 0xFFFFFFFF;
}

static size_t stuff(const uint8_t *body, size_t n, uint8_t *out) {
    size_t code_at = 0, length = 1;
    bool full = false;
    for (size_t i = 0; i < n; i++) {
        if (body[i] != 0)
            out[length++] = body[i];
        full = length - code_at == 255;
        if (full || body[i] == 0) {
            out[code_at] = (uint8_t)(length - code_at);
            code_at = length++;
        }
    }
    out[code_at] = (uint8_t)(length - code_at);
    if (full) /* at the very end: no empty block */
        length--;
    out[length++] = 0;
    return length;
}

size_t wire_frame(unsigned kind, unsigned sequence, const uint8_t *payload, size_t n,
                  uint8_t *stuffed) {
    static uint8_t body[2 * WIRE_BUFFER_SIZE];
    TEST_ASSERT_LESS_OR_EQUAL_size_t(sizeof body - PLR_WIRE_OVERHEAD, n);
    body[0] = (uint8_t)kind;
    body[1] = (uint8_t)(sequence & 255);
    body[2] = (uint8_t)(sequence >> 8 & 255);
    memcpy(body + 3, payload, n);
    uint32_t crc = crc_of(body, n + 3);
    for (unsigned i = 0; i < 4; i++)
        body[n + 3 + i] = (uint8_t)(crc >> 8 * i & 255);
    return stuff(body, n + PLR_WIRE_OVERHEAD, stuffed);
}

/* The body of the one frame in `stuffed`; returns its length. */
static size_t unstuff(const uint8_t *stuffed, size_t n, uint8_t *body) {
    size_t length = 0, at = 0;
    while (stuffed[at] != 0) {
        unsigned code = stuffed[at];
        TEST_ASSERT_LESS_THAN_size_t(n, at + code);
        memcpy(body + length, stuffed + at + 1, code - 1);
        length += code - 1;
        at += code;
        if (code < 255 && stuffed[at] != 0)
            body[length++] = 0;
    }
    return length;
}

size_t wire_payload(const plr_message *message, uint8_t *payload, size_t capacity) {
    static uint8_t stuffed[2 * WIRE_BUFFER_SIZE], body[2 * WIRE_BUFFER_SIZE];
    byte_sink sink = byte_sink_over(stuffed, sizeof stuffed);
    plr_writer w;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_init(&w, byte_sink_write, &sink));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_put(&w, message));
    size_t length = unstuff(stuffed, sink.length, body) - PLR_WIRE_OVERHEAD;
    TEST_ASSERT_LESS_OR_EQUAL_size_t(capacity, length);
    memcpy(payload, body + 3, length);
    return length;
}

plr_status wire_read_payload(plr_kind kind, const uint8_t *payload, size_t n, plr_message *m) {
    static plr_observation observations[PLR_WIRE_MAX_OBSERVATIONS];
    static uint8_t room_at_end[WIRE_BUFFER_SIZE + 4096];
    const plr_observation_room room = {observations, PLR_WIRE_MAX_OBSERVATIONS};
    TEST_ASSERT_LESS_OR_EQUAL_size_t(sizeof room_at_end, n);
    const uint8_t *at = room_at_end + sizeof room_at_end - n;
    plr_codec codec = {
        .direction = PLR_CODEC_READ, .move = plr_codec_take, .context = &at, .left = n};
    memcpy(room_at_end + sizeof room_at_end - n, payload, n);
    memset(m, 0, sizeof *m);
    m->kind = kind;
    plr_message_pass(&codec, kind, &m->as, &room);
    return codec.status;
}

plr_reader wire_reader(void) {
    static uint8_t buffer[WIRE_BUFFER_SIZE];
    static plr_observation observations[PLR_WIRE_MAX_OBSERVATIONS];
    plr_reader r;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_reader_init(&r, buffer, sizeof buffer, observations,
                                                  PLR_WIRE_MAX_OBSERVATIONS));
    return r;
}

unsigned wire_read_all(plr_reader *r, const uint8_t *bytes, size_t n, wire_on_message on_message,
                       void *context) {
    unsigned messages = 0;
    while (n > 0) {
        plr_message message;
        size_t taken = 0;
        plr_read_event event = plr_reader_feed(r, bytes, n, &taken, &message);
        TEST_ASSERT_TRUE(taken > 0 && taken <= n);
        TEST_ASSERT_TRUE(event != PLR_READ_MORE || taken == n);
        if (event == PLR_READ_MESSAGE) {
            messages++;
            if (on_message)
                on_message(context, &message);
        }
        bytes += taken;
        n -= taken;
    }
    return messages;
}
