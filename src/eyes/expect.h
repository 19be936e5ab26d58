// SPDX-License-Identifier: MIT
/* The motion that a pair is looked at with: what the filter said of its velocity since the last one. */
#ifndef PLR_EYES_EXPECT_H
#define PLR_EYES_EXPECT_H

#include "pelorus/eyes.h"

/* The body's velocity at t_ns, later than the last; between the two it is their mean. */
void plr_eyes_motion_step(plr_eyes_motion *m, plr_time_ns t_ns, const plr_twist *velocity);

/* How the points have moved in the camera of T_CB until t_ns, the last velocity holding on, and that velocity;
 * the motion begins anew there. Without place_known the turn alone is told (p = 0). False if nothing is known. */
bool plr_eyes_motion_take(plr_eyes_motion *m, plr_time_ns t_ns, const plr_pose *T_CB,
                          bool place_known, plr_expected *expected);

#endif
