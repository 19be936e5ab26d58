// SPDX-License-Identifier: MIT
#include "support/wire_samples.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "pelorus/settings.h"

/* Reals that a careless codec would lose. */
static const double extreme[] = {(double)NAN, (double)INFINITY, -(double)INFINITY, DBL_MAX,
                                 -DBL_MAX,    DBL_MIN,          4.9407e-324,       -0.0,
                                 0.0,         DBL_EPSILON};
static const float extreme_f32[] = {NAN,     INFINITY, -INFINITY, FLT_MAX, -FLT_MAX,
                                    FLT_MIN, 1.4e-45F, -0.0F,     0.0F,    FLT_EPSILON};

enum { EXTREMES = sizeof extreme / sizeof *extreme };

static double real_of(unsigned variant, unsigned i) {
    if (variant == WIRE_SAMPLE_LEAST)
        return 0;
    return variant == WIRE_SAMPLE_MOST ? extreme[i % EXTREMES] : 0.1 * (double)i - 1.7;
}

static float real_of_f32(unsigned variant, unsigned i) {
    if (variant == WIRE_SAMPLE_LEAST)
        return 0;
    return variant == WIRE_SAMPLE_MOST ? extreme_f32[i % EXTREMES] : 0.1F * (float)i - 1.7F;
}

static void fill(double *x, unsigned n, unsigned variant, unsigned first) {
    for (unsigned i = 0; i < n; i++)
        x[i] = real_of(variant, first + i);
}

/* Reals that a float holds. */
static void fill_narrow(double *x, unsigned n, unsigned variant, unsigned first) {
    for (unsigned i = 0; i < n; i++)
        x[i] = (double)real_of_f32(variant, first + i);
}

static uint64_t whole(unsigned variant, uint64_t most, uint64_t common) {
    if (variant == WIRE_SAMPLE_LEAST)
        return 0;
    return variant == WIRE_SAMPLE_MOST ? most : common;
}

static uint32_t whole32(unsigned variant, uint32_t common) {
    return (uint32_t)whole(variant, UINT32_MAX, common);
}

static uint16_t whole16(unsigned variant, uint16_t common) {
    return (uint16_t)whole(variant, UINT16_MAX, common);
}

static uint8_t whole8(unsigned variant, uint8_t most, uint8_t common) {
    return (uint8_t)whole(variant, most, common);
}

static plr_time_ns time_of(unsigned variant) {
    return whole(variant, UINT64_MAX, UINT64_C(1317384506400000001));
}

static void fill_text(char *text, size_t size, unsigned variant) {
    static const char common[] = "d\xC3\xA9j\xC3\xA0 vu";
    memset(text, 0, size);
    if (variant == WIRE_SAMPLE_MOST)
        memset(text, 0xFF, size - 1);
    if (variant == WIRE_SAMPLE_COMMON)
        memcpy(text, common, sizeof common);
}

