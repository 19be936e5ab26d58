// SPDX-License-Identifier: MIT
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS, alarm */
#include "campaign/flip.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "campaign/poses.h"
#include "campaign/sensors.h"
#include "campaign/world.h"
#include "pelorus/pelorus.h"

enum { TWISTS = 5, LANDMARKS = 20, YOUNGEST = 20, OLDER = 13 /* frames, from life to life */ };
enum { ZONE = 1 << 16, FENCE = 1 << 24 }; /* bytes: watched, and not to be touched at all */
enum { HANGS_AFTER_S = 30 };
static const unsigned char ZONE_BYTE = 0xA5;
static const double BEYOND = 5; /* sigmas */

/* A frame that the filter is yet to be given, and the truth at its end. */
typedef struct coming {
    plr_time_ns t_ns; /* of the first reading */
    plr_twist twists[TWISTS];
    plr_observation seen[LANDMARKS];
    uint16_t count;
    plr_pose truth;
    bool good; /* the unharmed filter says so */
} coming;

typedef struct life {
    plr_filter filter;
    coming coming[FLIP_FRAMES];
} life;

static life *lives;
static unsigned char *zone; /* the watched zone before the filter */
static plr_filter *victim;

static const scenario way = {.near_m = 3,
                             .far_m = 25,
                             .baseline_m = 0.2,
                             .landmarks = LANDMARKS,
                             .speed_mps = 1,
                             .turn = 1,
                             .twists_per_frame = TWISTS,
                             .pixel_px = 2,
                             .velocity_mps = 0.1,
                             .gyro_radps = 0.01,
                             .bias = true};

/* A map that takes everything, so that the filter has a function to call. */
static int take(void *context, const plr_landmark *landmark) {
    (void)context;
    (void)landmark;
    return 0;
}

/* ---------------------------------------------------------------- watched memory */

/* Under the address sanitizer even reading beside the filter ends the process. */
#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/asan_interface.h>
static void watch(const unsigned char *at, size_t bytes, bool on) {
    if (on)
        ASAN_POISON_MEMORY_REGION(at, bytes);
    else
        ASAN_UNPOISON_MEMORY_REGION(at, bytes);
}
#else
static void watch(const unsigned char *at, size_t bytes, bool on) {
    (void)at;
    (void)bytes;
    (void)on;
}
#endif

static unsigned char *zone_behind(void) {
    return zone + ZONE + sizeof *victim;
}

static void watch_zones(bool on) {
    watch(zone, ZONE, on);
    watch(zone_behind(), ZONE, on);
}

static void fill_zones(void) {
    memset(zone, ZONE_BYTE, ZONE);
    memset(zone_behind(), ZONE_BYTE, ZONE);
}

static bool zones_are_whole(void) {
    return zone[0] == ZONE_BYTE && memcmp(zone, zone + 1, ZONE - 1) == 0 &&
           memcmp(zone_behind(), zone, ZONE) == 0;
}

/* ---------------------------------------------------------------- one frame */

static const plr_time_ns FRAME_NS = UINT64_C(1000000000) / FRAME_HZ;

static bool hear(plr_filter *f, const coming *c) {
    bool accepted = true;
    for (unsigned i = 0; i < TWISTS; i++)
        accepted &= plr_filter_predict(f, c->t_ns + i * FRAME_NS / TWISTS, &c->twists[i]) == PLR_OK;
    return accepted;
}

static plr_status look(plr_filter *f, const coming *c, plr_report *report) {
    const plr_frame frame = {c->t_ns + FRAME_NS, PLR_NO_BUDGET, c->count, c->seen};
    return plr_filter_update(f, &frame, report);
}

static bool all_finite(const double *x, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return false;
    return true;
}

static bool is_rotation(const double R[9]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j <= i; j++) {
            const double dot =
                R[3 * i] * R[3 * j] + R[3 * i + 1] * R[3 * j + 1] + R[3 * i + 2] * R[3 * j + 2];
            if (!(fabs(dot - (i == j)) < 1e-3))
                return false;
        }
    return true;
}

