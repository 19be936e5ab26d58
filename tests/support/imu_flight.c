// SPDX-License-Identifier: MIT
#include "support/imu_flight.h"

#include <math.h>
#include <string.h>

#include "support/rigid.h"
#include "support/scene.h"

void imu_flight_options_default(imu_flight_options *options) {
    memset(options, 0, sizeof *options);
    options->seed = 1;
    options->rate_hz = 400;
    options->swing = 1;
    options->gyro_noise = 1e-3;
    options->accel_noise = 1e-2;
    options->gyro_walk = 1e-4;
    options->accel_walk = 1e-3;
    options->bias_accel_sigma = 0.05;
    options->bias_gyro_sigma = 0.005;
    options->pixel_sigma_px = 1;
    options->most_seen = 40;
    options->gravity_mps2 = 9.81;
}

/* Time along the path: it stands for rest_s, and gathers speed in the two seconds after that. */
static double along(const imu_flight_options *is, double t) {
    const double since = t - 1 - is->rest_s;
    if (is->ahead_s > 0)
        return t - 1 + is->ahead_s;
    if (since <= 0)
        return 0;
    if (since >= 2)
        return since - 1;
    const double x = since / 2; /* the integral of a smooth step of two seconds */
    return 2 * (x * x * x * x * x * x - 3 * x * x * x * x * x + 2.5 * x * x * x * x);
}

/* The path: R = Rz(yaw) Ry(pitch) Rx(roll), and the position. */
static void pose_at(const imu_flight_options *is, double t, double T[16]) {
    const double s = along(is, t), turns = is->swing * s;
    const double yaw = 0.9 * sin(0.45 * turns) + 0.2 * s, pitch = 0.25 * sin(0.8 * turns);
    const double roll = 0.2 * sin(1.1 * turns);
    const double cy = cos(yaw), sy = sin(yaw), cp = cos(pitch), sp = sin(pitch);
    const double cr = cos(roll), sr = sin(roll);
    const double pose[16] = {cy * cp,
                             cy * sp * sr - sy * cr,
                             cy * sp * cr + sy * sr,
                             2.5 * sin(0.6 * s),
                             sy * cp,
                             sy * sp * sr + cy * cr,
                             sy * sp * cr - cy * sr,
                             2 * sin(0.8 * s + 0.4) - 2 * sin(0.4),
                             -sp,
                             cp * sr,
                             cp * cr,
                             0.6 * sin(1.3 * s),
                             0,
                             0,
                             0,
                             1};
    memcpy(T, pose, sizeof pose);
}

static double seconds(plr_time_ns t_ns) {
    return (double)t_ns * 1e-9;
}

void imu_flight_truth(const imu_flight *s, double T_WB[16], double v_B[3]) {
    const double t = seconds(s->t_ns), h = 1e-4;
    double ahead[16], behind[16];
    pose_at(&s->is, t, T_WB);
    pose_at(&s->is, t + h, ahead);
    pose_at(&s->is, t - h, behind);
    for (int i = 0; i < 3; i++) {
        v_B[i] = 0;
        for (int j = 0; j < 3; j++)
            v_B[i] += T_WB[4 * j + i] * (ahead[4 * j + 3] - behind[4 * j + 3]) / (2 * h);
    }
}

/* Angular rate and specific force in body axes. */
static void true_reading(const imu_flight *s, double a[3], double w[3]) {
    const double t = seconds(s->t_ns), h = 1e-3;
    double here[16], ahead[16], behind[16], change[9] = {0};
    pose_at(&s->is, t, here);
    pose_at(&s->is, t + h, ahead);
    pose_at(&s->is, t - h, behind);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                change[3 * i + j] += behind[4 * k + i] * ahead[4 * k + j];
    const double turn[3] = {change[7] - change[5], change[2] - change[6], change[3] - change[1]};
    for (int i = 0; i < 3; i++) {
        w[i] = turn[i] / (4 * h);
        a[i] = 0;
        for (int j = 0; j < 3; j++) {
            const double second =
                (ahead[4 * j + 3] - 2 * here[4 * j + 3] + behind[4 * j + 3]) / (h * h);
            a[i] += here[4 * j + i] * (second + (j == 2 ? s->is.gravity_mps2 : 0));
        }
    }
}

