// SPDX-License-Identifier: MIT
#include "floor.h"

#include <stdio.h>
#include <stdlib.h>

#include "math/packed.h"
#include "timing.h"

/* Independent sums: more than the processor needs to begin one multiply-add after the other, and no more than
 * its registers hold. */
enum { CHAINS = 12, WIDTH = 8, STEPS = 20000, ROUNDS = 60 };
enum { BEFORE_LANDMARKS = PLR_POSE_DIM + PLR_BIAS_DIM };
enum { LD = (PLR_MAX_STATE + 15) / 16 * 16, DEPTH = PLR_BLOCK_ROWS };

static plr_real P[PLR_PACKED_SIZE + PLR_KERNEL_MARGIN], Vt[DEPTH * LD + PLR_KERNEL_MARGIN];
static volatile plr_real seen; /* so that nothing is optimised away */

static double least(double a, double b) {
    return a < b ? a : b;
}

/* Multiply-adds a nanosecond, all numbers in registers. */
static double peak_gfma(void) {
    double best_us = 1e30;
    for (unsigned round = 0; round < ROUNDS; round++) {
        plr_real sum[CHAINS][WIDTH], w[WIDTH], u = PLR_R(1e-3) * (plr_real)(round + 1);
        for (unsigned i = 0; i < WIDTH; i++)
            w[i] = PLR_R(1e-3) * (plr_real)i;
        for (unsigned c = 0; c < CHAINS; c++)
            for (unsigned i = 0; i < WIDTH; i++)
                sum[c][i] = (plr_real)c;
        const double start = now_us();
        for (unsigned k = 0; k < STEPS; k++)
            for (unsigned c = 0; c < CHAINS; c++)
                for (unsigned i = 0; i < WIDTH; i++)
                    sum[c][i] = PLR_FMA(sum[c][i], u, w[i]);
        best_us = least(best_us, now_us() - start);
        for (unsigned c = 0; c < CHAINS; c++)
            for (unsigned i = 0; i < WIDTH; i++)
                seen = sum[c][i];
    }
    return 1e-3 * CHAINS * WIDTH * STEPS / best_us;
}

/* Bytes a nanosecond, read and written, as a P of n rows is changed in place. */
static double bandwidth_gbps(unsigned n) {
    const size_t size = plr_packed_row(n), passes = 1 + ((size_t)1 << 20) / size;
    double best_us = 1e30;
    for (unsigned round = 0; round < ROUNDS; round++) {
        const double start = now_us();
        for (size_t pass = 0; pass < passes; pass++) {
            for (size_t i = 0; i < size; i++)
                P[i] = PLR_FMA(P[i], PLR_R(0.5), PLR_R(1));
            seen = P[pass];
        }
        best_us = least(best_us, now_us() - start);
    }
    return 1e-3 * 2 * (double)(passes * size * sizeof *P) / best_us;
}

/* The downdate of a frame, n rows, in batches: the least time. */
static double downdate_us(unsigned n, unsigned depth, double budget_us) {
    const unsigned batches = (depth + DEPTH - 1) / DEPTH;
    static timing runs;
    runs.count = 0;
    runs.total_us = 0;
    for (size_t i = 0; i < plr_packed_row(n); i++)
        P[i] = 1;
    for (size_t i = 0; i < sizeof Vt / sizeof *Vt; i++)
        Vt[i] = PLR_R(1e-6) * (plr_real)(i % 7);
    while (wants_more(&runs, budget_us)) {
        const double start = now_us();
        for (unsigned at = 0, left = batches; left > 0; left--) {
            const unsigned rows = (depth / PLR_ROWS - at + left - 1) / left;
            plr_packed_subtract(n, PLR_ROWS * rows, Vt, Vt, LD, P);
            at += rows;
        }
        add_run(&runs, now_us() - start);
    }
    return quantile(&runs, 0);
}

int beside_floor(double seconds) {
    static const unsigned sizes[] = {20, 32, 50, 100, 200, 256};
    static timing frames, steps;
    const double budget_us = 1e6 * seconds, peak = peak_gfma();
    printf("Peak of this build's vectors: %.1f billion fused multiply-adds a second. Times are the "
           "least, us.\n\n"
           "| N | multiply-adds | bandwidth, GB/s | floor | downdate | frame by twists | / floor | "
           "frame by an IMU "
           "| / floor |\n|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n",
           peak);
    for (unsigned i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        const unsigned landmarks = sizes[i], n = BEFORE_LANDMARKS + PLR_LANDMARK_DIM * landmarks;
        if (landmarks > PLR_MAX_LANDMARKS)
            continue;
        const unsigned depth = PLR_ROWS * landmarks, batches = (depth + DEPTH - 1) / DEPTH;
        const double size = (double)plr_packed_row(n), bandwidth = bandwidth_gbps(n);
        const double at_peak_us = 1e-3 * size * depth / peak;
        const double moved_us = 1e-3 * 2 * size * sizeof *P * batches / bandwidth;
        const double floor_us = at_peak_us > moved_us ? at_peak_us : moved_us;
        const double downdate = downdate_us(n, depth, budget_us);
        if (!time_filter(landmarks, PLR_PROCESS_TWIST, budget_us, &frames, &steps))
            return EXIT_FAILURE;
        const double by_twists = quantile(&frames, 0);
        if (!time_filter(landmarks, PLR_PROCESS_IMU, budget_us, &frames, &steps))
            return EXIT_FAILURE;
        const double by_imu = quantile(&frames, 0);
        printf("| %u | %.2f M | %.1f | %.1f | %.1f | %.1f | %.2f | %.1f | %.2f |\n", landmarks,
               1e-6 * size * depth, bandwidth, floor_us, downdate, by_twists, by_twists / floor_us,
               by_imu, by_imu / floor_us);
        fflush(stdout);
    }
    return EXIT_SUCCESS;
}
