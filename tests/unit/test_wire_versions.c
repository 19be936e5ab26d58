// SPDX-License-Identifier: MIT
/* Payloads that are not as a writer makes them: of an earlier version, of a later one, too short, or
 * with values that docs/REPLAY-FORMAT.md does not list. */
#include "record/messages.h"

#include <string.h>
#include <unity.h>

#include "pelorus/settings.h"
#include "support/wire_frames.h"
#include "support/wire_samples.h"

static uint8_t payload[WIRE_BUFFER_SIZE + 4096];
static size_t length;

static plr_message encode(plr_kind kind) {
    plr_message m = wire_sample(kind, WIRE_SAMPLE_COMMON);
    length = wire_payload(&m, payload, sizeof payload);
    return m;
}

/* --- lengths --- */

static plr_status read_payload(plr_kind kind, size_t n, plr_message *m) {
    return wire_read_payload(kind, payload, n, m);
}

/* By how much a payload of format 1.3 is shorter: what is suggested for an IMU, the velocity at the
 * start, velocity and biases of a truth, the count of IMU messages, a frame's innovation. */
static size_t since_1_3(plr_kind kind) {
    return kind == PLR_KIND_HEADER   ? 49
           : kind == PLR_KIND_START  ? 48
           : kind == PLR_KIND_TRUTH  ? 73
           : kind == PLR_KIND_END    ? 8
           : kind == PLR_KIND_REPORT ? 10
                                     : 0;
}

/* By how much one of format 1.1 is shorter: half of the reasons and the notice, the sigmas of single
 * axes, and what came later. */
static size_t since_1_1(plr_kind kind) {
    return kind == PLR_KIND_REPORT   ? 4 + since_1_3(kind)
           : kind == PLR_KIND_HEADER ? 48 + since_1_3(kind)
                                     : 0;
}

/* The same of format 1.2: trace and variances of the biases, the notice, what has arrived. */
static size_t since_1_2(plr_kind kind) {
    if (kind == PLR_KIND_END)
        return 25 + since_1_3(kind);
    return kind == PLR_KIND_POSE ? 32 : kind == PLR_KIND_REPORT ? 2 + since_1_3(kind) : 0;
}

