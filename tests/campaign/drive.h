// SPDX-License-Identifier: MIT
/* One seed of one scenario: a filter is driven through it and compared with the truth. */
#ifndef CAMPAIGN_DRIVE_H
#define CAMPAIGN_DRIVE_H

#include "campaign/scenario.h"

#include <stdint.h>

typedef enum phase { BEFORE = 0, DURING = 1, AFTER = 2, PHASES = 3 } phase;

/* What happened in a phase. An error is beyond when a component of (rho, theta) exceeds 5 of the
 * filter's own sigmas. */
typedef struct account {
    unsigned frames, good, beyond, silent; /* silent: beyond and GOOD */
    unsigned diverged;                     /* no covariance to be had */
    unsigned judged;                       /* frames that went into nees */
    double nees;                           /* sum */
    double sigmas, mahalanobis;            /* largest component, largest distance */
    double error_m, error_rad;             /* at the end */
    double sigma_m, sigma_rad;             /* the filter's own at the end: root of the trace */
} account;

enum { REASONS = 32 }; /* bits of plr_report.reasons */

typedef struct outcome {
    bool done; /* false: the process ended before its time */
    account phase[PHASES];
    double bias_sigmas[6]; /* error at the end in sigmas */
    bool has_bias;
    unsigned matched, gated, refused;
    unsigned reasons[PHASES][REASONS]; /* frames not GOOD, by the bits that were set */
    unsigned resets;                   /* times that the filter says it was set or widened */
    double told_frames;    /* from the beginning of the event to the first frame not GOOD; -1 */
    double again_s;        /* from true again to GOOD again; -1: never */
    double first_diverged; /* frame; -1: never */
    /* How far off dead reckoning is at the end of the event, from where the filter was when it began,
     * m: with the readings as they are, and less the biases known by then. */
    double reckoned_m, reckoned_unbiased_m;
    /* One second after the event: the error in sigmas and in m, and the filter's own sigma; and its
     * sigma one second after it was started. */
    double later_sigmas, later_error_m, later_own_m, fresh_own_m;
} outcome;

typedef struct drive_options {
    unsigned parked_frames; /* replaces the length of a scenario that is_long */
    uint64_t left_out;      /* rules of the supervisor that are left out */
} drive_options;

/* `scene` is the setting: plr_scene_policy. */
void drive(const scenario *s, uint64_t seed, uint8_t scene, const drive_options *options,
           outcome *result);

#endif