static void make_header(plr_header *m, unsigned variant) {
    m->version_major = PLR_WIRE_VERSION_MAJOR;
    m->version_minor = PLR_WIRE_VERSION_MINOR;
    m->body_axes = whole8(variant, PLR_AXES_OTHER, PLR_AXES_FRD);
    m->twist_timing = whole8(variant, 2, 1);
    m->image_width_px = whole16(variant, 1226);
    m->image_height_px = whole16(variant, 370);
    double calibration[17], noise[19];
    fill(calibration, 17, variant, 0);
    fill(noise, 19, variant, 17);
    m->calibration.fx_px = calibration[0];
    m->calibration.fy_px = calibration[1];
    m->calibration.cx_px = calibration[2];
    m->calibration.cy_px = calibration[3];
    m->calibration.baseline_m = calibration[4];
    memcpy(m->calibration.T_CB.R, calibration + 5, sizeof m->calibration.T_CB.R);
    memcpy(m->calibration.T_CB.p, calibration + 14, sizeof m->calibration.T_CB.p);
    m->pixel_sigma_px = noise[0];
    m->velocity_sigma_mps = noise[1];
    m->gyro_sigma_radps = noise[2];
    m->bias_velocity_sigma_mps = noise[3];
    m->bias_gyro_sigma_radps = noise[4];
    m->bias_velocity_walk = noise[5];
    m->bias_gyro_walk = noise[6];
    memcpy(m->velocity_sigma_axes_mps, noise + 7, sizeof m->velocity_sigma_axes_mps);
    memcpy(m->gyro_sigma_axes_radps, noise + 10, sizeof m->gyro_sigma_axes_radps);
    m->process = whole8(variant, PLR_PROCESS_IMU, PLR_PROCESS_IMU);
    m->gyro_noise = noise[13];
    m->accel_noise = noise[14];
    m->gyro_walk = noise[15];
    m->accel_walk = noise[16];
    m->bias_accel_sigma_mps2 = noise[17];
    m->gravity_mps2 = noise[18];
    fill_text(m->name, sizeof m->name, variant);
}

static void make_config(plr_config_message *m, unsigned variant) {
    m->build_fingerprint = whole32(variant, 0x12345678);
    m->max_landmarks = whole16(variant, 120);
    m->max_observations = whole16(variant, 256);
    m->block_observations = whole8(variant, UINT8_MAX, 8);
    m->real_bytes = whole8(variant, UINT8_MAX, 4);
    m->count = whole8(variant, PLR_WIRE_MAX_SETTINGS, 5);
    for (unsigned i = 0; i < PLR_WIRE_MAX_SETTINGS; i++) {
        m->settings[i].id = (uint8_t)(255 - i);
        m->settings[i].value = real_of(variant, i);
    }
}

static void make_start(plr_start *m, unsigned variant) {
    m->t_ns = time_of(variant);
    fill(m->T_WB.R, 9, variant, 0);
    fill(m->T_WB.p, 3, variant, 9);
    m->has_covariance = variant == WIRE_SAMPLE_MOST;
    m->has_bias = variant != WIRE_SAMPLE_LEAST;
    fill(m->P_xi, 21, variant, 12);
    fill(m->bias, 6, variant, 33);
    fill(m->bias_variance, 6, variant, 39);
    fill(m->velocity, 3, variant, 45);
    fill(m->velocity_variance, 3, variant, 48);
}

static void make_stereo(plr_frame *m, unsigned variant) {
    static plr_observation observations[WIRE_SAMPLE_VARIANTS][PLR_WIRE_MAX_OBSERVATIONS];
    plr_observation *o = observations[variant];
    m->t_ns = time_of(variant);
    m->budget = whole16(variant, 40);
    m->count = (uint16_t)whole(variant, PLR_WIRE_MAX_OBSERVATIONS, 3);
    m->observations = o;
    for (unsigned i = 0; i < m->count; i++) {
        o[i].id = UINT32_MAX - 7 * i;
        o[i].uL_px = real_of_f32(variant, i);
        o[i].vL_px = real_of_f32(variant, i + 1);
        o[i].uR_px = real_of_f32(variant, i + 2);
        o[i].vR_px = real_of_f32(variant, i + 5);
        o[i].sigma_px = real_of_f32(variant, i + 3);
    }
    const uint32_t signalling = 0x7F800001; /* a NaN that a conversion would change */
    if (variant == WIRE_SAMPLE_MOST)
        memcpy(&o[1].vL_px, &signalling, sizeof signalling);
}

static void make_truth(plr_truth *m, unsigned variant) {
    m->t_ns = time_of(variant);
    fill(m->T_WB.R, 9, variant, 0);
    fill(m->T_WB.p, 3, variant, 9);
    fill(m->v_B_mps, 3, variant, 12);
    fill(m->bias, 6, variant, 15);
    m->knows = whole8(variant, UINT8_MAX, PLR_TRUTH_BIAS);
}

