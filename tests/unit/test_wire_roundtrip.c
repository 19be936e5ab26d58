// SPDX-License-Identifier: MIT
/* What goes into a writer comes out of a reader, whatever the pieces that it comes in. */
#include <string.h>
#include <unity.h>

#include "support/wire_frames.h"
#include "support/wire_samples.h"

enum { STREAM_SIZE = 200000 };

static uint8_t stream[STREAM_SIZE];
static plr_message sent[PLR_WIRE_KINDS * WIRE_SAMPLE_VARIANTS];
static unsigned sent_count;

void setUp(void) {
    sent_count = 0;
}

static void send(plr_writer *w, plr_kind kind, unsigned variant) {
    sent[sent_count] = wire_sample(kind, variant);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_put(w, &sent[sent_count]));
    sent_count++;
}

/* Every kind but END in the given variants, then END; what is sent stands in `sent`. */
static size_t write_stream(unsigned first_variant, unsigned last_variant) {
    byte_sink sink = byte_sink_over(stream, sizeof stream);
    plr_writer w;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_init(&w, byte_sink_write, &sink));
    for (unsigned variant = first_variant; variant <= last_variant; variant++)
        for (unsigned kind = PLR_KIND_HEADER; kind <= PLR_WIRE_KINDS; kind++)
            if (kind != PLR_KIND_END)
                send(&w, (plr_kind)kind, variant);
    unsigned each = last_variant - first_variant + 1;
    send(&w, PLR_KIND_END, WIRE_SAMPLE_LEAST);
    sent[sent_count - 1].as.end =
        (plr_end){.sent = {each, each, each, each, each, each}, .frames = sent_count - 1};
    return sink.length;
}

static void assert_is_next(void *context, const plr_message *message) {
    unsigned *received = context;
    TEST_ASSERT_LESS_THAN_UINT(sent_count, *received);
    TEST_ASSERT_EQUAL_UINT16(*received, message->sequence);
    wire_assert_same(&sent[*received], message);
    ++*received;
}

static void assert_nothing_was_skipped(const plr_reader *r, size_t bytes) {
    TEST_ASSERT_EQUAL_UINT64(bytes, r->counts.bytes);
    TEST_ASSERT_EQUAL_UINT32(sent_count, r->counts.frames);
    TEST_ASSERT_EQUAL_UINT32(0, r->counts.damaged + r->counts.unknown + r->counts.malformed);
    TEST_ASSERT_EQUAL_UINT32(0, r->counts.too_long + r->counts.missing);
    TEST_ASSERT_EQUAL_INT(PLR_SKIP_NONE, r->skipped_why);
    TEST_ASSERT_FALSE(plr_reader_mid_frame(r));
}

static void test_every_kind_comes_back_bit_by_bit_at_the_ends_of_its_ranges(void) {
    size_t n = write_stream(WIRE_SAMPLE_LEAST, WIRE_SAMPLE_COMMON);
    plr_reader r = wire_reader();
    unsigned received = 0;
    wire_read_all(&r, stream, n, assert_is_next, &received);
    TEST_ASSERT_EQUAL_UINT(sent_count, received);
    assert_nothing_was_skipped(&r, n);
}

static void test_bytes_may_come_one_at_a_time(void) {
    size_t n = write_stream(WIRE_SAMPLE_LEAST, WIRE_SAMPLE_COMMON);
    plr_reader r = wire_reader();
    unsigned received = 0;
    for (size_t i = 0; i < n; i++)
        wire_read_all(&r, stream + i, 1, assert_is_next, &received);
    TEST_ASSERT_EQUAL_UINT(sent_count, received);
    assert_nothing_was_skipped(&r, n);
}

static void test_the_stream_may_be_cut_in_two_at_every_byte(void) {
    size_t n = write_stream(WIRE_SAMPLE_COMMON, WIRE_SAMPLE_COMMON);
    for (size_t cut = 0; cut <= n; cut++) {
        plr_reader r = wire_reader();
        unsigned received = 0;
        wire_read_all(&r, stream, cut, assert_is_next, &received);
        wire_read_all(&r, stream + cut, n - cut, assert_is_next, &received);
        TEST_ASSERT_EQUAL_UINT(sent_count, received);
        assert_nothing_was_skipped(&r, n);
    }
}

static void test_doubled_delimiters_mean_nothing(void) {
    static uint8_t doubled[STREAM_SIZE];
    size_t n = write_stream(WIRE_SAMPLE_COMMON, WIRE_SAMPLE_COMMON), length = 0;
    doubled[length++] = 0;
    for (size_t i = 0; i < n; i++) {
        doubled[length++] = stream[i];
        if (stream[i] == 0)
            doubled[length++] = 0;
    }
    plr_reader r = wire_reader();
    unsigned received = 0;
    wire_read_all(&r, doubled, length, assert_is_next, &received);
    TEST_ASSERT_EQUAL_UINT(sent_count, received);
    assert_nothing_was_skipped(&r, length);
}

static void put_again(void *context, const plr_message *message) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_put(context, message));
}

static void test_what_was_read_is_written_with_the_same_bytes(void) {
    static uint8_t again[STREAM_SIZE];
    size_t n = write_stream(WIRE_SAMPLE_LEAST, WIRE_SAMPLE_COMMON);
    byte_sink sink = byte_sink_over(again, sizeof again);
    plr_writer w;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_init(&w, byte_sink_write, &sink));
    plr_reader r = wire_reader();
    wire_read_all(&r, stream, n, put_again, &w);
    TEST_ASSERT_EQUAL_size_t(n, sink.length);
    TEST_ASSERT_EQUAL_MEMORY(stream, again, n);
}

static void test_a_pose_of_float32_is_rounded_to_nearest_and_its_position_is_not(void) {
    plr_message m = wire_sample(PLR_KIND_POSE, WIRE_SAMPLE_COMMON), back;
    m.as.pose.T_WB.p[0] = 0.1;
    m.as.pose.bias[0] = 0.1;
    m.as.pose.bias[1] = 1e300;
    m.as.pose.bias[2] = -1e300;
    byte_sink sink = byte_sink_over(stream, sizeof stream);
    plr_writer w;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_init(&w, byte_sink_write, &sink));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_put(&w, &m));
    plr_reader r = wire_reader();
    size_t taken;
    TEST_ASSERT_EQUAL_INT(PLR_READ_MESSAGE,
                          plr_reader_feed(&r, stream, sink.length, &taken, &back));
    TEST_ASSERT_TRUE(back.as.pose.T_WB.p[0] == 0.1);
    TEST_ASSERT_TRUE(back.as.pose.bias[0] == (double)0.1F);
    TEST_ASSERT_DOUBLE_IS_INF(back.as.pose.bias[1]);
    TEST_ASSERT_DOUBLE_IS_NEG_INF(back.as.pose.bias[2]);
}
