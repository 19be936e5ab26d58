// SPDX-License-Identifier: MIT
/* The start of an IMU, as far as frames tell: do tracked points stand still, and is it settled? */
#ifndef PLR_FILTER_INERTIAL_H
#define PLR_FILTER_INERTIAL_H

#include "pelorus/filter.h"

/* A frame before the start: if most of its points have moved since the readings began to be averaged, the body
 * does not stand, and the average begins anew. */
void plr_filter_watch_start(plr_filter *f, const plr_sightings *sightings);

/* A frame after the start: lays the anchor where it is time (plr_alignment_anchor), and holds the mean reading
 * against gravity. */
void plr_filter_follow_start(plr_filter *f, const plr_report *report);

#endif
