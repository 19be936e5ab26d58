// SPDX-License-Identifier: MIT
/* The swarm: many seeded IMU drives with blows, in this precision and, with --beside, in the other one.
 * docs/TESTING.md, "The swarm". */
#define _POSIX_C_SOURCE 200809L /* popen */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "campaign/pool.h"
#include "campaign/swarm.h"
#include "campaign/whole_number.h"
#include "pelorus/pelorus.h"

enum { DRIVES = 40, LONG_DRIVES = 500 };
enum { ENOUGH_POINTS = 20 };
static const double ENOUGH_NEAR_M = 10, LEFT_M = 0.05, SENSOR_LEFT_M = 0.5, AGAIN_S = 2,
                    LEFT_SIGMAS = 5;

typedef struct options {
    unsigned long drives, first_seed, jobs;
    const char *beside;
    bool lines, gate;
} options;

static void usage(FILE *out) {
    fputs(
        "usage: pelorus-swarm [options]\n"
        "  --drives N        how many (40)\n"
        "  --long            500\n"
        "  --first-seed N    (1)\n"
        "  --jobs N          processes (as many as processors)\n"
        "  --beside PROGRAM  the same drives by pelorus-swarm-f64: what diverges here alone fails\n"
        "  --lines           a line for each drive, not only for those that fall short\n"
        "  --gate            exit status 1 if a drive falls short\n"
        "example: pelorus-swarm --long --beside build/bin/pelorus-swarm-f64\n",
        out);
}

static void refuse(const char *option) {
    fprintf(stderr, "pelorus-swarm: %s: no option, or without a value that it takes\n", option);
    usage(stderr);
    exit(2);
}

static unsigned long number(const char *option, const char *text) {
    const unsigned long n = whole_number(text, 1000000);
    if (n == 0)
        refuse(option);
    return n;
}

static options parse(int argc, char **argv) {
    options o = {DRIVES, 1, pool_processors(), NULL, false, false};
    for (int i = 1; i < argc; i++) {
        const char *option = argv[i], *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (strcmp(option, "--long") == 0)
            o.drives = LONG_DRIVES;
        else if (strcmp(option, "--lines") == 0)
            o.lines = true;
        else if (strcmp(option, "--gate") == 0)
            o.gate = true;
        else if (strcmp(option, "--drives") == 0)
            o.drives = number(option, value), i++;
        else if (strcmp(option, "--first-seed") == 0)
            o.first_seed = number(option, value), i++;
        else if (strcmp(option, "--jobs") == 0)
            o.jobs = number(option, value), i++;
        else if (strcmp(option, "--beside") == 0 && value)
            o.beside = argv[++i];
        else if (strcmp(option, "--help") == 0) {
            usage(stdout);
            exit(0);
        } else
            refuse(option);
    }
    return o;
}

typedef struct swarm {
    const options *options;
    swarm_outcome *outcomes;
    unsigned *beside; /* times that the other precision diverged */
} swarm;

static void drive_one(void *context, unsigned index) {
    const swarm *s = context;
    swarm_run(s->options->first_seed + index, &s->outcomes[index]);
}

/* The other precision tells of each drive "seed N: diverged K", and more behind it. */
static void ask_beside(const swarm *s) {
    const options *o = s->options;
    char line[400];
    unsigned answered = 0;
    if (snprintf(line, sizeof line, "%s --lines --drives %lu --first-seed %lu --jobs %lu",
                 o->beside, o->drives, o->first_seed, o->jobs) >= (int)sizeof line)
        refuse("--beside");
    FILE *other = popen(line, "r");
    while (other && fgets(line, sizeof line, other)) {
        unsigned long seed;
        unsigned diverged;
        if (sscanf(line, "seed %lu: diverged %u", &seed, &diverged) == 2 &&
            seed - o->first_seed < o->drives) {
            s->beside[seed - o->first_seed] = diverged;
            answered++;
        }
    }
    if (!other || pclose(other) != 0 || answered != o->drives) {
        fprintf(stderr, "pelorus-swarm: %s told of %u of %lu drives\n", o->beside, answered,
                o->drives);
        exit(2);
    }
}

/* Enough is in sight, and near enough, to say within 0.05 m where the body is; and within half a metre where a
 * sensor that was struck says something else. */
