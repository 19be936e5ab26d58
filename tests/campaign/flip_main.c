// SPDX-License-Identifier: MIT
/* Flips single bits in filters in the middle of their lives, each in a copy of its own, and counts
 * what came of it. docs/TESTING.md, "The campaign". */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "campaign/flip.h"
#include "campaign/pool.h"
#include "campaign/whole_number.h"
#include "pelorus/pelorus.h"

enum { SHORT_FLIPS = 2000, FLIPS = 20000, LONG_FLIPS = 200000 };
enum { BATCH = 500, SHOWN = 40 };
static const double SILENT_LIMIT = 1e-4; /* share of the flips */

typedef struct options {
    unsigned long flips, seed, jobs;
    bool gate;
} options;

static void usage(FILE *out) {
    fputs("usage: pelorus-bitflips [options]\n"
          "  --flips N    how many (20000)\n"
          "  --seed N     (1)\n"
          "  --jobs N     processes (as many as processors)\n"
          "  --short      2000 flips\n"
          "  --long       200000 flips\n"
          "  --gate       exit status 1 if a limit is not met\n"
          "example: pelorus-bitflips --flips 50000 --seed 3\n",
          out);
}

static void refuse(const char *option) {
    fprintf(stderr, "pelorus-bitflips: %s: no option, or without a value that it takes\n", option);
    usage(stderr);
    exit(2);
}

static unsigned long number(const char *option, const char *text) {
    const unsigned long n = whole_number(text, 100000000);
    if (n == 0)
        refuse(option);
    return n;
}

static options parse(int argc, char **argv) {
    options o = {FLIPS, 1, pool_processors(), false};
    for (int i = 1; i < argc; i++) {
        const char *option = argv[i], *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (strcmp(option, "--short") == 0)
            o.flips = SHORT_FLIPS;
        else if (strcmp(option, "--long") == 0)
            o.flips = LONG_FLIPS;
        else if (strcmp(option, "--gate") == 0)
            o.gate = true;
        else if (strcmp(option, "--flips") == 0)
            o.flips = number(option, value), i++;
        else if (strcmp(option, "--seed") == 0)
            o.seed = number(option, value), i++;
        else if (strcmp(option, "--jobs") == 0)
            o.jobs = number(option, value), i++;
        else if (strcmp(option, "--help") == 0) {
            usage(stdout);
            exit(0);
        } else
            refuse(option);
    }
    return o;
}

static void try_one(void *context, unsigned index) {
    flip_try(&((flip *)context)[index]);
}

static const char *const words[FLIP_VERDICTS] = {"crashed or hung",
                                                 "wrote out of bounds",
                                                 "gave nonsense as PLR_OK",
                                                 "silent beyond 5 sigma",
                                                 "told",
                                                 "harmless"};

/* The bad ones, for whoever looks for their cause. */
static void show(const flip *flips, unsigned n) {
    unsigned shown = 0;
    for (unsigned i = 0; i < n && shown < SHOWN; i++)
        if (flips[i].verdict < FLIP_TOLD) {
            printf("  flip %u: byte %u bit %u, filter %u, %s the readings: %s, told at frame %d\n",
                   i, flips[i].offset, flips[i].bit, flips[i].life,
                   flips[i].after ? "after" : "before", words[flips[i].verdict],
                   flips[i].told_frame);
            shown++;
        }
}

static bool report(const flip *flips, unsigned n) {
    unsigned counts[FLIP_VERDICTS] = {0}, at_once = 0;
    for (unsigned i = 0; i < n; i++) {
        counts[flips[i].verdict]++;
        at_once += flips[i].verdict == FLIP_TOLD && flips[i].told_frame == 0;
    }
    show(flips, n);
    for (int v = 0; v < FLIP_VERDICTS; v++)
        printf("%-24s %8u  %.6f\n", words[v], counts[v], (double)counts[v] / n);
    printf("%-24s %8u\n", "told at the first frame", at_once);
    const bool pass = counts[FLIP_CRASHED] == 0 && counts[FLIP_OUT_OF_BOUNDS] == 0 &&
                      counts[FLIP_NOT_FINITE] == 0 && counts[FLIP_SILENT] <= SILENT_LIMIT * n;
    printf("%s: none crashed, out of bounds or nonsense; silent at most %g\n",
           pass ? "pass" : "FAIL", SILENT_LIMIT);
    return pass;
}

int main(int argc, char **argv) {
    const options o = parse(argc, argv);
    const unsigned n = (unsigned)o.flips;
    flip *flips = pool_shared(n * sizeof *flips);
    flip_prepare(o.seed);
    for (unsigned i = 0; i < n; i++)
        flip_choose(&flips[i], o.seed, i);
    printf("# pelorus %s, float%u, %u landmarks, plr_filter of %u bytes, %u flips, seed %lu\n",
           plr_version(), (unsigned)(8 * sizeof(plr_real)), (unsigned)PLR_MAX_LANDMARKS,
           (unsigned)sizeof(plr_filter), n, o.seed);
    pool_run(n, (unsigned)o.jobs, BATCH, "flips", try_one, flips);
    const bool pass = report(flips, n);
    return o.gate && !pass ? 1 : 0;
}
