// SPDX-License-Identifier: MIT
/* What a writer refuses, counts, and does when its function fails. */
#include <string.h>
#include <unity.h>

#include "support/wire_frames.h"
#include "support/wire_samples.h"

static uint8_t bytes[1000000];
static byte_sink sink;
static plr_writer writer;

void setUp(void) {
    sink = byte_sink_over(bytes, sizeof bytes);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_init(&writer, byte_sink_write, &sink));
}

static plr_status put(const plr_message *message) {
    return plr_writer_put(&writer, message);
}

static plr_status put_sample(plr_kind kind) {
    plr_message m = wire_sample(kind, WIRE_SAMPLE_COMMON);
    return put(&m);
}

/* --- refusing --- */

static void test_null_pointers_are_refused(void) {
    plr_message m = wire_sample(PLR_KIND_TWIST, WIRE_SAMPLE_COMMON);
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_writer_init(NULL, byte_sink_write, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_writer_init(&writer, NULL, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_writer_put(NULL, &m));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_writer_put(&writer, NULL));
    plr_writer never_prepared = {0};
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_writer_put(&never_prepared, &m));
}

static void assert_refused(const plr_message *m) {
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, put(m));
    TEST_ASSERT_EQUAL_UINT(0, sink.calls);
    TEST_ASSERT_EQUAL_UINT16(0, writer.sequence);
    TEST_ASSERT_EQUAL_UINT32(0, writer.counts.frames);
}

static void test_a_kind_that_is_none_is_refused(void) {
    plr_message m = wire_sample(PLR_KIND_TWIST, WIRE_SAMPLE_COMMON);
    m.kind = PLR_KIND_NONE;
    assert_refused(&m);
    m.kind = (plr_kind)(PLR_WIRE_KINDS + 1);
    assert_refused(&m);
}

static void test_a_header_that_contradicts_itself_is_refused_and_nothing_is_written(void) {
    const plr_message good = wire_sample(PLR_KIND_HEADER, WIRE_SAMPLE_COMMON);
    plr_message m = good;
    m.as.header.body_axes = PLR_AXES_OTHER + 1;
    assert_refused(&m);
    m = good;
    m.as.header.twist_timing = 3;
    assert_refused(&m);
    m = good;
    memset(m.as.header.name, 'n', sizeof m.as.header.name); /* no closing zero */
    assert_refused(&m);
}

static void test_a_config_of_too_many_settings_is_refused(void) {
    plr_message m = wire_sample(PLR_KIND_CONFIG, WIRE_SAMPLE_MOST);
    m.as.config.count = PLR_WIRE_MAX_SETTINGS + 1;
    assert_refused(&m);
}

static void test_a_stereo_of_too_many_or_no_observations_is_refused(void) {
    plr_message m = wire_sample(PLR_KIND_STEREO, WIRE_SAMPLE_MOST);
    m.as.stereo.count = PLR_WIRE_MAX_OBSERVATIONS + 1;
    assert_refused(&m);
    m.as.stereo.count = 1;
    m.as.stereo.observations = NULL;
    assert_refused(&m);
    m.as.stereo.count = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, put(&m));
}

static void test_an_imu_of_no_reading_or_too_many_is_refused(void) {
    plr_message m = wire_sample(PLR_KIND_IMU, WIRE_SAMPLE_COMMON);
    m.as.imu.count = 0;
    assert_refused(&m);
    m.as.imu.count = PLR_WIRE_MAX_IMU + 1;
    assert_refused(&m);
}