static double most_left_m(const swarm_drive *d) {
    if (d->points < ENOUGH_POINTS || d->slots < d->points || d->far_m > ENOUGH_NEAR_M)
        return HUGE_VAL;
    return d->blow == BLOW_BODY ? LEFT_M : SENSOR_LEFT_M;
}

/* Returns what a drive fails on; "" if on nothing. */
static const char *failing(const swarm_drive *d, const swarm_outcome *x, const unsigned *beside) {
    if (!x->done)
        return "died";
    if (x->not_finite > 0)
        return "not finite";
    if (beside && x->diverged > 0 && *beside == 0)
        return "diverged alone";
    if (x->left_m > most_left_m(d))
        return "left off its place";
    if (d->blow == BLOW_BODY && d->points >= ENOUGH_POINTS && x->again_s > AGAIN_S)
        return "not good within 2 s";
    if (d->blow == BLOW_BODY && d->points >= ENOUGH_POINTS && x->left_sigmas > LEFT_SIGMAS)
        return "left beyond 5 sigma";
    return "";
}

static const char *const blows[SWARM_BLOWS] = {"body", "sensor", "unseen"};

static void print_line(unsigned long seed, const swarm_drive *d, const swarm_outcome *x,
                       const char *why) {
    printf(
        "seed %lu: diverged %u, first at %.2f s; %s to %.0f m/s^2 and %.1f rad/s; %u points to "
        "%.0f m, %u slots, %u Hz, %u readings, scatter %.2f; left %.3f m, %.1f sigma, good after "
        "%.2f s, worst %.3g m, sigma of v to %.3g, silent %u, good %.3f, refused %u  %s\n",
        seed, x->diverged, x->first_diverged_s, blows[d->blow], d->hardest_mps2, d->hardest_radps,
        d->points, d->far_m, d->slots, d->frame_hz, d->readings_per_frame, d->scatter_mps2,
        x->left_m, x->left_sigmas, x->again_s, x->worst_m, x->worst_v_sigma_mps, x->silent,
        x->frames ? (double)x->good / x->frames : 0, x->refused, why);
}

static void print_sums(const swarm *s) {
    for (unsigned kind = 0; kind < SWARM_BLOWS; kind++) {
        unsigned n = 0, diverged = 0, alone = 0, far = 0, silent = 0;
        double worst_m = 0, frames = 0, silent_frames = 0;
        for (unsigned i = 0; i < s->options->drives; i++) {
            const swarm_outcome *x = &s->outcomes[i];
            if (swarm_drawn(s->options->first_seed + i).blow != (swarm_blow)kind)
                continue;
            n++;
            diverged += x->diverged > 0;
            alone += s->beside && x->diverged > 0 && s->beside[i] == 0;
            far += x->worst_m > 10;
            silent += x->silent > 0;
            silent_frames += x->silent;
            frames += x->frames;
            worst_m = fmax(worst_m, x->worst_m);
        }
        printf("%-6s %4u drives: %u diverged, %u here alone, %u were over 10 m off, worst %.3g m; "
               "%u silent beyond 5 sigma, %.4f of all frames\n",
               blows[kind], n, diverged, alone, far, worst_m, silent,
               frames > 0 ? silent_frames / frames : 0);
    }
}

int main(int argc, char **argv) {
    const options o = parse(argc, argv);
    swarm s = {&o, pool_shared(o.drives * sizeof(swarm_outcome)), NULL};
    unsigned failed = 0;
    printf("# pelorus %s, float%u, %lu drives from seed %lu\n", plr_version(),
           (unsigned)(8 * sizeof(plr_real)), o.drives, o.first_seed);
    fflush(stdout);
    pool_run((unsigned)o.drives, (unsigned)o.jobs, 0, "drives", drive_one, &s);
    if (o.beside) {
        s.beside = pool_shared(o.drives * sizeof *s.beside);
        ask_beside(&s);
    }
    for (unsigned i = 0; i < o.drives; i++) {
        const swarm_drive d = swarm_drawn(o.first_seed + i);
        const char *why = failing(&d, &s.outcomes[i], s.beside ? &s.beside[i] : NULL);
        failed += *why != '\0';
        if (o.lines || *why)
            print_line(o.first_seed + i, &d, &s.outcomes[i], why);
    }
    print_sums(&s);
    printf("\n%u of %lu drives fall short\n", failed, o.drives);
    return o.gate && failed ? 1 : 0;
}
