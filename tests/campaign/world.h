// SPDX-License-Identifier: MIT
/* The true world: a body on a smooth path, points in front of its camera, and what both do when
 * something goes wrong. */
#ifndef CAMPAIGN_WORLD_H
#define CAMPAIGN_WORLD_H

#include "campaign/chance.h"
#include "campaign/poses.h"
#include "campaign/scenario.h"
#include "pelorus/types.h"

enum { MAX_POINTS = 128, WIDTH_PX = 640, HEIGHT_PX = 480 };

typedef struct point {
    double m[3];
    double lot;         /* uniform in 0..1: whether it belongs to a convoy */
    double drift_px[2]; /* how far its track has wandered, in both pictures alike */
    uint32_t id;
} point;

typedef struct world {
    const scenario *s;
    plr_calibration calibration; /* the true one */
    double camera_shift_m;       /* how far the camera was knocked to the left */
    double camera_turn_rad;      /* and how far it was turned about its vertical axis */
    double phase[6];
    plr_pose T_WB;
    plr_twist twist; /* of the current step */
    double t_s;
    double step_s;
    point points[MAX_POINTS];
    uint32_t next_id;
    chance chance;
} world;

/* The calibration that the filter is given. */
void world_calibration(const scenario *s, plr_calibration *calibration);

void world_begin(world *w, const scenario *s, uint64_t seed);

/* The twist that holds over the step that begins now. */
void world_choose_twist(world *w);

/* Carries the body, and the points that move, over one step. */
void world_step(world *w, bool event);

/* What happens at once at the first frame of an event. */
void world_strike(world *w);

/* What happens at once at the first frame after it. */
void world_mend(world *w);

/* (uL, vL, uR, vR) without noise; false if the point is not in sight of both cameras. */
bool world_project(const world *w, const point *p, double z[4]);

/* From one frame to the next: points out of sight are replaced by new ones with new ids, and points
 * whose track is lost by new ones under the same id; the other tracks wander. */
void world_renew(world *w);

#endif
