// SPDX-License-Identifier: MIT
/*
 * What a frame costs, float32, one thread. A frame is predict, gate, update and retract with all N landmarks
 * seen. It reports; it judges nothing.
 *
 * pelorus-bench [SECONDS_PER_LINE]          beside a dense textbook EKF on OpenBLAS, in one run
 * pelorus-bench --floor [SECONDS_PER_LINE]  beside what the machine needs for the multiply-adds alone
 * pelorus-bench --count N twist|imu         always the same frames, for a program that counts instructions
 */
#include <cblas.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "floor.h"
#include "pelorus/pelorus.h"
#include "textbook.h"
#include "timing.h"

/* OpenBLAS's own, which Debian's cblas.h does not declare for every build. */
void openblas_set_num_threads(int threads);

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
            add_run(updates, end - start);
    }
    textbook_free(&t);
    return good;
}

static const char *const title =
    "%5s | %21s | %9s | %21s | %9s | %21s | %21s | %s\n"
    "%5s | %10s %10s | %9s | %10s %10s | %9s | %10s %10s | %10s %10s | gemm, syrk\n";

static int beside_textbook(double seconds) {
    static const unsigned sizes[] = {16, 32, 50, 64, 100, 128, 256};
    static timing frames, predicts, by_imu, readings, gain, symmetric;
    const double budget_us = 1e6 * seconds;
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

/* tests/python/test_instructions.py runs this under callgrind. */
static int count(const char *landmarks, const char *process) {
    static timing frames, steps;
    const bool by_imu = strcmp(process, "imu") == 0;
    const int n = atoi(landmarks);
    if (n < 1 || n > PLR_MAX_LANDMARKS || !(by_imu || strcmp(process, "twist") == 0))
        return EXIT_FAILURE;
    return time_filter((unsigned)n, by_imu ? PLR_PROCESS_IMU : PLR_PROCESS_TWIST, 0, &frames,
                       &steps)
               ? EXIT_SUCCESS
               : EXIT_FAILURE;
}

int main(int argc, char **argv) {
    if (argc == 4 && strcmp(argv[1], "--count") == 0)
        return count(argv[2], argv[3]);
    const bool floor = argc > 1 && strcmp(argv[1], "--floor") == 0;
    const int at = floor ? 2 : 1;
    const double seconds = argc > at ? atof(argv[at]) : 1.0;
    return floor ? beside_floor(seconds) : beside_textbook(seconds);
}
