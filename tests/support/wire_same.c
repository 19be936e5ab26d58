// SPDX-License-Identifier: MIT
#include <unity.h>

#include "support/wire_samples.h"

/* Structures without padding, or single fields. */
#define SAME(field) TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&e->field, &a->field, sizeof e->field, #field)

static void same_header(const plr_header *e, const plr_header *a) {
    SAME(version_major);
    SAME(version_minor);
    SAME(body_axes);
    SAME(twist_timing);
    SAME(image_width_px);
    SAME(image_height_px);
    SAME(calibration);
    SAME(pixel_sigma_px);
    SAME(velocity_sigma_mps);
    SAME(gyro_sigma_radps);
    SAME(bias_velocity_sigma_mps);
    SAME(bias_gyro_sigma_radps);
    SAME(bias_velocity_walk);
    SAME(bias_gyro_walk);
    SAME(velocity_sigma_axes_mps);
    SAME(gyro_sigma_axes_radps);
    SAME(process);
    SAME(gyro_noise);
    SAME(accel_noise);
    SAME(gyro_walk);
    SAME(accel_walk);
    SAME(bias_accel_sigma_mps2);
    SAME(gravity_mps2);
    TEST_ASSERT_EQUAL_STRING(e->name, a->name);
}

static void same_config(const plr_config_message *e, const plr_config_message *a) {
    SAME(build_fingerprint);
    SAME(max_landmarks);
    SAME(max_observations);
    SAME(block_observations);
    SAME(real_bytes);
    SAME(count);
    for (unsigned i = 0; i < e->count; i++) {
        SAME(settings[i].id);
        SAME(settings[i].value);
    }
}

static void same_start(const plr_start *e, const plr_start *a) {
    SAME(t_ns);
    SAME(T_WB);
    SAME(has_covariance);
    SAME(has_bias);
    SAME(P_xi);
    SAME(bias);
    SAME(bias_variance);
    SAME(velocity);
    SAME(velocity_variance);
}

static void same_stereo(const plr_frame *e, const plr_frame *a) {
    SAME(t_ns);
    SAME(budget);
    SAME(count);
    for (unsigned i = 0; i < e->count; i++)
        SAME(observations[i]);
}

static void same_landmark(const plr_landmark_message *e, const plr_landmark_message *a) {
    SAME(role);
    SAME(landmark.id);
    SAME(landmark.times_seen);
    SAME(landmark.times_gated);
    SAME(landmark.last_seen_ns);
    SAME(landmark.known);
    SAME(landmark.p_W_m);
    SAME(landmark.P_W_m2);
}

static void same_pose(const plr_pose_message *e, const plr_pose_message *a) {
    SAME(t_ns);
    SAME(real_bytes);
    SAME(after_update);
    SAME(reset_count);
    SAME(T_WB);
    SAME(P_xi);
    SAME(velocity);
    SAME(bias);
    SAME(P_u);
    SAME(trace);
    SAME(bias_variance);
}

static void same_report(const plr_report_message *e, const plr_report_message *a) {
    SAME(subject);
    SAME(notice);
    SAME(update_us);
    SAME(report.t_ns);
    SAME(report.status);
    SAME(report.health);
    SAME(report.reasons);
    SAME(report.budget);
    SAME(report.observations);
    SAME(report.matched);
    SAME(report.used);
    SAME(report.gated);
    SAME(report.created);
    SAME(report.evicted);
    SAME(report.refused);
    SAME(report.duplicates);
    SAME(report.no_room);
    SAME(report.poor);
    SAME(report.left_out);
    SAME(report.blocks_failed);
    SAME(report.active);
    SAME(report.nis_dof);
    SAME(report.innovation_rows);
    SAME(report.innovation_d2);
    SAME(report.innovation_log_det);
    SAME(report.nis);
}

static void same_calibration(const plr_calibration_result *e, const plr_calibration_result *a) {
    SAME(t_ns);
    SAME(estimated);
    SAME(camera);
    SAME(corrected);
    SAME(sigma);
}

static void same_evidence(const plr_supervision *e, const plr_supervision *a) {
    SAME(t_ns);
    SAME(nu);
    SAME(moved);
    SAME(statistic);
    SAME(usual);
    SAME(agreement);
    SAME(weight);
    SAME(difference);
    SAME(doubt);
    SAME(applied);
    SAME(outright);
    SAME(waits);
    SAME(holds_biases);
    SAME(locked);
    SAME(frozen);
    SAME(misfits);
    SAME(settled);
    SAME(matched);
    SAME(same);
    SAME(known);
    SAME(adopted);
    SAME(count);
    for (unsigned i = 0; i < e->count; i++) {
        SAME(rejected[i].id);
        SAME(rejected[i].why);
        SAME(rejected[i].in_succession);
        SAME(rejected[i].mean2);
    }
}

