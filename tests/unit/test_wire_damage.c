// SPDX-License-Identifier: MIT
/* Damage costs the frames that it lies in, and never gives a message that was not sent. */
#include <string.h>
#include <unity.h>

#include "support/random.h"
#include "support/wire_frames.h"
#include "support/wire_samples.h"

enum { FRAMES = PLR_WIRE_KINDS, STREAM_SIZE = 4000 };

/* One frame of each kind, in the order of the kinds: sequence = kind - 1. */
static uint8_t stream[STREAM_SIZE];
static size_t length;
static plr_message sent[FRAMES];
static size_t end_of[FRAMES]; /* place behind each frame's delimiter */

static bool got[FRAMES];

void setUp(void) {
    byte_sink sink = byte_sink_over(stream, sizeof stream);
    plr_writer w;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_init(&w, byte_sink_write, &sink));
    for (unsigned i = 0; i < FRAMES; i++) {
        sent[i] = wire_sample((plr_kind)(i + 1), WIRE_SAMPLE_COMMON);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_put(&w, &sent[i]));
        end_of[i] = sink.length;
    }
    plr_end *end = &sent[PLR_KIND_END - 1].as.end;
    for (unsigned i = 0; i <= PLR_COUNTED_LANDMARK; i++)
        end->sent[i] = 1;
    end->frames = PLR_KIND_END - 1;
    length = sink.length;
}

static void assert_was_sent(void *context, const plr_message *message) {
    (void)context;
    TEST_ASSERT_LESS_THAN_UINT16(FRAMES, message->sequence);
    TEST_ASSERT_FALSE(got[message->sequence]);
    got[message->sequence] = true;
    wire_assert_same(&sent[message->sequence], message);
}

/* Reads bytes of which all frames but first to last are whole. */
static plr_reader assert_only_these_are_lost(const uint8_t *bytes, size_t n, unsigned first,
                                             unsigned last) {
    plr_reader r = wire_reader();
    memset(got, 0, sizeof got);
    wire_read_all(&r, bytes, n, assert_was_sent, NULL);
    for (unsigned i = 0; i < FRAMES; i++)
        TEST_ASSERT_EQUAL(i < first || i > last, got[i]);
    TEST_ASSERT_EQUAL_UINT64(n, r.counts.bytes);
    return r;
}

static unsigned frame_at(size_t byte) {
    unsigned i = 0;
    while (byte >= end_of[i])
        i++;
    return i;
}

/* The frame that holds the byte; and the next one, if it is the delimiter between them. */
static unsigned last_hurt_at(size_t byte) {
    unsigned frame = frame_at(byte);
    return byte + 1 == end_of[frame] && frame + 1 < FRAMES ? frame + 1 : frame;
}

static void damage(size_t byte, uint8_t value) {
    uint8_t was = stream[byte];
    stream[byte] = value;
    plr_reader r = assert_only_these_are_lost(stream, length, frame_at(byte), last_hurt_at(byte));
    bool end_is_open = byte + 1 == length; /* the last delimiter: a truncated stream */
    TEST_ASSERT_EQUAL(end_is_open, plr_reader_mid_frame(&r));
    if (!end_is_open) {
        TEST_ASSERT_TRUE(r.counts.damaged == 1 || r.counts.damaged == 2);
        TEST_ASSERT_EQUAL_INT(PLR_SKIP_DAMAGED, r.skipped_why);
        TEST_ASSERT_LESS_THAN_UINT64(end_of[last_hurt_at(byte)], r.skipped_at);
    }
    TEST_ASSERT_EQUAL_UINT32(0, r.counts.unknown + r.counts.malformed + r.counts.too_long);
    stream[byte] = was;
}

static void test_each_byte_damaged_costs_its_frame_alone(void) {
    for (size_t byte = 0; byte < length; byte++) {
        for (unsigned bit = 0; bit < 8; bit++)
            damage(byte, (uint8_t)(stream[byte] ^ 1U << bit));
        damage(byte, (uint8_t)(stream[byte] ^ 0xFF));
    }
}

/* A zero ends the frame early; what is behind it is damaged too, unless there is none. */
static void test_each_byte_made_a_delimiter_costs_its_frame_alone(void) {
    for (size_t byte = 0; byte < length; byte++) {
        if (stream[byte] == 0)
            continue;
        uint8_t was = stream[byte];
        stream[byte] = 0;
        assert_only_these_are_lost(stream, length, frame_at(byte), frame_at(byte));
        stream[byte] = was;
    }
}