static bool is_whole_in_an_earlier_format(plr_kind kind, size_t n) {
    return (since_1_1(kind) > 0 && n == length - since_1_1(kind)) ||
           (since_1_2(kind) > 0 && n == length - since_1_2(kind)) ||
           (since_1_3(kind) > 0 && n == length - since_1_3(kind)) ||
           (kind == PLR_KIND_STEREO && n == length - 3 * 4); /* the sigmas, since 1.7 */
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

/* What an absent field is read as. */
static void forget_innovation(plr_report *expected) {
    expected->innovation_rows = 0;
    expected->innovation_d2 = expected->innovation_log_det = -1;
}

static void test_a_report_of_format_1_1_has_the_lower_reasons_alone(void) {
    plr_message m, expected = encode(PLR_KIND_REPORT);
    const size_t old = length - since_1_1(PLR_KIND_REPORT);
    TEST_ASSERT_EQUAL_INT(PLR_OK, read_payload(PLR_KIND_REPORT, old, &m));
    expected.as.report.report.reasons &= 0xFFFF;
    expected.as.report.notice = PLR_NOTICE_NONE;
    forget_innovation(&expected.as.report.report);
    wire_assert_same(&expected, &m);
    TEST_ASSERT_EQUAL_HEX32(PLR_REASON_FEW_OBSERVATIONS, m.as.report.report.reasons);
}

static void forget_imu(plr_header *expected) {
    expected->process = PLR_PROCESS_TWIST;
    expected->gyro_noise = expected->accel_noise = -1;
    expected->gyro_walk = expected->accel_walk = -1;
    expected->bias_accel_sigma_mps2 = expected->gravity_mps2 = -1;
}

static void forget_all_but_the_pose(plr_truth *expected) {
    expected->knows = 0;
    for (unsigned i = 0; i < 3; i++)
        expected->v_B_mps[i] = -1;
    for (unsigned i = 0; i < 6; i++)
        expected->bias[i] = -1;
}

static void test_what_came_with_format_1_4_is_absent_in_a_payload_of_1_3(void) {
    static const plr_kind kinds[] = {PLR_KIND_HEADER, PLR_KIND_START, PLR_KIND_TRUTH, PLR_KIND_END,
                                     PLR_KIND_REPORT};
    for (unsigned i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        plr_message m, expected = encode(kinds[i]);
        const size_t old = length - since_1_3(kinds[i]);
        TEST_ASSERT_EQUAL_INT(PLR_OK, read_payload(kinds[i], old, &m));
        if (kinds[i] == PLR_KIND_HEADER)
            forget_imu(&expected.as.header);
        if (kinds[i] == PLR_KIND_REPORT)
            forget_innovation(&expected.as.report.report);
        for (unsigned j = 0; j < 3 && kinds[i] == PLR_KIND_START; j++)
            expected.as.start.velocity[j] = expected.as.start.velocity_variance[j] = -1;
        if (kinds[i] == PLR_KIND_TRUTH)
            forget_all_but_the_pose(&expected.as.truth);
        if (kinds[i] == PLR_KIND_END)
            expected.as.end.sent[PLR_COUNTED_IMU] = expected.as.end.arrived[PLR_COUNTED_IMU] = 0;
        wire_assert_same(&expected, &m);
    }
}

static void test_a_header_of_format_1_1_tells_nothing_of_single_axes(void) {
    plr_message m, expected = encode(PLR_KIND_HEADER);
    const size_t old = length - since_1_1(PLR_KIND_HEADER);
    TEST_ASSERT_EQUAL_INT(PLR_OK, read_payload(PLR_KIND_HEADER, old, &m));
    for (unsigned i = 0; i < 3; i++) {
        expected.as.header.velocity_sigma_axes_mps[i] = -1;
        expected.as.header.gyro_sigma_axes_radps[i] = -1;
    }
    forget_imu(&expected.as.header);
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
        if (kinds[i] == PLR_KIND_REPORT) {
            expected.as.report.notice = PLR_NOTICE_NONE;
            forget_innovation(&expected.as.report.report);
        }
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
    {PLR_KIND_STATE, 8, 3, 255},    {PLR_KIND_IMU, 12, 0, 0},       {PLR_KIND_IMU, 12, 21, 255}};

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

/* --- sigmas of single observations, since 1.7 --- */

static void stereo_with(const float sigma[3], plr_message *m) {
    static plr_observation observations[3];
    for (unsigned i = 0; i < 3; i++)
        observations[i] =
            (plr_observation){7 + i, 100, 50, PLR_NOT_SEEN_PX, PLR_NOT_SEEN_PX, sigma[i]};
    m->kind = PLR_KIND_STEREO;
    m->as.stereo = (plr_frame){12, PLR_NO_BUDGET, 3, observations};
    length = wire_payload(m, payload, sizeof payload);
}

static void test_a_frame_without_a_sigma_has_the_bytes_of_before(void) {
    const float none[3] = {0, 0, 0};
    plr_message m;
    stereo_with(none, &m);
    TEST_ASSERT_EQUAL_size_t(12 + 3 * 20, length);
}

static void test_sigmas_come_behind_the_rows_and_are_read_again(void) {
    const float sigma[3] = {0.25F, 0, 3};
    plr_message m, got;
    stereo_with(sigma, &m);
    TEST_ASSERT_EQUAL_size_t(12 + 3 * 24, length);
    TEST_ASSERT_EQUAL_MEMORY(sigma, payload + 12 + 3 * 20, sizeof sigma);
    TEST_ASSERT_EQUAL_INT(PLR_OK, read_payload(PLR_KIND_STEREO, length, &got));
    for (unsigned i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL_FLOAT(sigma[i], got.as.stereo.observations[i].sigma_px);
        TEST_ASSERT_EQUAL_FLOAT(PLR_NOT_SEEN_PX, got.as.stereo.observations[i].vR_px);
    }
}

static void test_in_a_payload_of_before_they_are_0(void) {
    const float sigma[3] = {0.25F, 0, 3};
    plr_message m, got;
    stereo_with(sigma, &m);
    TEST_ASSERT_EQUAL_INT(PLR_OK, read_payload(PLR_KIND_STEREO, 12 + 3 * 20, &got));
    for (unsigned i = 0; i < 3; i++)
        TEST_ASSERT_EQUAL_FLOAT(0, got.as.stereo.observations[i].sigma_px);
}