static void same_end(const plr_end *e, const plr_end *a) {
    SAME(sent);
    SAME(frames);
    SAME(differs);
    SAME(arrived);
}

static void same_reading(const plr_reading *e, const plr_reading *a) {
    SAME(t_ns);
    SAME(sensor);
    SAME(axes);
    SAME(value);
    SAME(sigma);
    SAME(at_B_m);
}

static void same_imu(const plr_imu_message *e, const plr_imu_message *a) {
    SAME(t_ns);
    SAME(period_ns);
    SAME(count);
    for (unsigned i = 0; i < e->count; i++)
        SAME(readings[i]);
}

static void same_image(const plr_image_message *e, const plr_image_message *a) {
    SAME(t_ns);
    SAME(side);
    SAME(width_px);
    SAME(height_px);
    SAME(first_px);
    SAME(count);
    TEST_ASSERT_EQUAL_UINT8_ARRAY(e->pixels, a->pixels, e->count);
}

static void same_lens(const plr_lens *e, const plr_lens *a) {
    SAME(model);
    SAME(width_px);
    SAME(height_px);
    SAME(fx_px);
    SAME(fy_px);
    SAME(cx_px);
    SAME(cy_px);
    SAME(k);
}

static void same_rig(const plr_rig *e, const plr_rig *a) {
    same_lens(&e->left, &a->left);
    same_lens(&e->right, &a->right);
    SAME(T_RL);
    SAME(row_time_s);
    SAME(disparity_max_px);
    SAME(tracks);
}

static void same_truth(const plr_truth *e, const plr_truth *a) {
    SAME(t_ns);
    SAME(T_WB);
    SAME(v_B_mps);
    SAME(bias);
    SAME(knows);
}

static void same_text(const plr_text *e, const plr_text *a) {
    TEST_ASSERT_EQUAL_UINT8(e->severity, a->severity);
    TEST_ASSERT_EQUAL_STRING(e->text, a->text);
}

static void same_state(const plr_state_message *e, const plr_state_message *a) {
    SAME(t_ns);
    SAME(action);
    SAME(moved_variance);
}

static void same_pictures(const plr_message *e, const plr_message *a) {
    if (e->kind == PLR_KIND_IMAGE)
        same_image(&e->as.image, &a->as.image);
    else
        same_rig(&e->as.rig, &a->as.rig);
}

void wire_assert_same(const plr_message *e, const plr_message *a) {
    TEST_ASSERT_EQUAL_INT(e->kind, a->kind);
    switch (e->kind) {
    case PLR_KIND_HEADER:
        same_header(&e->as.header, &a->as.header);
        break;
    case PLR_KIND_CONFIG:
        same_config(&e->as.config, &a->as.config);
        break;
    case PLR_KIND_START:
        same_start(&e->as.start, &a->as.start);
        break;
    case PLR_KIND_TWIST:
        SAME(as.twist);
        break;
    case PLR_KIND_STEREO:
        same_stereo(&e->as.stereo, &a->as.stereo);
        break;
    case PLR_KIND_TRUTH:
        same_truth(&e->as.truth, &a->as.truth);
        break;
    case PLR_KIND_LANDMARK:
        same_landmark(&e->as.landmark, &a->as.landmark);
        break;
    case PLR_KIND_POSE:
        same_pose(&e->as.pose, &a->as.pose);
        break;
    case PLR_KIND_REPORT:
        same_report(&e->as.report, &a->as.report);
        break;
    case PLR_KIND_CALIBRATION:
        same_calibration(&e->as.calibration, &a->as.calibration);
        break;
    case PLR_KIND_EVIDENCE:
        same_evidence(&e->as.evidence, &a->as.evidence);
        break;
    case PLR_KIND_TEXT:
        same_text(&e->as.text, &a->as.text);
        break;
    case PLR_KIND_END:
        same_end(&e->as.end, &a->as.end);
        break;
    case PLR_KIND_STATE:
        same_state(&e->as.state, &a->as.state);
        break;
    case PLR_KIND_READING:
        same_reading(&e->as.reading, &a->as.reading);
        break;
    case PLR_KIND_IMU:
        same_imu(&e->as.imu, &a->as.imu);
        break;
    case PLR_KIND_IMAGE:
    case PLR_KIND_RIG:
        same_pictures(e, a);
        break;
    case PLR_KIND_NONE:
        break;
    }
}
