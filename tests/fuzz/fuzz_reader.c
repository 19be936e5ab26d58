// SPDX-License-Identifier: MIT
/*
 * Fuzz harness of the frame format, for libFuzzer:
 *
 *     cmake -S . -B build-fuzz -DPELORUS_FUZZ=ON -DCMAKE_C_COMPILER=clang-14
 *     cmake --build build-fuzz -j2
 *     build-fuzz/bin/fuzz_reader -max_len=4096 found tests/fuzz/corpus # `found`: for new inputs
 *
 * test_fuzz_reader.c runs the same harness under CTest without it.
 *
 * An input's first byte chooses the reader's room and what the rest is: a stream, fed in pieces of
 * the size of the second byte; or the kind and payload of one frame, of which the harness makes a
 * sound one, for no random bytes get past the checksum. Whatever is read must be whole, and must
 * come back with the same bytes when it is written, read and written once more.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "record/cobs.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { ROOM_BITS = 3, AS_PAYLOAD = 4, OUT_SIZE = 90000 };

static const unsigned rooms[] = {0, 3, 40, PLR_WIRE_MAX_OBSERVATIONS};

typedef struct byte_stream {
    uint8_t bytes[OUT_SIZE];
    size_t length;
} byte_stream;

#define REQUIRE(holds) require((holds), #holds, __LINE__)

static void require(int holds, const char *what, int line) {
    if (holds)
        return;
    fprintf(stderr, "fuzz_reader.c:%d: does not hold: %s\n", line, what);
    abort();
}

static int append(void *stream, const uint8_t *bytes, size_t n) {
    byte_stream *s = stream;
    REQUIRE(n > 0 && n <= sizeof s->bytes - s->length);
    memcpy(s->bytes + s->length, bytes, n);
    s->length += n;
    return 0;
}

static void write_one(const plr_message *message, byte_stream *out) {
    plr_writer w;
    out->length = 0;
    REQUIRE(plr_writer_init(&w, append, out) == PLR_OK);
    REQUIRE(plr_writer_put(&w, message) == PLR_OK);
}

/* What is written is read, and when written again has the same bytes. */
static void require_comes_back(const plr_message *message) {
    static byte_stream once, twice;
    static uint8_t buffer[OUT_SIZE];
    static plr_observation observations[PLR_WIRE_MAX_OBSERVATIONS];
    plr_reader r;
    plr_message back;
    size_t taken;
    write_one(message, &once);
    REQUIRE(plr_reader_init(&r, buffer, sizeof buffer, observations, PLR_WIRE_MAX_OBSERVATIONS) ==
            PLR_OK);
    REQUIRE(plr_reader_feed(&r, once.bytes, once.length, &taken, &back) == PLR_READ_MESSAGE);
    REQUIRE(taken == once.length && back.kind == message->kind);
    write_one(&back, &twice);
    REQUIRE(once.length == twice.length && !memcmp(once.bytes, twice.bytes, once.length));
}

static void require_whole(const plr_reader *r, const plr_message *message) {
    REQUIRE(message->kind >= PLR_KIND_HEADER && (int)message->kind <= PLR_WIRE_KINDS);
    if (message->kind == PLR_KIND_HEADER)
        REQUIRE(memchr(message->as.header.name, 0, PLR_WIRE_NAME_SIZE) != NULL);
    if (message->kind == PLR_KIND_CONFIG)
        REQUIRE(message->as.config.count <= PLR_WIRE_MAX_SETTINGS);
    if (message->kind == PLR_KIND_IMU)
        REQUIRE(message->as.imu.count >= 1 && message->as.imu.count <= PLR_WIRE_MAX_IMU);
    if (message->kind == PLR_KIND_STEREO)
        REQUIRE(message->as.stereo.count <= r->max_observations &&
                message->as.stereo.observations == r->observations);
    if (message->kind == PLR_KIND_IMAGE)
        REQUIRE(message->as.image.count >= 1 && message->as.image.pixels > r->buffer &&
                message->as.image.pixels + message->as.image.count <= r->buffer + r->length);
    if (message->kind == PLR_KIND_TEXT)
        REQUIRE(memchr(message->as.text.text, 0, PLR_WIRE_MAX_TEXT + 1) != NULL);
    require_comes_back(message);
}