void imu_flight_start(imu_flight *s, const imu_flight_options *options) {
    memset(s, 0, sizeof *s);
    s->is = *options;
    s->chance = rng_seeded(options->seed);
    scene_calibration(&s->calibration);
    s->t_ns = 1000000000;
    s->next_id = 1;
    rng_normals(&s->chance, options->bias_accel_sigma, s->bias, 3);
    rng_normals(&s->chance, options->bias_gyro_sigma, s->bias + 3, 3);
    for (unsigned i = 0; i < IMU_FLIGHT_POINTS; i++) {
        double direction[3], length = 0;
        rng_normals(&s->chance, 1, direction, 3);
        for (int k = 0; k < 3; k++)
            length += direction[k] * direction[k];
        const double range = rng_uniform(&s->chance, 5, 14) / sqrt(length);
        for (int k = 0; k < 3; k++)
            s->p_W[i][k] = range * direction[k] * (k == 2 ? 0.5 : 1);
    }
}

plr_imu imu_flight_read(imu_flight *s) {
    plr_imu imu;
    double a[3], w[3];
    const double root = sqrt(s->is.rate_hz);
    true_reading(s, a, w);
    for (int i = 0; i < 3; i++) {
        imu.a_B_mps2[i] = a[i] + s->bias[i] + s->is.accel_noise * root * rng_normal(&s->chance);
        imu.w_B_radps[i] = w[i] + s->bias[3 + i] + s->is.gyro_noise * root * rng_normal(&s->chance);
    }
    return imu;
}

void imu_flight_move(imu_flight *s) {
    const double root = sqrt(1 / s->is.rate_hz);
    s->t_ns += (plr_time_ns)(1e9 / s->is.rate_hz + 0.5);
    for (int i = 0; i < 3; i++) {
        s->bias[i] += s->is.accel_walk * root * rng_normal(&s->chance);
        s->bias[3 + i] += s->is.gyro_walk * root * rng_normal(&s->chance);
    }
}

/* A point in the picture, 640 x 480, without noise; false if it is not in both. */
static bool project(const imu_flight *s, const double T_CW[16], unsigned i, double pixels[4]) {
    const plr_calibration *c = &s->calibration;
    double q[3];
    rigid_apply(q, T_CW, s->p_W[i]);
    if (q[2] < 0.5)
        return false;
    pixels[0] = c->fx_px * q[0] / q[2] + c->cx_px;
    pixels[2] = c->fx_px * (q[0] - c->baseline_m) / q[2] + c->cx_px;
    pixels[1] = pixels[3] = c->fy_px * q[1] / q[2] + c->cy_px;
    return pixels[2] > 0 && pixels[0] < 2 * c->cx_px && pixels[1] > 0 && pixels[1] < 2 * c->cy_px;
}

plr_frame imu_flight_look(imu_flight *s) {
    double T_WB[16], v[3], T_BW[16], T_CB[16], T_CW[16];
    unsigned count = 0;
    imu_flight_truth(s, T_WB, v);
    rigid_inverse(T_BW, T_WB);
    rigid_from_pose(T_CB, &s->calibration.T_CB);
    square_multiply(4, T_CB, T_BW, T_CW);
    for (unsigned i = 0; i < IMU_FLIGHT_POINTS; i++) {
        double pixels[4];
        const bool sees = count < s->is.most_seen && project(s, T_CW, i, pixels);
        if (sees && !s->in_sight[i])
            s->id[i] = s->next_id++;
        s->in_sight[i] = sees;
        if (!sees)
            continue;
        const double sigma = s->is.pixel_sigma_px;
        plr_observation *o = &s->seen[count++];
        o->id = s->id[i];
        o->uL_px = (float)(pixels[0] + sigma * rng_normal(&s->chance));
        o->vL_px = (float)(pixels[1] + sigma * rng_normal(&s->chance));
        o->uR_px = (float)(pixels[2] + sigma * rng_normal(&s->chance));
        o->vR_px = (float)(pixels[3] + sigma * rng_normal(&s->chance));
    }
    const plr_frame frame = {s->t_ns, PLR_NO_BUDGET, (uint16_t)count, s->seen};
    return frame;
}
