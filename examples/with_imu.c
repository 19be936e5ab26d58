// SPDX-License-Identifier: MIT
/*
 * A stereo camera and an IMU in C: the body stands for two seconds, so that the filter measures its
 * tilt, then drives ahead. The world is made up here; in your program the readings come from the
 * IMU, and the observations from the front end. README says how to compile it.
 */
#include <stdio.h>

#include "pelorus/pelorus.h"

enum { POINTS = 20, IMU_HZ = 200, FRAME_HZ = 10, SECONDS = 8 };

static plr_filter filter; /* all of its memory */

static const plr_calibration camera = {
    .fx_px = 450,
    .fy_px = 450,
    .cx_px = 320,
    .cy_px = 240,
    .baseline_m = 0.12,
    .T_CB = {.R = {0, -1, 0, 0, 0, -1, 1, 0, 0}}}; /* body: forward, left, up */

/* How far ahead the body is at t_s: it rests, gains 1 m/s in two seconds, and goes on. */
static double ahead_m(double t_s, double *a_mps2) {
    const double moving_s = t_s - 2;
    *a_mps2 = moving_s >= 0 && moving_s < 2 ? 0.5 : 0;
    if (moving_s < 0) {
        return 0;
    }
    return moving_s < 2 ? 0.25 * moving_s * moving_s : moving_s - 1;
}

/* What the camera sees of points that stand ahead on both sides, if the body is at x_m. */
static uint16_t look(double x_m, plr_observation *seen) {
    uint16_t count = 0;
    for (unsigned i = 0; i < POINTS; i++) {
        const double depth_m = 10 + 0.5 * i - x_m;
        const double right_m = (i % 2 ? -1 : 1) * (0.5 + 0.1 * i), down_m = 0.1 * (i % 7) - 0.3;
        const double u = camera.cx_px + camera.fx_px * right_m / depth_m;
        const double v = camera.cy_px + camera.fy_px * down_m / depth_m;
        const double disparity = camera.fx_px * camera.baseline_m / depth_m;
        seen[count++] =
            (plr_observation){i, (float)u, (float)v, (float)(u - disparity), (float)v, 0};
    }
    return count;
}

static plr_status drive(void) {
    plr_config config;
    plr_config_default(&config);
    config.process = PLR_PROCESS_IMU; /* and gyro_noise, accel_noise of your part: tools/config */
    plr_status status = plr_filter_init(&filter, &camera, &config, NULL);
    for (unsigned k = 0; status == PLR_OK && k <= SECONDS * IMU_HZ; k++) {
        const double t_s = (double)k / IMU_HZ;
        const plr_time_ns t_ns = (plr_time_ns)k * (1000000000U / IMU_HZ);
        double a_mps2;
        const double x_m = ahead_m(t_s, &a_mps2);
        const plr_imu reading = {{a_mps2, 0, 9.81}, {0, 0, 0.0001 * (k % 3)}};
        status = plr_filter_inertial(&filter, t_ns, &reading);
        if (status == PLR_OK && k % (IMU_HZ / FRAME_HZ) == 0) { /* the frame behind its readings */
            plr_observation seen[POINTS];
            const plr_frame frame = {t_ns, PLR_NO_BUDGET, look(x_m, seen), seen};
            status = plr_filter_update(&filter, &frame, NULL);
        }
    }
    return status;
}

int main(void) {
    plr_pose pose;
    double P[36];
    plr_health_state health;
    plr_status status = drive();
    if (status == PLR_OK) {
        status = plr_filter_pose(&filter, &pose);
    }
    if (status == PLR_OK) {
        status = plr_filter_pose_covariance(&filter, P);
    }
    if (status == PLR_OK) {
        status = plr_filter_health(&filter, plr_filter_time(&filter), &health);
    }
    if (status != PLR_OK) {
        printf("%s\n", plr_status_text(status));
        return 1;
    }
    printf("x = %.2f m, variance %.1e m^2, %s\n", pose.p[0], P[0], plr_health_text(health.health));
    return 0;
}
