// SPDX-License-Identifier: MIT
/* The payload of every kind against docs/REPLAY-FORMAT.md: the place of each field, and what is
 * too short, too long, or beyond what the page lists. */
#include "record/messages.h"

#include <string.h>
#include <unity.h>

#include "support/wire_frames.h"
#include "support/wire_samples.h"

static uint8_t payload[WIRE_BUFFER_SIZE + 4096];
static size_t length;

void setUp(void) {
}

void tearDown(void) {
}

/* --- the place of each field --- */

static plr_message encode(plr_kind kind) {
    plr_message m = wire_sample(kind, WIRE_SAMPLE_COMMON);
    length = wire_payload(&m, payload, sizeof payload);
    return m;
}

/* The number of n bytes at a place. */
static uint64_t number_at(size_t at, unsigned n) {
    uint64_t value = 0;
    for (unsigned i = 0; i < n; i++)
        value += (uint64_t)payload[at + i] << 8 * i;
    return value;
}

#define ASSERT_NUMBER(at, bytes, value)                                                            \
    TEST_ASSERT_EQUAL_UINT64((uint64_t)(value), number_at((at), (bytes)))

/* Equal bit by bit; the tests run on little-endian machines. */
#define ASSERT_F64(at, value) TEST_ASSERT_EQUAL_MEMORY(&(value), payload + (at), 8)
#define ASSERT_F32(at, value) TEST_ASSERT_EQUAL_MEMORY(&(value), payload + (at), 4)

static void assert_f64s(size_t at, const double *values, unsigned n) {
    TEST_ASSERT_EQUAL_MEMORY(values, payload + at, 8 * n);
}

static void assert_f32s(size_t at, const double *values, unsigned n) {
    for (unsigned i = 0; i < n; i++) {
        float narrow = (float)values[i];
        ASSERT_F32(at + 4 * i, narrow);
    }
}

/* The next n bytes of a payload. */
static bool take(void *context, uint8_t *bytes, unsigned n) {
    const uint8_t **at = context;
    memcpy(bytes, *at, n);
    *at += n;
    return true;
}

static void test_header_fields_lie_where_the_page_says(void) {
    const plr_header m = encode(PLR_KIND_HEADER).as.header;
    TEST_ASSERT_EQUAL_size_t(202 + strlen(m.name) + 48, length);
    ASSERT_NUMBER(0, 1, 1);
    ASSERT_NUMBER(1, 1, PLR_WIRE_VERSION_MINOR);
    ASSERT_NUMBER(2, 1, m.body_axes);
    ASSERT_NUMBER(3, 1, m.twist_timing);
    ASSERT_NUMBER(4, 1, 0);
    ASSERT_NUMBER(5, 1, strlen(m.name));
    ASSERT_NUMBER(6, 2, m.image_width_px);
    ASSERT_NUMBER(8, 2, m.image_height_px);
    ASSERT_F64(10, m.calibration.fx_px);
    ASSERT_F64(18, m.calibration.fy_px);
    ASSERT_F64(26, m.calibration.cx_px);
    ASSERT_F64(34, m.calibration.cy_px);
    ASSERT_F64(42, m.calibration.baseline_m);
    assert_f64s(50, m.calibration.T_CB.R, 9);
    assert_f64s(122, m.calibration.T_CB.p, 3);
    ASSERT_F64(146, m.pixel_sigma_px);
    ASSERT_F64(154, m.velocity_sigma_mps);
    ASSERT_F64(162, m.gyro_sigma_radps);
    ASSERT_F64(170, m.bias_velocity_sigma_mps);
    ASSERT_F64(178, m.bias_gyro_sigma_radps);
    ASSERT_F64(186, m.bias_velocity_walk);
    ASSERT_F64(194, m.bias_gyro_walk);
    TEST_ASSERT_EQUAL_MEMORY(m.name, payload + 202, strlen(m.name));
    assert_f64s(202 + strlen(m.name), m.velocity_sigma_axes_mps, 3);
    assert_f64s(226 + strlen(m.name), m.gyro_sigma_axes_radps, 3);
}

