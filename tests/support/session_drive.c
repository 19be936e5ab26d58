// SPDX-License-Identifier: MIT
#include "support/session_drive.h"

#include <math.h>
#include <string.h>

#include "pelorus/settings.h"
#include "support/random.h"

static const double SPEED = 1, RATE = 0.2, GRAVITY = 9.81;
static const double FOCAL = 320, CENTRE_X = 320, CENTRE_Y = 240, BASELINE = 0.25;

plr_time_ns drive_time_ns(double t_s) {
    return DRIVE_START_NS + (plr_time_ns)llround(t_s * 1e9);
}

plr_message drive_header(void) {
    static const double R_CB[9] = {0, -1, 0, 0, 0, -1, 1, 0, 0};
    plr_message m;
    memset(&m, 0, sizeof m);
    m.kind = PLR_KIND_HEADER;
    plr_header *h = &m.as.header;
    h->body_axes = PLR_AXES_FLU;
    h->twist_timing = PLR_TWIST_START;
    h->calibration = (plr_calibration){.fx_px = FOCAL,
                                       .fy_px = FOCAL,
                                       .cx_px = CENTRE_X,
                                       .cy_px = CENTRE_Y,
                                       .baseline_m = BASELINE};
    memcpy(h->calibration.T_CB.R, R_CB, sizeof R_CB);
    h->pixel_sigma_px = h->velocity_sigma_mps = h->gyro_sigma_radps = -1;
    h->bias_velocity_sigma_mps = h->bias_gyro_sigma_radps = -1;
    h->bias_velocity_walk = h->bias_gyro_walk = -1;
    h->gyro_noise = h->accel_noise = h->gyro_walk = h->accel_walk = -1;
    h->bias_accel_sigma_mps2 = h->gravity_mps2 = -1;
    strcpy(h->name, "circle");
    return m;
}

plr_pose drive_pose(double t_s) {
    const double a = RATE * t_s, radius = SPEED / RATE;
    return (plr_pose){.R = {cos(a), -sin(a), 0, sin(a), cos(a), 0, 0, 0, 1},
                      .p = {radius * sin(a), radius * (1 - cos(a)), 0}};
}

plr_message drive_twist(double t_s) {
    plr_message m;
    memset(&m, 0, sizeof m);
    m.kind = PLR_KIND_TWIST;
    m.as.twist.t_ns = drive_time_ns(t_s);
    m.as.twist.twist.v_B_mps[0] = SPEED;
    m.as.twist.twist.w_B_radps[2] = RATE;
    return m;
}

/* No sensor gives the same numbers again and again. */
static double whisper(double t_s, unsigned i) {
    return 1e-3 * sin(1e3 * t_s + 2 * i);
}

plr_message drive_imu(double t_s, unsigned count, double period_s) {
    plr_message m;
    memset(&m, 0, sizeof m);
    m.kind = PLR_KIND_IMU;
    m.as.imu.t_ns = drive_time_ns(t_s);
    m.as.imu.period_ns = count > 1 ? (uint32_t)llround(period_s * 1e9) : 0;
    m.as.imu.count = (uint8_t)count;
    for (unsigned k = 0; k < count; k++) {
        const double at_s = t_s + k * period_s;
        plr_imu *reading = &m.as.imu.readings[k];
        for (unsigned i = 0; i < 3; i++) {
            reading->a_B_mps2[i] = whisper(at_s, i);
            reading->w_B_radps[i] = whisper(at_s, 3 + i);
        }
        reading->a_B_mps2[1] += SPEED * RATE;
        reading->a_B_mps2[2] += GRAVITY;
        reading->w_B_radps[2] += RATE;
    }
    return m;
}

plr_message drive_truth(double t_s) {
    plr_message m;
    memset(&m, 0, sizeof m);
    m.kind = PLR_KIND_TRUTH;
    m.as.truth.t_ns = drive_time_ns(t_s);
    m.as.truth.T_WB = drive_pose(t_s);
    return m;
}

static void landmark_position(double p_W[3], uint32_t id) {
    rng r = rng_seeded(1000 + id);
    const double angle = rng_uniform(&r, 0, 6.283185307179586), range = rng_uniform(&r, 7, 20);
    p_W[0] = range * cos(angle);
    p_W[1] = 5 + range * sin(angle);
    p_W[2] = rng_uniform(&r, -3, 3);
}

/* False if the landmark is out of view. */
static bool observe(plr_observation *o, const plr_pose *T_WB, uint32_t id) {
    double p_W[3], s[3];
    landmark_position(p_W, id);
    for (int i = 0; i < 3; i++) {
        s[i] = 0;
        for (int j = 0; j < 3; j++)
            s[i] += T_WB->R[3 * j + i] * (p_W[j] - T_WB->p[j]);
    }
    const double x = -s[1], y = -s[2], z = s[0];
    if (z < 2 || fabs(x) > 0.9 * z || fabs(y) > 0.7 * z)
        return false;
    o->id = id;
    o->uL_px = (float)(FOCAL * x / z + CENTRE_X);
    o->uR_px = (float)(FOCAL * (x - BASELINE) / z + CENTRE_X);
    o->vL_px = o->vR_px = (float)(FOCAL * y / z + CENTRE_Y);
    return true;
}

plr_message drive_stereo(double t_s) {
    static plr_observation seen[DRIVE_MOST_SEEN];
    const plr_pose T_WB = drive_pose(t_s);
    plr_message m;
    memset(&m, 0, sizeof m);
    m.kind = PLR_KIND_STEREO;
    m.as.stereo.t_ns = drive_time_ns(t_s);
    m.as.stereo.budget = PLR_NO_BUDGET;
    m.as.stereo.observations = seen;
    for (uint32_t id = 0; id < DRIVE_LANDMARKS && m.as.stereo.count < DRIVE_MOST_SEEN; id++)
        if (observe(&seen[m.as.stereo.count], &T_WB, id))
            m.as.stereo.count++;
    return m;
}

plr_message drive_known(uint32_t id, double sigma_m) {
    plr_message m;
    memset(&m, 0, sizeof m);
    m.kind = PLR_KIND_LANDMARK;
    m.as.landmark.role = PLR_LANDMARK_KNOWN;
    m.as.landmark.landmark.id = id;
    landmark_position(m.as.landmark.landmark.p_W_m, id);
    for (int i = 0; i < 3; i++)
        m.as.landmark.landmark.P_W_m2[4 * i] = sigma_m * sigma_m;
    return m;
}

plr_message drive_config(const char *name, double value) {
    plr_message m;
    memset(&m, 0, sizeof m);
    m.kind = PLR_KIND_CONFIG;
    m.as.config.count = 1;
    m.as.config.settings[0].id = plr_setting_by_name(name)->id;
    m.as.config.settings[0].value = value;
    return m;
}

plr_message drive_start(double t_s) {
    plr_message m;
    memset(&m, 0, sizeof m);
    m.kind = PLR_KIND_START;
    m.as.start.t_ns = drive_time_ns(t_s);
    m.as.start.T_WB = drive_pose(t_s);
    m.as.start.velocity[0] = SPEED;
    for (unsigned i = 0; i < 3; i++)
        m.as.start.velocity_variance[i] = 1e-4;
    return m;
}