static void test_results_that_contradict_themselves_are_refused(void) {
    plr_message m = wire_sample(PLR_KIND_LANDMARK, WIRE_SAMPLE_COMMON);
    m.as.landmark.role = PLR_LANDMARK_FINAL + 1;
    assert_refused(&m);
    m = wire_sample(PLR_KIND_POSE, WIRE_SAMPLE_COMMON);
    m.as.pose.real_bytes = 2;
    assert_refused(&m);
    m = wire_sample(PLR_KIND_REPORT, WIRE_SAMPLE_COMMON);
    m.as.report.report.status = (plr_status)1;
    assert_refused(&m);
    m = wire_sample(PLR_KIND_REPORT, WIRE_SAMPLE_COMMON);
    m.as.report.report.health = (plr_health)(PLR_HEALTH_DIVERGED + 1);
    assert_refused(&m);
}

static void test_a_text_without_an_end_or_of_no_severity_is_refused(void) {
    plr_message m = wire_sample(PLR_KIND_TEXT, WIRE_SAMPLE_COMMON);
    m.as.text.severity = PLR_SEVERITY_ERROR + 1;
    assert_refused(&m);
    m.as.text.severity = PLR_SEVERITY_INFO;
    memset(m.as.text.text, 't', sizeof m.as.text.text);
    assert_refused(&m);
}

/* --- counting --- */

static void test_a_header_is_of_the_writer_s_version_whatever_it_says(void) {
    plr_message m = wire_sample(PLR_KIND_HEADER, WIRE_SAMPLE_COMMON);
    uint8_t payload[400];
    m.as.header.version_major = 77;
    wire_payload(&m, payload, sizeof payload);
    TEST_ASSERT_EQUAL_UINT8(PLR_WIRE_VERSION_MAJOR, payload[0]);
    TEST_ASSERT_EQUAL_UINT8(PLR_WIRE_VERSION_MINOR, payload[1]);
}

static void test_the_sequence_goes_from_0_and_wraps(void) {
    plr_message m = wire_sample(PLR_KIND_TEXT, WIRE_SAMPLE_LEAST), back;
    plr_reader r = wire_reader();
    m.sequence = 4711; /* is not looked at */
    for (unsigned i = 0; i < 0x10003; i++) {
        size_t taken;
        sink.length = 0;
        TEST_ASSERT_EQUAL_INT(PLR_OK, put(&m));
        TEST_ASSERT_EQUAL_INT(PLR_READ_MESSAGE,
                              plr_reader_feed(&r, bytes, sink.length, &taken, &back));
        TEST_ASSERT_EQUAL_UINT16(i & 0xFFFF, back.sequence);
    }
    TEST_ASSERT_EQUAL_UINT32(0, r.counts.missing);
    TEST_ASSERT_EQUAL_UINT32(0x10003, writer.counts.frames);
}

static void test_an_end_tells_what_was_written_whatever_it_says(void) {
    const plr_kind kinds[] = {
        PLR_KIND_HEADER, PLR_KIND_TWIST, PLR_KIND_TWIST,    PLR_KIND_TWIST, PLR_KIND_STEREO,
        PLR_KIND_STEREO, PLR_KIND_TRUTH, PLR_KIND_LANDMARK, PLR_KIND_TWIST, PLR_KIND_LANDMARK,
        PLR_KIND_TRUTH,  PLR_KIND_TRUTH, PLR_KIND_READING,  PLR_KIND_IMU,   PLR_KIND_IMU};
    enum { FRAMES = sizeof kinds / sizeof *kinds };
    for (unsigned i = 0; i < FRAMES; i++)
        TEST_ASSERT_EQUAL_INT(PLR_OK, put_sample(kinds[i]));
    sink.length = 0;
    plr_message end = {.kind = PLR_KIND_END}, back;
    end.as.end.sent[PLR_COUNTED_TWIST] = 1000;
    end.as.end.arrived[PLR_COUNTED_READING] = 9; /* which the writer cannot know */
    end.as.end.differs = 1U << PLR_COUNTED_READING;
    TEST_ASSERT_EQUAL_INT(PLR_OK, put(&end));
    plr_reader r = wire_reader();
    size_t taken;
    TEST_ASSERT_EQUAL_INT(PLR_READ_MESSAGE, plr_reader_feed(&r, bytes, sink.length, &taken, &back));
    end.as.end = (plr_end){{4, 2, 3, 2, 1, 2}, FRAMES, 16, {0, 0, 0, 0, 9, 0}};
    wire_assert_same(&end, &back);
}

