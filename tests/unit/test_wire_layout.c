// SPDX-License-Identifier: MIT
/* The payload of every kind against docs/REPLAY-FORMAT.md: the place of each field. */
#include <string.h>
#include <unity.h>

#include "support/wire_frames.h"
#include "support/wire_samples.h"

static uint8_t payload[WIRE_BUFFER_SIZE + 4096];
static size_t length;

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

static void test_header_fields_lie_where_the_page_says(void) {
    const plr_header m = encode(PLR_KIND_HEADER).as.header;
    TEST_ASSERT_EQUAL_size_t(202 + strlen(m.name) + 48 + 49, length);
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
    ASSERT_NUMBER(250 + strlen(m.name), 1, m.process);
    ASSERT_F64(251 + strlen(m.name), m.gyro_noise);
    ASSERT_F64(259 + strlen(m.name), m.accel_noise);
    ASSERT_F64(267 + strlen(m.name), m.gyro_walk);
    ASSERT_F64(275 + strlen(m.name), m.accel_walk);
    ASSERT_F64(283 + strlen(m.name), m.bias_accel_sigma_mps2);
    ASSERT_F64(291 + strlen(m.name), m.gravity_mps2);
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
    TEST_ASSERT_EQUAL_size_t(417, length);
    ASSERT_NUMBER(0, 8, m.t_ns);
    assert_f64s(8, m.T_WB.R, 9);
    assert_f64s(80, m.T_WB.p, 3);
    ASSERT_NUMBER(104, 1, 2); /* a bias prior, no covariance */
    assert_f64s(105, m.P_xi, 21);
    assert_f64s(273, m.bias, 6);
    assert_f64s(321, m.bias_variance, 6);
    assert_f64s(369, m.velocity, 3);
    assert_f64s(393, m.velocity_variance, 3);
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
    TEST_ASSERT_EQUAL_size_t(12 + 20 * 3 + 4 * 3, length);
    ASSERT_NUMBER(0, 8, m.t_ns);
    ASSERT_NUMBER(8, 2, m.budget);
    ASSERT_NUMBER(10, 2, 3);
    for (unsigned i = 0; i < 3; i++) {
        ASSERT_NUMBER(12 + 20 * i, 4, m.observations[i].id);
        ASSERT_F32(16 + 20 * i, m.observations[i].uL_px);
        ASSERT_F32(20 + 20 * i, m.observations[i].vL_px);
        ASSERT_F32(24 + 20 * i, m.observations[i].uR_px);
        ASSERT_F32(28 + 20 * i, m.observations[i].vR_px);
        ASSERT_F32(12 + 20 * 3 + 4 * i, m.observations[i].sigma_px);
    }
}

static void test_truth_fields_lie_where_the_page_says(void) {
    const plr_truth m = encode(PLR_KIND_TRUTH).as.truth;
    TEST_ASSERT_EQUAL_size_t(177, length);
    ASSERT_NUMBER(0, 8, m.t_ns);
    assert_f64s(8, m.T_WB.R, 9);
    assert_f64s(80, m.T_WB.p, 3);
    ASSERT_NUMBER(104, 1, PLR_TRUTH_BIAS);
    assert_f64s(105, m.v_B_mps, 3);
    assert_f64s(129, m.bias, 6);
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
    TEST_ASSERT_EQUAL_size_t(66, length);
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
    ASSERT_NUMBER(56, 2, m.report.innovation_rows);
    ASSERT_F32(58, m.report.innovation_d2);
    ASSERT_F32(62, m.report.innovation_log_det);
}

static void test_text_fills_the_payload_to_its_end(void) {
    const plr_text m = encode(PLR_KIND_TEXT).as.text;
    TEST_ASSERT_EQUAL_size_t(1 + strlen(m.text), length);
    ASSERT_NUMBER(0, 1, m.severity);
    TEST_ASSERT_EQUAL_MEMORY(m.text, payload + 1, strlen(m.text));
}

static void test_end_counts_lie_where_the_page_says(void) {
    plr_message m;
    for (unsigned i = 0; i < 53; i++) /* numbers of 4 bytes, with the one byte at 24 between them */
        payload[i] = (uint8_t)((i > 24 ? i - 1 : i) % 4 == 0 ? 1 + i / 4 : 0);
    TEST_ASSERT_EQUAL_INT(PLR_OK, wire_read_payload(PLR_KIND_END, payload, 53, &m));
    const plr_end counts = m.as.end;
    for (unsigned i = 0; i <= PLR_COUNTED_LANDMARK; i++)
        TEST_ASSERT_EQUAL_UINT32(1 + i, counts.sent[i]);
    TEST_ASSERT_EQUAL_UINT32(5, counts.frames);
    TEST_ASSERT_EQUAL_UINT32(6, counts.sent[PLR_COUNTED_READING]);
    TEST_ASSERT_EQUAL_UINT8(7, counts.differs);
    for (unsigned i = 0; i < PLR_COUNTED_IMU; i++)
        TEST_ASSERT_EQUAL_UINT32(7 + i, counts.arrived[i]);
    TEST_ASSERT_EQUAL_UINT32(12, counts.sent[PLR_COUNTED_IMU]);
    TEST_ASSERT_EQUAL_UINT32(13, counts.arrived[PLR_COUNTED_IMU]);
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

static void test_imu_readings_lie_where_the_page_says(void) {
    const plr_imu_message m = encode(PLR_KIND_IMU).as.imu;
    TEST_ASSERT_EQUAL_size_t(13 + 24 * 3, length);
    ASSERT_NUMBER(0, 8, m.t_ns);
    ASSERT_NUMBER(8, 4, m.period_ns);
    ASSERT_NUMBER(12, 1, 3);
    for (unsigned i = 0; i < 3; i++) {
        assert_f32s(13 + 24 * i, m.readings[i].a_B_mps2, 3);
        assert_f32s(25 + 24 * i, m.readings[i].w_B_radps, 3);
    }
}