static void test_config_fields_lie_where_the_page_says(void) {
    const plr_config_message m = encode(PLR_KIND_CONFIG).as.config;
    TEST_ASSERT_EQUAL_size_t(11 + 9 * 5, length);
    ASSERT_NUMBER(0, 4, m.build_fingerprint);
    ASSERT_NUMBER(4, 2, m.max_landmarks);
    ASSERT_NUMBER(6, 2, m.max_observations);
    ASSERT_NUMBER(8, 1, m.block_observations);
    ASSERT_NUMBER(9, 1, m.real_bytes);
    ASSERT_NUMBER(10, 1, 5);
    for (unsigned i = 0; i < 5; i++) {
        ASSERT_NUMBER(11 + 9 * i, 1, m.settings[i].id);
        ASSERT_F64(12 + 9 * i, m.settings[i].value);
    }
}

static void test_start_fields_lie_where_the_page_says(void) {
    const plr_start m = encode(PLR_KIND_START).as.start;
    TEST_ASSERT_EQUAL_size_t(369, length);
    ASSERT_NUMBER(0, 8, m.t_ns);
    assert_f64s(8, m.T_WB.R, 9);
    assert_f64s(80, m.T_WB.p, 3);
    ASSERT_NUMBER(104, 1, 2); /* a bias prior, no covariance */
    assert_f64s(105, m.P_xi, 21);
    assert_f64s(273, m.bias, 6);
    assert_f64s(321, m.bias_variance, 6);
}

static void test_twist_fields_lie_where_the_page_says(void) {
    const plr_twist_message m = encode(PLR_KIND_TWIST).as.twist;
    TEST_ASSERT_EQUAL_size_t(56, length);
    ASSERT_NUMBER(0, 8, m.t_ns);
    assert_f64s(8, m.twist.v_B_mps, 3);
    assert_f64s(32, m.twist.w_B_radps, 3);
}

static void test_stereo_fields_lie_where_the_page_says(void) {
    const plr_frame m = encode(PLR_KIND_STEREO).as.stereo;
    TEST_ASSERT_EQUAL_size_t(12 + 20 * 3, length);
    ASSERT_NUMBER(0, 8, m.t_ns);
    ASSERT_NUMBER(8, 2, m.budget);
    ASSERT_NUMBER(10, 2, 3);
    for (unsigned i = 0; i < 3; i++) {
        ASSERT_NUMBER(12 + 20 * i, 4, m.observations[i].id);
        ASSERT_F32(16 + 20 * i, m.observations[i].uL_px);
        ASSERT_F32(20 + 20 * i, m.observations[i].vL_px);
        ASSERT_F32(24 + 20 * i, m.observations[i].uR_px);
        ASSERT_F32(28 + 20 * i, m.observations[i].vR_px);
    }
}

static void test_truth_fields_lie_where_the_page_says(void) {
    const plr_truth m = encode(PLR_KIND_TRUTH).as.truth;
    TEST_ASSERT_EQUAL_size_t(104, length);
    ASSERT_NUMBER(0, 8, m.t_ns);
    assert_f64s(8, m.T_WB.R, 9);
    assert_f64s(80, m.T_WB.p, 3);
}

static void test_landmark_fields_lie_where_the_page_says(void) {
    plr_message m = wire_sample(PLR_KIND_LANDMARK, WIRE_SAMPLE_COMMON);
    const plr_landmark *l = &m.as.landmark.landmark;
    m.as.landmark.landmark.P_W_m2[1] = 77; /* the upper triangle is not looked at */
    length = wire_payload(&m, payload, sizeof payload);
    TEST_ASSERT_EQUAL_size_t(90, length);
    ASSERT_NUMBER(0, 8, l->last_seen_ns);
    ASSERT_NUMBER(8, 1, m.as.landmark.role);
    ASSERT_NUMBER(9, 1, 0);
    ASSERT_NUMBER(10, 4, l->id);
    ASSERT_NUMBER(14, 4, l->times_seen);
    assert_f64s(18, l->p_W_m, 3);
    assert_f64s(42, &l->P_W_m2[0], 1);
    assert_f64s(50, &l->P_W_m2[3], 2);
    assert_f64s(66, &l->P_W_m2[6], 3);
}

