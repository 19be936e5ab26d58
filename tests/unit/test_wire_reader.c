// SPDX-License-Identifier: MIT
/* What a reader says of frames that it cannot give: unknown, of the future, too long, missing. */
#include <string.h>
#include <unity.h>

#include "support/wire_frames.h"
#include "support/wire_samples.h"

static uint8_t stream[4 * WIRE_BUFFER_SIZE];
static size_t length;
static plr_reader reader;
static plr_message message;

void setUp(void) {
    length = 0;
    reader = wire_reader();
}

/* Appends a frame to the stream; returns its place. */
static size_t add(unsigned kind, unsigned sequence, const uint8_t *payload, size_t n) {
    size_t at = length;
    length += wire_frame(kind, sequence, payload, n, stream + length);
    return at;
}

static size_t add_sample(plr_kind kind, unsigned variant, unsigned sequence) {
    static uint8_t payload[WIRE_BUFFER_SIZE];
    plr_message m = wire_sample(kind, variant);
    return add(kind, sequence, payload, wire_payload(&m, payload, sizeof payload));
}

static size_t add_twist(unsigned sequence) {
    return add_sample(PLR_KIND_TWIST, WIRE_SAMPLE_COMMON, sequence);
}

/* Reads the first frame of the stream and drops its bytes. */
static plr_read_event next(void) {
    size_t taken = 0;
    message.kind = PLR_KIND_TEXT;
    plr_read_event event = plr_reader_feed(&reader, stream, length, &taken, &message);
    TEST_ASSERT_LESS_OR_EQUAL_size_t(length, taken);
    length -= taken;
    memmove(stream, stream + taken, length);
    return event;
}

static void assert_next_is_skipped(plr_skip why, unsigned kind, size_t at) {
    TEST_ASSERT_EQUAL_INT(PLR_READ_SKIPPED, next());
    TEST_ASSERT_EQUAL_INT(why, reader.skipped_why);
    TEST_ASSERT_EQUAL_UINT8(kind, reader.skipped_kind);
    TEST_ASSERT_EQUAL_UINT64(at, reader.skipped_at);
    TEST_ASSERT_EQUAL_INT(PLR_KIND_NONE, message.kind);
}

static void assert_next_is(plr_kind kind) {
    TEST_ASSERT_EQUAL_INT(PLR_READ_MESSAGE, next());
    TEST_ASSERT_EQUAL_INT(kind, message.kind);
}

/* --- preparing --- */

static void test_a_reader_without_room_is_refused(void) {
    static uint8_t buffer[PLR_WIRE_MIN_BUFFER];
    static plr_observation room[1];
    plr_reader r;
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT,
                          plr_reader_init(NULL, buffer, PLR_WIRE_MIN_BUFFER, room, 1));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_reader_init(&r, NULL, PLR_WIRE_MIN_BUFFER, room, 1));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT,
                          plr_reader_init(&r, buffer, PLR_WIRE_MIN_BUFFER - 1, room, 1));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT,
                          plr_reader_init(&r, buffer, PLR_WIRE_MIN_BUFFER, NULL, 1));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_reader_init(&r, buffer, PLR_WIRE_MIN_BUFFER, room, 1));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_reader_init(&r, buffer, PLR_WIRE_MIN_BUFFER, NULL, 0));
}

static void test_no_bytes_are_no_frame(void) {
    size_t taken = 7;
    TEST_ASSERT_EQUAL_INT(PLR_READ_MORE, plr_reader_feed(&reader, NULL, 0, &taken, &message));
    TEST_ASSERT_EQUAL_size_t(0, taken);
    TEST_ASSERT_FALSE(plr_reader_mid_frame(&reader));
}

static void test_a_frame_is_in_the_middle_until_its_delimiter(void) {
    add_twist(0);
    size_t whole = length, taken;
    for (size_t i = 0; i + 1 < whole; i++) {
        TEST_ASSERT_EQUAL_INT(PLR_READ_MORE,
                              plr_reader_feed(&reader, stream + i, 1, &taken, &message));
        TEST_ASSERT_EQUAL_INT(PLR_KIND_NONE, message.kind);
        TEST_ASSERT_TRUE(plr_reader_mid_frame(&reader));
    }
    TEST_ASSERT_EQUAL_INT(PLR_READ_MESSAGE,
                          plr_reader_feed(&reader, stream + whole - 1, 1, &taken, &message));
    TEST_ASSERT_FALSE(plr_reader_mid_frame(&reader));
}

