// SPDX-License-Identifier: MIT
/*
 * Does the camera send the same picture again and again? A frozen picture looks like a body that
 * stands, and would hold a moving one (docs/MATH.md 13).
 */
#ifndef PLR_FILTER_FROZEN_H
#define PLR_FILTER_FROZEN_H

#include <stdbool.h>

#include "pelorus/state.h"
#include "pelorus/types.h"

/* True if the frame repeats the previous picture: most matched observations have exactly the same
 * pixels, while the twists report a motion of more than their noise. Call it once a frame, after
 * matching. */
bool plr_frozen_is_seen(plr_filter *f, const plr_frame *frame, unsigned n);

/* Adds the accumulated motion to what plr_frozen_is_seen compares with its noise. Call it before
 * the motion is applied without a frame. */
void plr_frozen_note_motion(plr_filter *f);

#endif
