// SPDX-License-Identifier: MIT
/* What the body's sensors tell of the world: noise, biases, and what goes wrong. */
#ifndef CAMPAIGN_SENSORS_H
#define CAMPAIGN_SENSORS_H

#include "campaign/world.h"
#include "pelorus/settings.h"

typedef struct sensors {
    const scenario *s;
    double bias[6];
    double bias_walk[2]; /* variance a second, of velocity and rate */
    plr_observation seen[MAX_POINTS];
    uint16_t count;
    unsigned frames;
    chance twist_chance, pixel_chance, match_chance;
} sensors;

/* Biases are drawn from the prior of `config`, if the scenario has biases. */
void sensors_begin(sensors *e, const scenario *s, const plr_config *config, uint64_t seed);

/* The reading of the current step. */
plr_twist sensors_read(sensors *e, const world *w, bool event);

/* One stereo frame; its observations stand in e->seen. */
void sensors_look(sensors *e, const world *w, bool event);

#endif