/* --- skipping --- */

static void test_every_unknown_kind_is_skipped_and_counted(void) {
    const uint8_t payload[] = {1, 2, 3};
    unsigned unknown = 0;
    for (unsigned kind = 0; kind < 256; kind++) {
        if (kind >= PLR_KIND_HEADER && kind <= PLR_WIRE_KINDS)
            continue;
        uint64_t at = reader.counts.bytes;
        add(kind, unknown, payload, sizeof payload);
        assert_next_is_skipped(PLR_SKIP_UNKNOWN, kind, (size_t)at);
        TEST_ASSERT_EQUAL_UINT32(++unknown, reader.counts.unknown);
    }
    add_twist(unknown);
    assert_next_is(PLR_KIND_TWIST);
    TEST_ASSERT_EQUAL_UINT32(0, reader.counts.missing);
}

static void test_a_malformed_frame_is_skipped_and_counted(void) {
    const uint8_t payload[] = {1, 2, 3};
    add_twist(0);
    size_t at = add(PLR_KIND_TWIST, 1, payload, sizeof payload);
    add_twist(2);
    assert_next_is(PLR_KIND_TWIST);
    assert_next_is_skipped(PLR_SKIP_MALFORMED, PLR_KIND_TWIST, at);
    assert_next_is(PLR_KIND_TWIST);
    TEST_ASSERT_EQUAL_UINT32(1, reader.counts.malformed);
    TEST_ASSERT_EQUAL_UINT32(2, reader.counts.frames);
    TEST_ASSERT_EQUAL_UINT32(0, reader.counts.missing);
}

/* Stuffed bodies of 0 to 6 bytes: none of them can hold kind, sequence and checksum. */
static void test_a_body_without_room_for_a_checksum_is_damaged(void) {
    for (unsigned n = 0; n < PLR_WIRE_OVERHEAD; n++) {
        uint64_t at = reader.counts.bytes;
        stream[length++] = (uint8_t)(n + 1);
        memset(stream + length, 0x55, n);
        length += n;
        stream[length++] = 0;
        assert_next_is_skipped(PLR_SKIP_DAMAGED, PLR_KIND_NONE, (size_t)at);
    }
    TEST_ASSERT_EQUAL_UINT32(PLR_WIRE_OVERHEAD, reader.counts.damaged);
}

static void test_the_place_of_a_skipped_frame_is_behind_the_empty_ones(void) {
    static const uint8_t noise[] = {0, 0, 0, 5, 1, 0};
    memcpy(stream, noise, sizeof noise);
    length = sizeof noise;
    assert_next_is_skipped(PLR_SKIP_DAMAGED, PLR_KIND_NONE, 3);
}

/* --- versions --- */

static void test_a_header_of_a_later_minor_version_is_read(void) {
    uint8_t payload[400];
    plr_message m = wire_sample(PLR_KIND_HEADER, WIRE_SAMPLE_COMMON);
    size_t n = wire_payload(&m, payload, sizeof payload);
    m.as.header.version_minor = payload[1] = 9;
    memset(payload + n, 0xEE, 20);
    add(PLR_KIND_HEADER, 0, payload, n + 20);
    assert_next_is(PLR_KIND_HEADER);
    wire_assert_same(&m, &message);
}

static void test_a_header_of_a_later_major_version_ends_the_reading(void) {
    const uint8_t version[] = {2, 7};
    add(PLR_KIND_HEADER, 0, version, sizeof version);
    add_twist(1);
    size_t whole = length;
    TEST_ASSERT_EQUAL_INT(PLR_READ_FUTURE, next());
    TEST_ASSERT_EQUAL_INT(PLR_KIND_HEADER, message.kind);
    TEST_ASSERT_EQUAL_UINT8(2, message.as.header.version_major);
    TEST_ASSERT_EQUAL_UINT8(7, message.as.header.version_minor);
    TEST_ASSERT_EQUAL_INT(PLR_READ_FUTURE, next());
    TEST_ASSERT_EQUAL_INT(PLR_KIND_NONE, message.kind);
    TEST_ASSERT_EQUAL_size_t(0, length);
    TEST_ASSERT_EQUAL_UINT64(whole, reader.counts.bytes);
    TEST_ASSERT_EQUAL_UINT32(0, reader.counts.frames);
}