static uint32_t skipped(const plr_reader_counts *c) {
    return c->damaged + c->unknown + c->malformed + c->too_long;
}

/* Feeds one piece; every frame of it must show in the counts. */
static void feed(plr_reader *r, const uint8_t *bytes, size_t n) {
    while (n > 0) {
        const plr_reader_counts before = r->counts;
        plr_message message;
        size_t taken = 0;
        plr_read_event event = plr_reader_feed(r, bytes, n, &taken, &message);
        REQUIRE(taken > 0 && taken <= n);
        REQUIRE(r->counts.bytes == before.bytes + taken);
        REQUIRE(r->counts.frames == before.frames + (event == PLR_READ_MESSAGE));
        REQUIRE(skipped(&r->counts) == skipped(&before) + (event == PLR_READ_SKIPPED));
        if (event == PLR_READ_MESSAGE)
            require_whole(r, &message);
        if (event == PLR_READ_MORE || event == PLR_READ_SKIPPED)
            REQUIRE(message.kind == PLR_KIND_NONE);
        if (event == PLR_READ_MORE)
            REQUIRE(taken == n);
        if (event == PLR_READ_SKIPPED)
            REQUIRE(r->skipped_why != PLR_SKIP_NONE && r->skipped_at < r->counts.bytes);
        bytes += taken;
        n -= taken;
    }
}

static void feed_in_pieces(plr_reader *r, const uint8_t *bytes, size_t n) {
    if (n == 0)
        return;
    size_t piece = bytes[0] ? bytes[0] : n;
    for (size_t at = 1; at < n; at += piece)
        feed(r, bytes + at, piece < n - at ? piece : n - at);
}

static void feed_byte(plr_reader *r, plr_cobs_encoder *e, uint8_t byte) {
    unsigned ready = plr_cobs_encode(e, byte);
    feed(r, e->block, ready);
}

/* A sound frame of sequence 0 around kind and payload. */
static void feed_payload(plr_reader *r, const uint8_t *bytes, size_t n) {
    if (n == 0)
        return;
    const uint8_t head[3] = {bytes[0], 0, 0};
    uint32_t crc = plr_crc32(plr_crc32(0, head, sizeof head), bytes + 1, n - 1);
    plr_cobs_encoder e;
    plr_cobs_begin(&e);
    for (size_t i = 0; i < sizeof head; i++)
        feed_byte(r, &e, head[i]);
    for (size_t i = 1; i < n; i++)
        feed_byte(r, &e, bytes[i]);
    for (unsigned i = 0; i < 4; i++)
        feed_byte(r, &e, (uint8_t)(crc >> 8 * i & 0xFF));
    unsigned ready = plr_cobs_end(&e);
    feed(r, e.block, ready);
    REQUIRE(r->counts.damaged == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size == 0)
        return 0;
    /* On the heap and no larger than promised: the sanitizer sees the first byte beyond. */
    unsigned room = rooms[data[0] & ROOM_BITS];
    size_t buffer_size = PLR_WIRE_STEREO_BODY(room);
    if (buffer_size < PLR_WIRE_MIN_BUFFER)
        buffer_size = PLR_WIRE_MIN_BUFFER;
    uint8_t *buffer = malloc(buffer_size);
    plr_observation *observations = room ? malloc(room * sizeof *observations) : NULL;
    plr_reader r;
    REQUIRE(buffer != NULL && (room == 0 || observations != NULL));
    REQUIRE(plr_reader_init(&r, buffer, buffer_size, observations, room) == PLR_OK);
    if (data[0] & AS_PAYLOAD)
        feed_payload(&r, data + 1, size - 1);
    else
        feed_in_pieces(&r, data + 1, size - 1);
    free(observations);
    free(buffer);
    return 0;
}