/* Bodies of every length around one block, without a zero in what is varied. */
static void test_a_call_of_the_function_is_of_1_to_255_bytes(void) {
    static plr_observation observations[40];
    memset(observations, 0x41, sizeof observations);
    plr_message m = {.kind = PLR_KIND_STEREO};
    m.as.stereo = (plr_frame){.t_ns = UINT64_MAX, .budget = PLR_NO_BUDGET};
    m.as.stereo.observations = observations;
    for (unsigned first = 0; first < 30; first++) {
        observations[first].id = 0x41004141; /* moves the place at which a block begins */
        for (unsigned count = 0; count <= 40; count++) {
            m.as.stereo.count = (uint16_t)count;
            TEST_ASSERT_EQUAL_INT(PLR_OK, put(&m));
        }
        observations[first].id = 0x41414141;
    }
    TEST_ASSERT_EQUAL_size_t(255, sink.longest_call);
    TEST_ASSERT_GREATER_THAN_size_t(0, sink.shortest_call);
}

/* --- failing --- */

/* Writes a HEADER, a STEREO and a TWIST; the function fails once, at the given byte. Returns how
 * many of the three it came to know of as lost. */
static unsigned put_three_failing_at(size_t fail_at) {
    const plr_kind kinds[] = {PLR_KIND_HEADER, PLR_KIND_STEREO, PLR_KIND_TWIST};
    unsigned lost = 0;
    setUp();
    sink.fail_at = fail_at;
    for (unsigned i = 0; i < 3; i++) {
        plr_status status = put_sample(kinds[i]);
        TEST_ASSERT_TRUE(status == PLR_OK || status == PLR_E_IO);
        if (status == PLR_E_IO) {
            lost++;
            sink.fail_at = sink.capacity; /* the link is back */
        }
    }
    return lost;
}

static void test_a_failure_at_any_byte_costs_one_message_and_no_more(void) {
    TEST_ASSERT_EQUAL_UINT(0, put_three_failing_at(sizeof bytes));
    size_t whole = sink.length;
    for (size_t fail_at = 0; fail_at < whole; fail_at++) {
        TEST_ASSERT_EQUAL_UINT(1, put_three_failing_at(fail_at));
        TEST_ASSERT_EQUAL_UINT32(2, writer.counts.frames);
        TEST_ASSERT_EQUAL_INT(PLR_OK, put_sample(PLR_KIND_END));
        plr_reader r = wire_reader();
        /* A frame that lacked nothing but its delimiter gets it from the next one. */
        unsigned read = wire_read_all(&r, bytes, sink.length, NULL, NULL);
        TEST_ASSERT_TRUE(read == 3 || read == 4);
        TEST_ASSERT_EQUAL_UINT32(4 - read, r.counts.missing);
        TEST_ASSERT_LESS_OR_EQUAL_UINT32(1, r.counts.damaged);
    }
}

static void test_nothing_is_sent_of_a_frame_after_its_failure(void) {
    sink.fail_at = 0;
    TEST_ASSERT_EQUAL_INT(PLR_E_IO, put_sample(PLR_KIND_STEREO));
    TEST_ASSERT_EQUAL_UINT(1, sink.calls);
}

static void test_a_function_that_always_fails_is_tried_once_a_message(void) {
    sink.fail_at = 0;
    for (unsigned i = 1; i <= 5; i++) {
        TEST_ASSERT_EQUAL_INT(PLR_E_IO, put_sample(PLR_KIND_TWIST));
        TEST_ASSERT_EQUAL_UINT(i, sink.calls);
    }
    TEST_ASSERT_EQUAL_UINT32(0, writer.counts.frames);
    TEST_ASSERT_EQUAL_UINT16(5, writer.sequence);
}