/* --- sequence --- */

static uint32_t missing_of(const unsigned *sequences, unsigned n) {
    setUp();
    for (unsigned i = 0; i < n; i++)
        add_twist(sequences[i]);
    for (unsigned i = 0; i < n; i++)
        assert_next_is(PLR_KIND_TWIST);
    return reader.counts.missing;
}

static void test_gaps_of_the_sequence_are_counted(void) {
    const unsigned none[] = {0, 1, 2}, beginning[] = {5, 6}, middle[] = {0, 1, 3, 10},
                   widest[] = {0, 0x8000};
    TEST_ASSERT_EQUAL_UINT32(0, missing_of(none, 3));
    TEST_ASSERT_EQUAL_UINT32(5, missing_of(beginning, 2));
    TEST_ASSERT_EQUAL_UINT32(1 + 6, missing_of(middle, 4));
    TEST_ASSERT_EQUAL_UINT32(0x7FFF, missing_of(widest, 2));
}

static void test_the_sequence_goes_on_over_its_wrap(void) {
    const unsigned wrap[] = {0, 0x7FFF, 0xFFFE, 0xFFFF, 0, 1}, gap[] = {0, 0x7FFF, 0xFFFD, 1};
    const uint32_t before = 0x7FFE + 0x7FFE;
    TEST_ASSERT_EQUAL_UINT32(before, missing_of(wrap, 6));
    TEST_ASSERT_EQUAL_UINT32(before - 1 + 3, missing_of(gap, 4));
}

static void test_a_sender_that_begins_anew_misses_nothing(void) {
    const unsigned again[] = {0, 1, 2, 0, 1}, twice[] = {0, 1, 1, 2}, far[] = {0, 0x8001, 0x8002};
    TEST_ASSERT_EQUAL_UINT32(0, missing_of(again, 5));
    TEST_ASSERT_EQUAL_UINT32(0, missing_of(twice, 4));
    TEST_ASSERT_EQUAL_UINT32(0, missing_of(far, 3));
}

static void test_a_damaged_frame_is_missing_too(void) {
    size_t at = add_twist(0);
    add_twist(1);
    stream[at + 9] ^= 0x40;
    TEST_ASSERT_EQUAL_INT(PLR_READ_SKIPPED, next());
    assert_next_is(PLR_KIND_TWIST);
    TEST_ASSERT_EQUAL_UINT32(1, reader.counts.damaged);
    TEST_ASSERT_EQUAL_UINT32(1, reader.counts.missing);
}

/* --- room --- */

static plr_frame frame_of(unsigned count) {
    plr_frame frame = wire_sample(PLR_KIND_STEREO, WIRE_SAMPLE_MOST).as.stereo;
    frame.count = (uint16_t)count;
    return frame;
}

static size_t add_stereo(unsigned count, unsigned sequence) {
    static uint8_t payload[WIRE_BUFFER_SIZE];
    plr_message m = {.kind = PLR_KIND_STEREO};
    m.as.stereo = frame_of(count);
    return add(PLR_KIND_STEREO, sequence, payload, wire_payload(&m, payload, sizeof payload));
}

static void test_the_least_buffer_holds_every_other_kind(void) {
    static uint8_t buffer[PLR_WIRE_MIN_BUFFER];
    plr_reader_init(&reader, buffer, sizeof buffer, NULL, 0);
    for (unsigned kind = PLR_KIND_HEADER; kind <= PLR_WIRE_KINDS; kind++) {
        if (kind == PLR_KIND_STEREO)
            continue;
        add_sample((plr_kind)kind, WIRE_SAMPLE_MOST, 0);
        assert_next_is((plr_kind)kind);
        add_sample((plr_kind)kind, WIRE_SAMPLE_LEAST, 0);
        assert_next_is((plr_kind)kind);
    }
}

