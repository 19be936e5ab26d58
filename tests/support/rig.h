// SPDX-License-Identifier: MIT
/* A filter on a simulated drive: what the tests of the interface have in common. */
#ifndef PELORUS_TEST_RIG_H
#define PELORUS_TEST_RIG_H

#include "pelorus/filter.h"
#include "support/pose_of.h"
#include "support/scene.h"

enum { RIG_STEP_NS = 10000000, RIG_TWISTS = 10 }; /* twists at 100 Hz, frames at 10 Hz */

typedef struct rig_state {
    plr_filter filter, before; /* `before`: the state that a refused call must leave */
    plr_calibration calibration;
    plr_config config;
    plr_map map;
    scene_options options;
    scene world;
    plr_report report; /* of the last frame */
} rig_state;

extern rig_state rig;

extern const plr_pose rig_identity;

/* Default settings and scene, no map, and a new filter. */
void rig_set_up(void);

/* A new filter and a new drive with the settings as they stand in `rig`. Demands PLR_OK. */
void rig_begin(void);

void rig_begin_with(plr_mode mode, bool bias);

/* A reading now, and 10 ms of driving. Demands PLR_OK. */
void rig_twist(void);

/* A frame now. Demands PLR_OK. */
void rig_frame(void);

/* Ten readings, from one frame to the next. */
void rig_twists(void);

/* The same of a body that stands while its wheels turn at `speed_mps`. */
void rig_twists_in_place(double speed_mps);

/* So many frames, each after ten readings. */
void rig_drive(unsigned frames);

/* The same with wheels that tell `share` of the way. */
void rig_drive_told(unsigned frames, double share);

/* So many frames of a body that stands, each after ten readings of the twist that the scene has. */
void rig_stand(unsigned frames);

/* e = Log(T^^-1 T), the pose's error. Returns e^T P^-1 e: chi-square with six degrees of freedom, if
 * the covariance is right. */
double rig_squared_error(double e[6]);

/* How far off the place may be: the root of the trace of its covariance. */
double rig_sigma_m(void);

/* The smallest eigenvalue of the matrix of correlations. */
double rig_smallest_correlation(void);

/* Keeps the state, against which rig_demand_refusal compares. */
void rig_remember(void);

/* The call was refused with that status and changed nothing; a refusal more is counted in totals as
 * `late` or `refused`. */
void rig_demand_refusal(plr_status expected, plr_status got);

/* The same for calls whose refusals are not counted. */
void rig_demand_untouched(plr_status expected, plr_status got);

#endif
