// SPDX-License-Identifier: MIT
/*
 * Frames in memory. wire_frame() builds one from its parts straight from the format's page and
 * shares no code with src/record: what it gives may be wrong on purpose.
 */
#ifndef PELORUS_TEST_WIRE_FRAMES_H
#define PELORUS_TEST_WIRE_FRAMES_H

#include "pelorus/wire.h"

enum { WIRE_BUFFER_SIZE = PLR_WIRE_STEREO_BODY(PLR_WIRE_MAX_OBSERVATIONS) };

/* Bytes in memory, and a plr_write_function for them. It fails when byte `fail_at` is to be
 * written, having taken those before it. */
typedef struct byte_sink {
    uint8_t *bytes;
    size_t capacity, length, fail_at;
    unsigned calls;
    size_t longest_call, shortest_call;
} byte_sink;

/* A sink that fails at its capacity only. */
byte_sink byte_sink_over(uint8_t *bytes, size_t capacity);

int byte_sink_write(void *sink, const uint8_t *bytes, size_t n);

/* One frame with its delimiter; returns its length. `stuffed` has room for n + n / 254 + 16. */
size_t wire_frame(unsigned kind, unsigned sequence, const uint8_t *payload, size_t n,
                  uint8_t *stuffed);

/* The payload that plr_writer_put makes of a message; returns its length. */
size_t wire_payload(const plr_message *message, uint8_t *payload, size_t capacity);

/* Reads n bytes of a payload, and no byte beyond them: the sanitizers would find out. */
plr_status wire_read_payload(plr_kind kind, const uint8_t *payload, size_t n, plr_message *m);

/* A reader with room for any frame, over static memory: one at a time. */
plr_reader wire_reader(void);

/* Feeds all bytes; calls on_message, if not null, for each good one. Returns their number. */
typedef void (*wire_on_message)(void *context, const plr_message *message);
unsigned wire_read_all(plr_reader *r, const uint8_t *bytes, size_t n, wire_on_message on_message,
                       void *context);

#endif