static void make_landmark(plr_landmark_message *m, unsigned variant) {
    m->role = whole8(variant, PLR_LANDMARK_FINAL, PLR_LANDMARK_EVICTED);
    m->landmark.last_seen_ns = time_of(variant);
    m->landmark.id = whole32(variant, 4711);
    m->landmark.times_seen = whole32(variant, 12);
    m->landmark.known = m->role == PLR_LANDMARK_KNOWN;
    fill(m->landmark.p_W_m, 3, variant, 0);
    double packed[6], *P = m->landmark.P_W_m2;
    fill(packed, 6, variant, 3);
    P[0] = packed[0];
    P[1] = P[3] = packed[1];
    P[4] = packed[2];
    P[2] = P[6] = packed[3];
    P[5] = P[7] = packed[4];
    P[8] = packed[5];
}

/* The least one in float64, the others in float32. */
static void make_pose(plr_pose_message *m, unsigned variant) {
    m->t_ns = time_of(variant);
    m->real_bytes = variant == WIRE_SAMPLE_LEAST ? 8 : 4;
    m->after_update = variant != WIRE_SAMPLE_LEAST;
    m->reset_count = whole16(variant, 2);
    fill(m->T_WB.p, 3, variant, 3);
    fill_narrow(m->T_WB.R, 9, variant, 0);
    fill_narrow(m->P_xi, 21, variant, 9);
    fill_narrow(m->velocity.v_B_mps, 3, variant, 30);
    fill_narrow(m->velocity.w_B_radps, 3, variant, 33);
    fill_narrow(m->bias, 6, variant, 36);
    fill_narrow(m->P_u, 21, variant, 42);
    m->trace = real_of(variant, 6);
    fill_narrow(m->bias_variance, 6, variant, 63);
}

static void make_reading(plr_reading *m, unsigned variant) {
    m->t_ns = time_of(variant);
    m->sensor = whole8(variant, UINT8_MAX, PLR_SENSOR_POSITION);
    m->axes = whole8(variant, UINT8_MAX, 5);
    fill(m->value, 3, variant, 2);
    fill_narrow(m->sigma, 3, variant, 5);
    fill_narrow(m->at_B_m, 3, variant, 8);
}

static void make_imu(plr_imu_message *m, unsigned variant) {
    m->t_ns = time_of(variant);
    m->period_ns = whole32(variant, 2500000);
    m->count = variant == WIRE_SAMPLE_LEAST ? 1 : whole8(variant, PLR_WIRE_MAX_IMU, 3);
    for (unsigned i = 0; i < m->count; i++) {
        fill_narrow(m->readings[i].a_B_mps2, 3, variant, 6 * i);
        fill_narrow(m->readings[i].w_B_radps, 3, variant, 6 * i + 3);
    }
}

static void make_state(plr_state_message *m, unsigned variant) {
    m->t_ns = time_of(variant);
    m->action = variant == WIRE_SAMPLE_LEAST ? PLR_STATE_SAVE : (uint8_t)PLR_STATE_RESTORE;
    fill(m->moved_variance, 6, variant, 0);
}