static void test_pose_fields_of_float64_lie_where_the_page_says(void) {
    plr_message message = wire_sample(PLR_KIND_POSE, WIRE_SAMPLE_COMMON);
    message.as.pose.real_bytes = 8;
    const plr_pose_message *m = &message.as.pose;
    length = wire_payload(&message, payload, sizeof payload);
    TEST_ASSERT_EQUAL_size_t(36 + 63 * 8 + 32, length);
    ASSERT_NUMBER(8, 1, 8);
    assert_f64s(12, m->T_WB.p, 3);
    assert_f64s(36, m->T_WB.R, 9);
    assert_f64s(108, m->P_xi, 21);
    assert_f64s(276, m->velocity.v_B_mps, 3);
    assert_f64s(300, m->velocity.w_B_radps, 3);
    assert_f64s(324, m->bias, 6);
    assert_f64s(372, m->P_u, 21);
    ASSERT_F64(540, m->trace);
    assert_f32s(548, m->bias_variance, 6);
}

static void test_pose_fields_of_float32_lie_where_the_page_says(void) {
    const plr_pose_message m = encode(PLR_KIND_POSE).as.pose;
    TEST_ASSERT_EQUAL_size_t(36 + 63 * 4 + 32, length);
    ASSERT_NUMBER(0, 8, m.t_ns);
    ASSERT_NUMBER(8, 1, 4);
    ASSERT_NUMBER(9, 1, 1);
    ASSERT_NUMBER(10, 2, m.reset_count);
    assert_f64s(12, m.T_WB.p, 3);
    assert_f32s(36, m.T_WB.R, 9);
    assert_f32s(72, m.P_xi, 21);
    assert_f32s(156, m.velocity.v_B_mps, 3);
    assert_f32s(168, m.velocity.w_B_radps, 3);
    assert_f32s(180, m.bias, 6);
    assert_f32s(204, m.P_u, 21);
    ASSERT_F64(288, m.trace);
    assert_f32s(296, m.bias_variance, 6);
}

static void test_report_fields_lie_where_the_page_says(void) {
    const plr_report_message m = encode(PLR_KIND_REPORT).as.report;
    TEST_ASSERT_EQUAL_size_t(56, length);
    ASSERT_NUMBER(0, 8, m.report.t_ns);
    ASSERT_NUMBER(8, 1, m.subject);
    ASSERT_NUMBER(9, 1, 256 - 7); /* PLR_E_LATE */
    ASSERT_NUMBER(10, 1, m.report.health);
    ASSERT_NUMBER(11, 1, 0);
    ASSERT_NUMBER(12, 2, PLR_REASON_FEW_OBSERVATIONS);
    for (unsigned i = 0; i < 15; i++) /* budget, observations, matched, ... nis_dof */
        ASSERT_NUMBER(14 + 2 * i, 2, 100 + i);
    ASSERT_F32(44, m.report.nis);
    ASSERT_NUMBER(48, 4, m.update_us);
    ASSERT_NUMBER(52, 2, PLR_REASON_STATE_DAMAGED >> 16);
    ASSERT_NUMBER(54, 1, PLR_NOTICE_RESTORED);
    ASSERT_NUMBER(55, 1, 0);
}

static void test_text_fills_the_payload_to_its_end(void) {
    const plr_text m = encode(PLR_KIND_TEXT).as.text;
    TEST_ASSERT_EQUAL_size_t(1 + strlen(m.text), length);
    ASSERT_NUMBER(0, 1, m.severity);
    TEST_ASSERT_EQUAL_MEMORY(m.text, payload + 1, strlen(m.text));
}

