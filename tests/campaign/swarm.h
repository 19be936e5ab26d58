// SPDX-License-Identifier: MIT
/* One drive of the swarm: a body with an IMU stands, and is struck every few seconds; or its IMU is. */
#ifndef CAMPAIGN_SWARM_H
#define CAMPAIGN_SWARM_H

#include <stdbool.h>
#include <stdint.h>

typedef enum swarm_blow {
    BLOW_BODY,   /* the body is thrown aside and turned, and the IMU reads that */
    BLOW_SENSOR, /* the readings are wrong meanwhile, and the body stands */
    BLOW_UNSEEN, /* the same by less than the body's weight: 5 m/s^2, 2 rad/s, 0.4 s, 8 points */
    SWARM_BLOWS
} swarm_blow;

/* What is drawn for a seed. Seeds take turns in the kinds of blow. */
typedef struct swarm_drive {
    swarm_blow blow;
    unsigned points, slots, frame_hz, readings_per_frame;
    double far_m;        /* points stand between 1.5 m and this */
    double scatter_mps2; /* one sigma of the accelerometer; of the gyro a hundredth, rad/s */
    double hardest_mps2, hardest_radps, longest_s; /* of the blows */
} swarm_drive;

typedef struct swarm_outcome {
    bool done; /* false: the process ended before its time */
    unsigned frames, good;
    unsigned silent;     /* frames GOOD with a component beyond 5 sigma */
    unsigned diverged;   /* as plr_totals.recoveries */
    unsigned not_finite; /* frames whose answer holds such a number, or no positive variance */
    unsigned refused;    /* calls that were not PLR_OK */
    double first_diverged_s, worst_m, worst_v_sigma_mps;
    /* Worst of the blows: how far the error has moved from before it to two seconds after it, the same in
     * the filter's sigmas, and how long after it health was GOOD again; HUGE_VAL: not before the next. */
    double left_m, left_sigmas, again_s;
} swarm_outcome;

swarm_drive swarm_drawn(uint64_t seed);

void swarm_run(uint64_t seed, swarm_outcome *result);

#endif
