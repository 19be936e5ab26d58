// SPDX-License-Identifier: MIT
/* What a frame does for the start of an IMU. */
#ifndef PLR_FILTER_INERTIAL_H
#define PLR_FILTER_INERTIAL_H

#include "pelorus/filter.h"

/* A frame of before the start: if most of its points have
 * moved since the readings began to be averaged, the body does not stand, and they begin anew. */
void plr_filter_watch_start(plr_filter *f, const plr_sightings *sightings);

/* After a frame: fixes position and yaw anew some time after a start in motion. */
void plr_filter_follow_start(plr_filter *f, const plr_report *report);

#endif