static bool is_covariance(const double P[36]) {
    bool good = all_finite(P, 36);
    for (int i = 0; i < 6; i++)
        good &= P[7 * i] >= 0;
    return good;
}

/* Asks for everything that the filter tells. False if anything that it says is PLR_OK cannot be. */
static bool answers_make_sense(plr_filter *f) {
    plr_pose pose;
    plr_twist u;
    double P[36], b[6];
    bool sense = true;
    const unsigned count = plr_filter_landmark_count(f);
    plr_landmark landmark;
    if (count > 0 && plr_filter_landmark(f, count - 1, &landmark) == PLR_OK)
        sense &= all_finite(landmark.p_W_m, 3) && all_finite(landmark.P_W_m2, 9);
    if (plr_filter_pose(f, &pose) == PLR_OK)
        sense &= is_rotation(pose.R) && all_finite(pose.p, 3);
    if (plr_filter_pose_covariance(f, P) == PLR_OK)
        sense &= is_covariance(P);
    if (plr_filter_velocity(f, &u) == PLR_OK)
        sense &= all_finite(u.v_B_mps, 3) && all_finite(u.w_B_radps, 3);
    if (plr_filter_velocity_covariance(f, P) == PLR_OK)
        sense &= is_covariance(P);
    if (plr_filter_bias(f, b, P) == PLR_OK)
        sense &= all_finite(b, 6) && is_covariance(P);
    return sense;
}

/* The largest component of the error in sigmas; NaN if the filter does not say. */
static double largest_error(const plr_filter *f, const plr_pose *truth) {
    plr_pose pose;
    double P[36], xi[6], worst = 0;
    if (plr_filter_pose(f, &pose) != PLR_OK || plr_filter_pose_covariance(f, P) != PLR_OK)
        return (double)NAN;
    pose_error(&pose, truth, xi);
    for (int i = 0; i < 6; i++)
        worst = fmax(worst, fabs(xi[i]) / sqrt(P[7 * i]));
    return worst;
}

/* ---------------------------------------------------------------- the unharmed filters */

static void *pages(size_t bytes, int protection) {
    void *memory = mmap(NULL, bytes, protection, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) {
        perror("bitflips: no memory");
        exit(2);
    }
    return memory;
}

static void record(coming *c, world *w, sensors *e, unsigned k) {
    c->t_ns = UINT64_C(1000000000) + k * FRAME_NS;
    for (unsigned i = 0; i < TWISTS; i++) {
        world_choose_twist(w);
        c->twists[i] = sensors_read(e, w, false);
        world_step(w, false);
    }
    world_renew(w);
    sensors_look(e, w, false);
    memcpy(c->seen, e->seen, sizeof c->seen);
    c->count = e->count;
    c->truth = w->T_WB;
}

/* True if the unharmed filter stays well within the limit: what is beyond is then the flip's. */
static bool rehearse(life *l) {
    *victim = l->filter;
    for (unsigned k = 0; k < FLIP_FRAMES; k++) {
        plr_report report;
        (void)hear(victim, &l->coming[k]);
        (void)look(victim, &l->coming[k], &report);
        l->coming[k].good = report.health == PLR_HEALTH_GOOD;
        if (!(largest_error(victim, &l->coming[k].truth) < 0.8 * BEYOND))
            return false;
    }
    return true;
}