static void test_end_counts_lie_where_the_page_says(void) {
    plr_end counts = {0};
    for (unsigned i = 0; i < 45; i++) /* numbers of 4 bytes, with the one byte at 24 between them */
        payload[i] = (uint8_t)((i > 24 ? i - 1 : i) % 4 == 0 ? 1 + i / 4 : 0);
    const uint8_t *at = payload;
    plr_codec codec = {.direction = PLR_CODEC_READ, .move = take, .context = &at, .left = 45};
    plr_message_pass(&codec, PLR_KIND_END, &counts, NULL);
    TEST_ASSERT_EQUAL_INT(PLR_OK, codec.status);
    TEST_ASSERT_EQUAL_size_t(0, codec.left);
    TEST_ASSERT_EQUAL_UINT32(1, counts.twists);
    TEST_ASSERT_EQUAL_UINT32(2, counts.stereos);
    TEST_ASSERT_EQUAL_UINT32(3, counts.truths);
    TEST_ASSERT_EQUAL_UINT32(4, counts.landmarks);
    TEST_ASSERT_EQUAL_UINT32(5, counts.frames);
    TEST_ASSERT_EQUAL_UINT32(6, counts.readings);
    TEST_ASSERT_EQUAL_UINT8(7, counts.differs);
    for (unsigned i = 0; i < PLR_COUNTED; i++)
        TEST_ASSERT_EQUAL_UINT32(7 + i, counts.arrived[i]);
}

static void test_state_fields_lie_where_the_page_says(void) {
    const plr_state_message m = encode(PLR_KIND_STATE).as.state;
    TEST_ASSERT_EQUAL_size_t(57, length);
    ASSERT_NUMBER(0, 8, m.t_ns);
    ASSERT_NUMBER(8, 1, 2); /* restore */
    assert_f64s(9, m.moved_variance, 6);
}

static void test_reading_fields_lie_where_the_page_says(void) {
    const plr_reading m = encode(PLR_KIND_READING).as.reading;
    TEST_ASSERT_EQUAL_size_t(58, length);
    ASSERT_NUMBER(0, 8, m.t_ns);
    ASSERT_NUMBER(8, 1, 3); /* position */
    ASSERT_NUMBER(9, 1, 5); /* x and z */
    assert_f64s(10, m.value, 3);
    assert_f32s(34, m.sigma, 3);
    assert_f32s(46, m.at_B_m, 3);
}

/* --- lengths --- */

/* Reads n bytes of payload. The bytes are copied to where a step beyond them is found out by the
 * sanitizers. */
static plr_status read_payload(plr_kind kind, size_t n, plr_message *m) {
    static plr_observation observations[PLR_WIRE_MAX_OBSERVATIONS];
    const plr_observation_room room = {observations, PLR_WIRE_MAX_OBSERVATIONS};
    const uint8_t *at = payload + sizeof payload - n;
    plr_codec codec = {.direction = PLR_CODEC_READ, .move = take, .context = &at, .left = n};
    memmove(payload + sizeof payload - n, payload, n);
    memset(m, 0, sizeof *m);
    m->kind = kind;
    plr_message_pass(&codec, kind, &m->as, &room);
    return codec.status;
}

/* By how much a payload of format 1.1 is shorter: half of the reasons and the notice, the sigmas of
 * single axes. */
static size_t since_1_1(plr_kind kind) {
    return kind == PLR_KIND_REPORT ? 4 : kind == PLR_KIND_HEADER ? 48 : 0;
}

/* The same of format 1.2: trace and variances of the biases, the notice, what has arrived. */
static size_t since_1_2(plr_kind kind) {
    return kind == PLR_KIND_POSE ? 32 : kind == PLR_KIND_REPORT ? 2 : kind == PLR_KIND_END ? 25 : 0;
}

static bool is_whole_in_an_earlier_format(plr_kind kind, size_t n) {
    return (since_1_1(kind) > 0 && n == length - since_1_1(kind)) ||
           (since_1_2(kind) > 0 && n == length - since_1_2(kind));
}

static void test_every_shorter_payload_is_malformed(void) {
    for (unsigned kind = PLR_KIND_HEADER; kind <= PLR_WIRE_KINDS; kind++) {
        plr_message m;
        encode((plr_kind)kind);
        size_t least = kind == PLR_KIND_TEXT ? 1 : length;
        for (size_t n = 0; n < least; n++) {
            if (is_whole_in_an_earlier_format((plr_kind)kind, n))
                continue;
            encode((plr_kind)kind);
            TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, read_payload((plr_kind)kind, n, &m));
        }
    }
}

