// SPDX-License-Identifier: MIT
#define _POSIX_C_SOURCE 200112L
#include "timing.h"

#include <stdlib.h>
#include <time.h>

#include "scene.h"

enum { TWISTS_A_FRAME = 10, READINGS_A_FRAME = 20 };

static const plr_time_ns TWIST_NS = 1000000, READING_NS = 2500000; /* 400 Hz, 20 frames a second */

double now_us(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e6 + (double)t.tv_nsec * 1e-3;
}

bool wants_more(const timing *t, double budget_us) {
    return t->count < MIN_RUNS || (t->count < MAX_RUNS && t->total_us < budget_us);
}

void add_run(timing *t, double us) {
    t->us[t->count++] = us;
    t->total_us += us;
}

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double quantile(timing *t, double share) {
    qsort(t->us, t->count, sizeof *t->us, ascending);
    return t->us[(unsigned)(share * (double)(t->count - 1))];
}

static bool begin(plr_filter *filter, const scene *world, plr_process_kind process) {
    static const plr_pose origin = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    static const double variance[3] = {1e-4, 1e-4, 1e-4};
    plr_config config;
    double v[3];
    plr_config_default(&config);
    config.slots = (uint16_t)(world->count > 0 ? world->count : 1);
    config.bias = 1;
    config.mode = world->count > 0 ? PLR_MODE_SLAM : PLR_MODE_DEAD_RECKONING;
    config.pixel_sigma_px = 1;
    config.process = (uint8_t)process;
    if (plr_filter_init(filter, &world->calibration, &config, NULL) != PLR_OK)
        return false;
    if (process == PLR_PROCESS_TWIST)
        return true;
    const plr_time_ns t_ns = scene_time(world, 0) - READINGS_A_FRAME * READING_NS;
    scene_velocity(world, t_ns, v);
    return plr_filter_set_pose(filter, t_ns, &origin, NULL) == PLR_OK &&
           plr_filter_set_velocity(filter, v, variance) == PLR_OK;
}

/* What comes between frames k - 1 and k; the last one falls on the frame. Returns when that began,
 * and in *ended when it ended; negative if one was refused. */
static double move(plr_filter *filter, scene *world, plr_process_kind process, unsigned k,
                   double *ended) {
    const bool by_imu = process == PLR_PROCESS_IMU;
    const plr_time_ns t_ns = scene_time(world, k), step_ns = by_imu ? READING_NS : TWIST_NS;
    double started = -1;
    for (unsigned i = by_imu ? READINGS_A_FRAME : TWISTS_A_FRAME; i-- > 0;) {
        plr_twist twist;
        plr_imu imu;
        if (by_imu)
            scene_imu(world, t_ns - i * step_ns, &imu);
        else
            scene_twist(world, k, &twist);
        started = now_us();
        const plr_status status = by_imu ? plr_filter_inertial(filter, t_ns - i * step_ns, &imu)
                                         : plr_filter_predict(filter, t_ns - i * step_ns, &twist);
        *ended = now_us();
        if (status != PLR_OK)
            return -1;
    }
    return started;
}

bool time_filter(unsigned n, plr_process_kind process, double budget_us, timing *frames,
                 timing *steps) {
    static plr_filter filter;
    static scene world;
    scene_init(&world, n);
    if (!begin(&filter, &world, process))
        return false;
    frames->count = steps->count = 0;
    frames->total_us = steps->total_us = 0;
    for (unsigned k = 0; wants_more(frames, budget_us); k++) {
        plr_frame frame;
        plr_report report;
        double moved = 0;
        scene_frame(&world, k, &frame);
        const double start = move(&filter, &world, process, k, &moved);
        if (start < 0 || plr_filter_update(&filter, &frame, &report) != PLR_OK)
            return false;
        const double end = now_us();
        const bool all_seen = n == 0 || report.matched == n;
        if (k >= WARM_UP && all_seen) {
            add_run(frames, end - start);
            add_run(steps, moved - start);
        }
        if (k > 2 * MAX_RUNS)
            return false; /* the scene does not hold what it promises */
    }
    return true;
}
