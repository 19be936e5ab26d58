// SPDX-License-Identifier: MIT
/*
 * pelorus-bench [SECONDS_PER_LINE]: what a frame costs, beside a dense textbook EKF on OpenBLAS, in
 * one run, float32, one thread. A frame is predict, gate, update and retract with all N landmarks
 * seen. It reports; it judges nothing.
 */
#define _POSIX_C_SOURCE 200112L
#include <cblas.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "pelorus/pelorus.h"
#include "scene.h"
#include "textbook.h"

/* OpenBLAS's own, which Debian's cblas.h does not declare for every build. */
void openblas_set_num_threads(int threads);

enum { MAX_RUNS = 4000, MIN_RUNS = 9, WARM_UP = 3, TWISTS_A_FRAME = 10, READINGS_A_FRAME = 20 };

static const plr_time_ns TWIST_NS = 1000000, READING_NS = 2500000; /* 400 Hz, 20 frames a second */

typedef struct timing {
    double us[MAX_RUNS];
    unsigned count;
    double total_us;
} timing;

static double now_us(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e6 + (double)t.tv_nsec * 1e-3;
}

static bool wants_more(const timing *t, double budget_us) {
    return t->count < MIN_RUNS || (t->count < MAX_RUNS && t->total_us < budget_us);
}

static void add(timing *t, double us) {
    t->us[t->count++] = us;
    t->total_us += us;
}

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Sorts the times; the share-th of them. */
static double quantile(timing *t, double share) {
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

/* The filter at N landmarks: frames, each with the last step before it, into *frames; that step
 * alone, a twist or a reading of an IMU, into *steps. */
static bool time_filter(unsigned n, plr_process_kind process, double budget_us, timing *frames,
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
            add(frames, end - start);
            add(steps, moved - start);
        }
        if (k > 2 * MAX_RUNS)
            return false; /* the scene does not hold what it promises */
    }
    return true;
}

static bool time_textbook(unsigned n, bool symmetric, double budget_us, timing *updates) {
    textbook t;
    if (!textbook_init(&t, (int)n, symmetric))
        return false;
    updates->count = 0;
    updates->total_us = 0;
    bool good = true;
    for (unsigned k = 0; good && wants_more(updates, budget_us); k++) {
        const double start = now_us();
        good = textbook_update(&t);
        const double end = now_us();
        if (k >= WARM_UP)
            add(updates, end - start);
    }
    textbook_free(&t);
    return good;
}

static const char *const title =
    "%5s | %21s | %9s | %21s | %9s | %21s | %21s | %s\n"
    "%5s | %10s %10s | %9s | %10s %10s | %9s | %10s %10s | %10s %10s | gemm, syrk\n";

int main(int argc, char **argv) {
    static const unsigned sizes[] = {16, 32, 50, 64, 100, 128, 256};
    static timing frames, predicts, by_imu, readings, gain, symmetric;
    const double budget_us = 1e6 * (argc > 1 ? atof(argv[1]) : 1.0);
    openblas_set_num_threads(1);

    printf("pelorus %s, float%d, one thread; a frame with all N landmarks seen, bias on; an IMU at "
           "400 Hz\n",
           plr_version(), PLR_REAL);
    printf(title, "N", "frame by twists, us", "predict", "frame by an IMU, us", "reading",
           "textbook gemm, us", "textbook syrk, us", "faster than", "", "median", "p99", "us",
           "median", "p99", "us", "median", "p99", "median", "p99");
    if (!time_filter(0, PLR_PROCESS_TWIST, 0.1 * budget_us, &frames, &predicts) ||
        !time_filter(0, PLR_PROCESS_IMU, 0.1 * budget_us, &by_imu, &readings))
        return EXIT_FAILURE;
    printf("%5u | %10s %10s | %9.3f | %10s %10s | %9.3f |\n", 0U, "", "", quantile(&predicts, 0.5),
           "", "", quantile(&readings, 0.5));
    for (unsigned i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        const unsigned n = sizes[i];
        if (n > PLR_MAX_LANDMARKS)
            continue;
        if (!time_filter(n, PLR_PROCESS_TWIST, budget_us, &frames, &predicts) ||
            !time_filter(n, PLR_PROCESS_IMU, budget_us, &by_imu, &readings) ||
            !time_textbook(n, false, budget_us, &gain) ||
            !time_textbook(n, true, budget_us, &symmetric)) {
            fprintf(stderr, "pelorus-bench: N = %u could not be run\n", n);
            return EXIT_FAILURE;
        }
        const double own = quantile(&frames, 0.5);
        printf(
            "%5u | %10.1f %10.1f | %9.3f | %10.1f %10.1f | %9.3f | %10.1f %10.1f | %10.1f %10.1f "
            "| %5.1f %5.1f\n",
            n, own, quantile(&frames, 0.99), quantile(&predicts, 0.5), quantile(&by_imu, 0.5),
            quantile(&by_imu, 0.99), quantile(&readings, 0.5), quantile(&gain, 0.5),
            quantile(&gain, 0.99), quantile(&symmetric, 0.5), quantile(&symmetric, 0.99),
            quantile(&gain, 0.5) / own, quantile(&symmetric, 0.5) / own);
        fflush(stdout);
    }
    return EXIT_SUCCESS;
}