static void test_a_report_of_format_1_1_has_the_lower_reasons_alone(void) {
    plr_message m, expected = encode(PLR_KIND_REPORT);
    const size_t old = length - since_1_1(PLR_KIND_REPORT);
    TEST_ASSERT_EQUAL_INT(PLR_OK, read_payload(PLR_KIND_REPORT, old, &m));
    expected.as.report.report.reasons &= 0xFFFF;
    expected.as.report.notice = PLR_NOTICE_NONE;
    wire_assert_same(&expected, &m);
    TEST_ASSERT_EQUAL_HEX32(PLR_REASON_FEW_OBSERVATIONS, m.as.report.report.reasons);
}

static void test_a_header_of_format_1_1_tells_nothing_of_single_axes(void) {
    plr_message m, expected = encode(PLR_KIND_HEADER);
    const size_t old = length - since_1_1(PLR_KIND_HEADER);
    TEST_ASSERT_EQUAL_INT(PLR_OK, read_payload(PLR_KIND_HEADER, old, &m));
    for (unsigned i = 0; i < 3; i++) {
        expected.as.header.velocity_sigma_axes_mps[i] = -1;
        expected.as.header.gyro_sigma_axes_radps[i] = -1;
    }
    wire_assert_same(&expected, &m);
}

static void test_what_came_with_format_1_3_is_unknown_in_a_payload_of_1_2(void) {
    static const plr_kind kinds[] = {PLR_KIND_POSE, PLR_KIND_REPORT, PLR_KIND_END};
    for (unsigned i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        plr_message m, expected = encode(kinds[i]);
        const size_t old = length - since_1_2(kinds[i]);
        TEST_ASSERT_EQUAL_INT(PLR_OK, read_payload(kinds[i], old, &m));
        if (kinds[i] == PLR_KIND_POSE) {
            expected.as.pose.trace = -1;
            for (unsigned j = 0; j < 6; j++)
                expected.as.pose.bias_variance[j] = -1;
        }
        if (kinds[i] == PLR_KIND_REPORT)
            expected.as.report.notice = PLR_NOTICE_NONE;
        if (kinds[i] == PLR_KIND_END)
            memset(&expected.as.end, 0, sizeof expected.as.end);
        wire_assert_same(&expected, &m);
    }
}

static void test_bytes_behind_the_payload_are_a_later_version_s_and_are_ignored(void) {
    for (unsigned kind = PLR_KIND_HEADER; kind <= PLR_WIRE_KINDS; kind++) {
        if (kind == PLR_KIND_TEXT)
            continue;
        for (size_t more = 0; more < 40; more++) {
            plr_message m, expected = encode((plr_kind)kind);
            memset(payload + length, 0xA5, more);
            TEST_ASSERT_EQUAL_INT(PLR_OK, read_payload((plr_kind)kind, length + more, &m));
            wire_assert_same(&expected, &m);
        }
    }
}

/* --- values --- */

typedef struct bad_value {
    plr_kind kind;
    size_t at;
    unsigned first, last; /* bad values */
} bad_value;

static const bad_value bad_values[] = {
    {PLR_KIND_HEADER, 0, 0, 0},     {PLR_KIND_HEADER, 2, 3, 255},   {PLR_KIND_HEADER, 3, 3, 255},
    {PLR_KIND_HEADER, 4, 1, 255},   {PLR_KIND_HEADER, 5, 64, 255},  {PLR_KIND_CONFIG, 10, 65, 255},
    {PLR_KIND_STEREO, 11, 17, 255}, {PLR_KIND_LANDMARK, 8, 3, 255}, {PLR_KIND_POSE, 8, 0, 3},
    {PLR_KIND_POSE, 8, 5, 7},       {PLR_KIND_POSE, 8, 9, 255},     {PLR_KIND_REPORT, 9, 1, 127},
    {PLR_KIND_REPORT, 10, 4, 255},  {PLR_KIND_TEXT, 0, 3, 255},     {PLR_KIND_STATE, 8, 0, 0},
    {PLR_KIND_STATE, 8, 3, 255}};