static void test_a_buffer_of_stereo_body_holds_just_so_many_observations(void) {
    static uint8_t buffer[PLR_WIRE_STEREO_BODY(40)];
    static plr_observation room[100];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_reader_init(&reader, buffer, sizeof buffer, room, 100));
    add_stereo(40, 0);
    size_t at = add_stereo(41, 1);
    add_stereo(40, 2);
    assert_next_is(PLR_KIND_STEREO);
    assert_next_is_skipped(PLR_SKIP_TOO_LONG, PLR_KIND_STEREO, at);
    assert_next_is(PLR_KIND_STEREO);
    TEST_ASSERT_EQUAL_UINT32(1, reader.counts.too_long);
    TEST_ASSERT_EQUAL_UINT32(0, reader.counts.missing);
}

static void test_a_frame_too_long_for_the_observation_array_is_skipped_and_counted(void) {
    static uint8_t buffer[WIRE_BUFFER_SIZE];
    static plr_observation room[4];
    const plr_observation untouched = {.id = 99};
    room[3] = untouched;
    plr_reader_init(&reader, buffer, sizeof buffer, room, 3);
    add_stereo(3, 0);
    size_t at = add_stereo(4, 1);
    add_stereo(2, 2);
    assert_next_is(PLR_KIND_STEREO);
    assert_next_is_skipped(PLR_SKIP_TOO_LONG, PLR_KIND_STEREO, at);
    assert_next_is(PLR_KIND_STEREO);
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &room[3], sizeof untouched);
    TEST_ASSERT_EQUAL_UINT32(1, reader.counts.too_long);
}

static void test_a_reader_without_observations_reads_empty_stereos_only(void) {
    static uint8_t buffer[WIRE_BUFFER_SIZE];
    plr_reader_init(&reader, buffer, sizeof buffer, NULL, 0);
    add_stereo(0, 0);
    size_t at = add_stereo(1, 1);
    assert_next_is(PLR_KIND_STEREO);
    TEST_ASSERT_EQUAL_UINT16(0, message.as.stereo.count);
    assert_next_is_skipped(PLR_SKIP_TOO_LONG, PLR_KIND_STEREO, at);
}

static void test_a_long_frame_that_is_damaged_counts_as_damaged(void) {
    static uint8_t buffer[PLR_WIRE_MIN_BUFFER];
    plr_reader_init(&reader, buffer, sizeof buffer, NULL, 0);
    size_t at = add_stereo(200, 0);
    stream[at + 3000] ^= 1;
    assert_next_is_skipped(PLR_SKIP_DAMAGED, PLR_KIND_NONE, at);
    TEST_ASSERT_EQUAL_UINT32(0, reader.counts.too_long);
}

/* --- texts --- */

/* Reads a TEXT whose text is `lead` times 'x', then one UTF-8 character over and over. */
static void read_long_text(unsigned lead, const char *character) {
    uint8_t payload[400] = {PLR_SEVERITY_INFO};
    size_t n = 1, width = strlen(character);
    while (n <= lead)
        payload[n++] = 'x';
    while (n + width <= 300) {
        memcpy(payload + n, character, width);
        n += width;
    }
    add(PLR_KIND_TEXT, 0, payload, n);
    assert_next_is(PLR_KIND_TEXT);
    TEST_ASSERT_EQUAL_MEMORY(payload + 1, message.as.text.text, strlen(message.as.text.text));
}

static void test_a_text_that_is_too_long_is_cut_between_characters(void) {
    const char *characters[] = {"x", "\xC3\xA9", "\xE2\x82\xAC", "\xF0\x9F\x98\x80"};
    for (unsigned width = 1; width <= 4; width++) {
        for (unsigned lead = 0; lead < 4; lead++) {
            read_long_text(lead, characters[width - 1]);
            TEST_ASSERT_EQUAL_size_t(lead + (PLR_WIRE_MAX_TEXT - lead) / width * width,
                                     strlen(message.as.text.text));
        }
    }
}

static void test_a_text_that_is_not_utf_8_is_cut_all_the_same(void) {
    read_long_text(0, "\x80");
    TEST_ASSERT_EQUAL_size_t(PLR_WIRE_MAX_TEXT - 3, strlen(message.as.text.text));
}
