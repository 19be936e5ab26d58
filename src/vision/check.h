// SPDX-License-Identifier: MIT
/* Whether what comes in can be used. Nothing is changed. */
#ifndef PLR_VISION_CHECK_H
#define PLR_VISION_CHECK_H

#include "pelorus/vision.h"

/* plr_vision_init's. */
plr_status plr_check_rig(const plr_rig *rig);

/* plr_vision_track's: pictures and times, then the expected motion, which may be NULL. */
plr_status plr_check_pair(const plr_vision *v, const plr_picture_pair *pair);
plr_status plr_check_expected(const plr_expected *e);

/* Whether R is a rotation, to a thousandth. */
bool plr_check_rotation(const double R[9]);

#endif