static bool live(life *l, uint64_t seed, unsigned frames) {
    static world w;
    static sensors e;
    coming now;
    plr_calibration calibration;
    plr_config config;
    plr_map map = {NULL, take, NULL};
    plr_report report;
    plr_config_default(&config);
    config.pixel_sigma_px = way.pixel_px;
    for (int i = 0; i < 3; i++) {
        config.velocity_sigma[i] = way.velocity_mps;
        config.gyro_sigma[i] = way.gyro_radps;
    }
    config.bias = 1;
    world_calibration(&way, &calibration);
    world_begin(&w, &way, seed);
    sensors_begin(&e, &way, &config, seed);
    if (plr_filter_init(&l->filter, &calibration, &config, &map) != PLR_OK)
        return false;
    for (unsigned k = 0; k < frames; k++) {
        record(&now, &w, &e, k);
        if (!hear(&l->filter, &now) || look(&l->filter, &now, &report) != PLR_OK)
            return false;
    }
    for (unsigned k = 0; k < FLIP_FRAMES; k++)
        record(&l->coming[k], &w, &e, frames + k);
    return rehearse(l);
}

void flip_prepare(uint64_t seed) {
    const size_t inside = (2 * ZONE + sizeof *victim + 4095) / 4096 * 4096;
    unsigned char *fenced = pages(2 * (size_t)FENCE + inside, PROT_NONE);
    zone = fenced + FENCE;
    if (mprotect(zone, inside, PROT_READ | PROT_WRITE) != 0) {
        perror("bitflips: mprotect");
        exit(2);
    }
    victim = (plr_filter *)(void *)(zone + ZONE);
    lives = pages(FLIP_LIVES * sizeof *lives, PROT_READ | PROT_WRITE);
    for (unsigned i = 0, tries = 0; i < FLIP_LIVES; tries++) {
        if (live(&lives[i], seed * 1000 + tries, YOUNGEST + OLDER * i))
            i++;
        else if (tries > 20 * FLIP_LIVES) {
            fprintf(stderr, "bitflips: the unharmed filter does not keep within its own sigmas\n");
            exit(2);
        }
    }
    (void)mprotect(lives, FLIP_LIVES * sizeof *lives, PROT_READ); /* a wild write must not pass */
    fill_zones();
}

/* ---------------------------------------------------------------- the flip */

void flip_choose(flip *f, uint64_t seed, unsigned index) {
    chance c = chance_seeded(seed, 1000 + (uint64_t)index);
    const uint64_t bits = chance_bits(&c) % (8 * sizeof(plr_filter));
    f->offset = (uint32_t)(bits / 8);
    f->bit = (uint8_t)(bits % 8);
    f->life = (uint8_t)(chance_bits(&c) % FLIP_LIVES);
    f->after = (uint8_t)(chance_bits(&c) % 2);
    f->verdict = FLIP_CRASHED;
    f->told_frame = -1;
}

static void worse(flip_verdict *verdict, bool is, flip_verdict than) {
    if (is && than < *verdict)
        *verdict = than;
}

static void strike(const flip *f) {
    ((unsigned char *)victim)[f->offset] ^= (unsigned char)(1U << f->bit);
}

void flip_try(flip *f) {
    const life *l = &lives[f->life];
    flip_verdict verdict = FLIP_HARMLESS;
    (void)alarm(HANGS_AFTER_S);
    watch_zones(true);
    *victim = l->filter;
    for (unsigned k = 0; k < FLIP_FRAMES; k++) {
        const coming *c = &l->coming[k];
        plr_report report;
        if (k == 0 && !f->after)
            strike(f);
        bool told = !hear(victim, c);
        if (k == 0 && f->after)
            strike(f);
        told |= look(victim, c, &report) != PLR_OK;
        told |= report.health != PLR_HEALTH_GOOD && c->good;
        if (told && f->told_frame < 0)
            f->told_frame = (int16_t)k;
        worse(&verdict, told, FLIP_TOLD);
        worse(&verdict, !answers_make_sense(victim), FLIP_NOT_FINITE);
        const double sigmas = largest_error(victim, &c->truth);
        worse(&verdict, report.health == PLR_HEALTH_GOOD && sigmas > BEYOND, FLIP_SILENT);
    }
    (void)alarm(0);
    watch_zones(false);
    if (!zones_are_whole()) {
        worse(&verdict, true, FLIP_OUT_OF_BOUNDS);
        fill_zones();
    }
    f->verdict = (uint8_t)verdict;
}
