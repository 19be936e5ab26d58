// SPDX-License-Identifier: MIT
/* Whether what comes in can be used (nothing is changed), what is wrong with pictures, and whether the halves of
 * a pair were taken together. */
#ifndef PLR_VISION_WATCH_H
#define PLR_VISION_WATCH_H

#include "pelorus/vision.h"
#include "vision/pyramid.h"
#include "vision/rig.h"

/* plr_vision_init's. */
plr_status plr_check_rig(const plr_rig *rig);

/* plr_vision_track's: pictures and times, then the expected motion, which may be NULL. */
plr_status plr_check_pair(const plr_vision *v, const plr_picture_pair *pair);
plr_status plr_check_expected(const plr_expected *e);

/* Bits of plr_picture_fault. *hash is of the last picture and becomes this one's; `first`: there is none. */
uint8_t plr_watch_picture(const plr_levels *l, uint32_t *hash, bool first);

/* Adds what n observations of this pair show: by how much rows differ, and how fast they move. */
void plr_watch_rows(plr_vision *v, const plr_expected_motion *m, unsigned n);

#endif