/* There are bytes enough behind each: it is the value that is wrong, not the length. */
static void test_values_that_the_page_does_not_list_are_malformed(void) {
    for (size_t i = 0; i < sizeof bad_values / sizeof *bad_values; i++) {
        const bad_value *bad = &bad_values[i];
        for (unsigned value = bad->first; value <= bad->last; value++) {
            plr_message m;
            encode(bad->kind);
            memset(payload + length, 0, sizeof payload - length);
            payload[bad->at] = (uint8_t)value;
            TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, read_payload(bad->kind, sizeof payload, &m));
        }
    }
}

static void test_a_status_of_a_later_version_is_let_through(void) {
    plr_message m;
    encode(PLR_KIND_REPORT);
    payload[9] = 128;
    TEST_ASSERT_EQUAL_INT(PLR_OK, read_payload(PLR_KIND_REPORT, length, &m));
    TEST_ASSERT_EQUAL_INT(-128, m.as.report.report.status);
}

static void test_bits_and_bytes_without_a_meaning_are_ignored(void) {
    const struct {
        plr_kind kind;
        size_t at;
        uint8_t bits;
    } spare[] = {{PLR_KIND_START, 104, 0xFC},
                 {PLR_KIND_LANDMARK, 9, 0xFF},
                 {PLR_KIND_POSE, 9, 0xFE},
                 {PLR_KIND_REPORT, 11, 0xFF},
                 {PLR_KIND_REPORT, 55, 0xFF}};
    for (size_t i = 0; i < sizeof spare / sizeof *spare; i++) {
        plr_message m, expected = encode(spare[i].kind);
        payload[spare[i].at] |= spare[i].bits;
        TEST_ASSERT_EQUAL_INT(PLR_OK, read_payload(spare[i].kind, length, &m));
        wire_assert_same(&expected, &m);
    }
}

static void test_a_text_s_length_ends_at_its_zero_or_at_its_size(void) {
    static const char text[] = "abcdefg";
    TEST_ASSERT_EQUAL_size_t(7, plr_text_length(text, sizeof text));
    TEST_ASSERT_EQUAL_size_t(4, plr_text_length(text, 4));
    TEST_ASSERT_EQUAL_size_t(0, plr_text_length(text, 0));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_header_fields_lie_where_the_page_says);
    RUN_TEST(test_config_fields_lie_where_the_page_says);
    RUN_TEST(test_start_fields_lie_where_the_page_says);
    RUN_TEST(test_twist_fields_lie_where_the_page_says);
    RUN_TEST(test_stereo_fields_lie_where_the_page_says);
    RUN_TEST(test_truth_fields_lie_where_the_page_says);
    RUN_TEST(test_landmark_fields_lie_where_the_page_says);
    RUN_TEST(test_pose_fields_of_float64_lie_where_the_page_says);
    RUN_TEST(test_pose_fields_of_float32_lie_where_the_page_says);
    RUN_TEST(test_report_fields_lie_where_the_page_says);
    RUN_TEST(test_text_fills_the_payload_to_its_end);
    RUN_TEST(test_end_counts_lie_where_the_page_says);
    RUN_TEST(test_state_fields_lie_where_the_page_says);
    RUN_TEST(test_reading_fields_lie_where_the_page_says);
    RUN_TEST(test_every_shorter_payload_is_malformed);
    RUN_TEST(test_a_report_of_format_1_1_has_the_lower_reasons_alone);
    RUN_TEST(test_a_header_of_format_1_1_tells_nothing_of_single_axes);
    RUN_TEST(test_what_came_with_format_1_3_is_unknown_in_a_payload_of_1_2);
    RUN_TEST(test_bytes_behind_the_payload_are_a_later_version_s_and_are_ignored);
    RUN_TEST(test_values_that_the_page_does_not_list_are_malformed);
    RUN_TEST(test_a_status_of_a_later_version_is_let_through);
    RUN_TEST(test_bits_and_bytes_without_a_meaning_are_ignored);
    RUN_TEST(test_a_text_s_length_ends_at_its_zero_or_at_its_size);
    return UNITY_END();
}