static void make_report(plr_report_message *m, unsigned variant) {
    plr_report *r = &m->report;
    m->subject = whole8(variant, UINT8_MAX, PLR_KIND_STEREO);
    m->update_us = whole32(variant, 310);
    m->notice = whole8(variant, UINT8_MAX, PLR_NOTICE_RESTORED);
    r->t_ns = time_of(variant);
    r->status = variant == WIRE_SAMPLE_LEAST ? PLR_OK : PLR_E_LATE;
    if (variant == WIRE_SAMPLE_MOST)
        r->status = PLR_E_SIZE;
    r->health = variant == WIRE_SAMPLE_LEAST  ? PLR_HEALTH_GOOD
                : variant == WIRE_SAMPLE_MOST ? PLR_HEALTH_DIVERGED
                                              : PLR_HEALTH_DEGRADED;
    r->reasons = whole32(variant, PLR_REASON_STATE_DAMAGED | PLR_REASON_FEW_OBSERVATIONS);
    r->budget = whole16(variant, 100);
    r->observations = whole16(variant, 101);
    r->matched = whole16(variant, 102);
    r->used = whole16(variant, 103);
    r->gated = whole16(variant, 104);
    r->created = whole16(variant, 105);
    r->evicted = whole16(variant, 106);
    r->refused = whole16(variant, 107);
    r->duplicates = whole16(variant, 108);
    r->no_room = whole16(variant, 109);
    r->poor = whole16(variant, 110);
    r->left_out = whole16(variant, 111);
    r->blocks_failed = whole16(variant, 112);
    r->active = whole16(variant, 113);
    r->nis_dof = whole16(variant, 114);
    r->nis = real_of_f32(variant, 3);
    r->innovation_rows = whole16(variant, 115);
    r->innovation_d2 = real_of_f32(variant, 4);
    r->innovation_log_det = real_of_f32(variant, 5);
}

static void make_evidence(plr_supervision *m, unsigned variant) {
    m->t_ns = time_of(variant);
    float *const numbers[] = {m->nu,         m->moved,   &m->statistic, m->usual,
                              &m->agreement, &m->weight, m->difference};
    static const unsigned sizes[] = {6, 6, 1, 6, 1, 1, 6};
    for (unsigned i = 0; i < sizeof sizes / sizeof sizes[0]; i++)
        for (unsigned j = 0; j < sizes[i]; j++)
            numbers[i][j] = real_of_f32(variant, 10 * i + j);
    m->doubt = whole8(variant, PLR_DOUBT_SETTLING, PLR_DOUBT_CONTRADICTED);
    m->applied = m->waits = m->locked = m->misfits = variant != WIRE_SAMPLE_LEAST;
    m->outright = m->holds_biases = m->frozen = m->settled = variant == WIRE_SAMPLE_MOST;
    m->matched = whole16(variant, 40);
    m->same = whole16(variant, 41);
    m->known = whole16(variant, 42);
    m->adopted = whole16(variant, 43);
    m->count = whole8(variant, PLR_SUPERVISION_REJECTED, 3);
    for (unsigned i = 0; i < m->count; i++) {
        m->rejected[i].id = whole32(variant, 80U + i);
        m->rejected[i].why = whole8(variant, PLR_REJECTED_MOVES, PLR_REJECTED_FAR);
        m->rejected[i].in_succession = whole16(variant, (uint16_t)(44 + i));
        m->rejected[i].mean2 = real_of_f32(variant, 90U + i);
    }
}

static void make_calibration(plr_calibration_result *m, unsigned variant) {
    m->t_ns = time_of(variant);
    m->estimated = whole16(variant, 1 << PLR_FOCAL_LENGTH);
    fill(&m->camera.fx_px, 5, variant, 0);
    fill(m->camera.T_CB.R, 9, variant, 5);
    fill(m->camera.T_CB.p, 3, variant, 14);
    for (unsigned i = 0; i < PLR_CALIBRATION_ERRORS; i++) {
        m->corrected[i] = (double)real_of_f32(variant, i);
        m->sigma[i] = (double)real_of_f32(variant, 20 + i);
    }
}

static void make_image(plr_image_message *m, unsigned variant) {
    static const uint8_t pixels[PLR_WIRE_IMAGE_PIXELS] = {0, 255, 0, 0, 17};
    m->t_ns = time_of(variant);
    m->side = whole8(variant, PLR_SIDE_RIGHT, PLR_SIDE_RIGHT);
    m->width_px = whole16(variant, 160);
    m->height_px = whole16(variant, 120);
    m->first_px = whole32(variant, 320);
    m->count = variant == WIRE_SAMPLE_LEAST  ? 1
               : variant == WIRE_SAMPLE_MOST ? PLR_WIRE_IMAGE_PIXELS
                                             : 160;
    m->pixels = pixels;
}

