// SPDX-License-Identifier: MIT
/* A filter and the textbook's beside it, driven through one scene: what their tests have in common. */
#ifndef PELORUS_TEST_TWIN_DRIVE_H
#define PELORUS_TEST_TWIN_DRIVE_H

#include "pelorus/filter.h"
#include "support/scene.h"
#include "support/twin.h"

enum { TWIN_STEP_NS = 10000000, TWIN_TWISTS = 10, TWIN_MOST = 64 };

typedef struct twin_drive {
    plr_filter filter;
    textbook book;
    scene world;
    scene_options options;
    plr_config config;
    uint32_t evicted[PLR_MAX_LANDMARKS];
    unsigned evictions; /* of the present frame */
} twin_drive;

extern twin_drive twins;

/* Default options and settings, TWIN_MOST slots. For setUp. */
void twin_drive_set_up(void);

/* A new scene, filter and textbook. `source`: known landmarks, or NULL. */
void twin_drive_begin(bool (*source)(void *context, uint32_t id, plr_landmark *landmark));

/* For tearDown. */
void twin_drive_end(void);

/* One twist in both; the textbook, which has no clock, then holds it for a step. */
void twin_drive_step(plr_time_ns step_ns);

/* TWIN_TWISTS steps. */
void twin_drive_to_the_next_frame(void);

/* What the filter evicted leaves the textbook too. */
void twin_drive_evict(void);

/* New landmarks in the textbook while the filter has a slot: parts of the image by D'Hondt's method, in each
 * the order of the frame. */
unsigned twin_drive_create(const plr_frame *frame);

#endif