static void test_each_byte_lost_costs_its_frame_alone(void) {
    uint8_t shorter[STREAM_SIZE];
    for (size_t byte = 0; byte < length; byte++) {
        memcpy(shorter, stream, byte);
        memcpy(shorter + byte, stream + byte + 1, length - byte - 1);
        assert_only_these_are_lost(shorter, length - 1, frame_at(byte), last_hurt_at(byte));
    }
}

static void test_each_byte_doubled_costs_its_frame_alone(void) {
    uint8_t longer[STREAM_SIZE + 1];
    for (size_t byte = 0; byte < length; byte++) {
        if (stream[byte] == 0)
            continue;
        memcpy(longer, stream, byte + 1);
        memcpy(longer + byte + 1, stream + byte, length - byte);
        assert_only_these_are_lost(longer, length + 1, frame_at(byte), frame_at(byte));
    }
}

static void test_a_stream_cut_at_any_byte_gives_what_is_whole(void) {
    for (size_t n = 0; n < length; n++) {
        plr_reader r = assert_only_these_are_lost(stream, n, frame_at(n), FRAMES);
        bool between_frames = n == 0 || end_of[frame_at(n - 1)] == n;
        TEST_ASSERT_EQUAL(!between_frames, plr_reader_mid_frame(&r));
        TEST_ASSERT_EQUAL_UINT32(0, r.counts.damaged + r.counts.missing);
    }
}

static void test_a_stream_begun_at_any_byte_gives_what_is_whole(void) {
    for (size_t at = 1; at < length; at++) {
        unsigned frame = frame_at(at);
        bool between_frames = end_of[frame_at(at - 1)] == at;
        /* A delimiter alone is an empty frame. */
        unsigned whole_from = between_frames ? frame : frame + 1;
        plr_reader r = wire_reader();
        memset(got, 0, sizeof got);
        wire_read_all(&r, stream + at, length - at, assert_was_sent, NULL);
        for (unsigned i = 0; i < FRAMES; i++)
            TEST_ASSERT_EQUAL(i >= whole_from, got[i]);
    }
}

/* A million bytes of noise, zeros as rare as in a stream and as common as elsewhere. A random body
 * passes its checksum once in 2^32. */
static void test_a_million_random_bytes_hold_no_message_and_the_next_frame_is_read(void) {
    static uint8_t noise[1000];
    rng random = rng_seeded(42);
    plr_reader r = wire_reader();
    for (unsigned block = 0; block < 1000; block++) {
        unsigned one_in = block % 2 ? 256 : 20;
        for (size_t i = 0; i < sizeof noise; i++)
            noise[i] = rng_below(&random, one_in) ? (uint8_t)(1 + rng_below(&random, 255)) : 0;
        TEST_ASSERT_EQUAL_UINT(0, wire_read_all(&r, noise, sizeof noise, NULL, NULL));
    }
    TEST_ASSERT_EQUAL_UINT64(1000000, r.counts.bytes);
    TEST_ASSERT_GREATER_THAN_UINT32(10000, r.counts.damaged);
    TEST_ASSERT_EQUAL_UINT32(0, r.counts.frames + r.counts.unknown + r.counts.malformed);
    const uint8_t delimiter = 0;
    wire_read_all(&r, &delimiter, 1, NULL, NULL);
    TEST_ASSERT_EQUAL_UINT(FRAMES, wire_read_all(&r, stream, length, NULL, NULL));
}

/* Sound frames around noise of which none knows where it begins. */
static void test_noise_between_frames_costs_at_most_the_one_behind_it(void) {
    rng random = rng_seeded(7);
    plr_reader r = wire_reader();
    unsigned read = 0;
    for (unsigned i = 0; i < FRAMES; i++) {
        uint8_t noise[8];
        size_t start = i == 0 ? 0 : end_of[i - 1];
        for (size_t k = 0; k < sizeof noise; k++)
            noise[k] = (uint8_t)rng_bits(&random);
        wire_read_all(&r, noise, rng_below(&random, sizeof noise), NULL, NULL);
        wire_read_all(&r, stream + start, end_of[i] - start, NULL, NULL);
        read += wire_read_all(&r, stream + start, end_of[i] - start, NULL, NULL);
    }
    TEST_ASSERT_EQUAL_UINT(FRAMES, read);
}