static void make_lens(plr_lens *m, unsigned variant, unsigned seed) {
    m->model = whole8(variant, PLR_LENS_EQUIDISTANT, PLR_LENS_RADTAN);
    m->width_px = whole16(variant, 752);
    m->height_px = whole16(variant, 480);
    fill(&m->fx_px, 4, variant, seed);
    fill(m->k, 8, variant, seed + 4);
}

static void make_rig(plr_rig *m, unsigned variant) {
    make_lens(&m->left, variant, 0);
    make_lens(&m->right, variant, 12);
    fill(m->T_RL.R, 9, variant, 24);
    fill(m->T_RL.p, 3, variant, 33);
    fill(&m->row_time_s, 1, variant, 36);
    m->disparity_max_px = whole16(variant, 80);
    m->tracks = whole16(variant, 50);
}

static void make_text(plr_text *m, unsigned variant) {
    m->severity = whole8(variant, PLR_SEVERITY_ERROR, PLR_SEVERITY_WARNING);
    fill_text(m->text, sizeof m->text, variant);
}

static void make_twist(plr_twist_message *m, unsigned variant) {
    m->t_ns = time_of(variant);
    fill(m->twist.v_B_mps, 3, variant, 0);
    fill(m->twist.w_B_radps, 3, variant, 3);
}

static void make_end(plr_end *m, unsigned variant) {
    m->differs = whole8(variant, UINT8_MAX, 1U << PLR_COUNTED_READING);
    for (unsigned i = 0; i < PLR_COUNTED; i++)
        m->arrived[i] = whole32(variant, 70 + i);
}

static void make_pictures(plr_message *m, unsigned variant) {
    if (m->kind == PLR_KIND_IMAGE)
        make_image(&m->as.image, variant);
    else
        make_rig(&m->as.rig, variant);
}

plr_message wire_sample(plr_kind kind, unsigned variant) {
    plr_message m = {.kind = kind};
    switch (kind) {
    case PLR_KIND_HEADER:
        make_header(&m.as.header, variant);
        break;
    case PLR_KIND_CONFIG:
        make_config(&m.as.config, variant);
        break;
    case PLR_KIND_START:
        make_start(&m.as.start, variant);
        break;
    case PLR_KIND_TWIST:
        make_twist(&m.as.twist, variant);
        break;
    case PLR_KIND_STEREO:
        make_stereo(&m.as.stereo, variant);
        break;
    case PLR_KIND_TRUTH:
        make_truth(&m.as.truth, variant);
        break;
    case PLR_KIND_LANDMARK:
        make_landmark(&m.as.landmark, variant);
        break;
    case PLR_KIND_POSE:
        make_pose(&m.as.pose, variant);
        break;
    case PLR_KIND_REPORT:
        make_report(&m.as.report, variant);
        break;
    case PLR_KIND_CALIBRATION:
        make_calibration(&m.as.calibration, variant);
        break;
    case PLR_KIND_EVIDENCE:
        make_evidence(&m.as.evidence, variant);
        break;
    case PLR_KIND_TEXT:
        make_text(&m.as.text, variant);
        break;
    case PLR_KIND_STATE:
        make_state(&m.as.state, variant);
        break;
    case PLR_KIND_READING:
        make_reading(&m.as.reading, variant);
        break;
    case PLR_KIND_IMU:
        make_imu(&m.as.imu, variant);
        break;
    case PLR_KIND_IMAGE:
    case PLR_KIND_RIG:
        make_pictures(&m, variant);
        break;
    case PLR_KIND_END:
        make_end(&m.as.end, variant);
        break;
    case PLR_KIND_NONE:
        break;
    }
    return m;
}
