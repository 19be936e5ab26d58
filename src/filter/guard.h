// SPDX-License-Identifier: MIT
/*
 * Detects that something else has written to the filter's memory between two calls: a stray write,
 * a flipped bit, a stack that grew into it. Without the check it could lead to a crash, a NaN or a
 * wrong pose.
 *
 * There are four checksums: `constant`, of what never changes after init (settings, map, parameters,
 * model); `moving`, of what a reading changes (times, pose, velocity, bias, motion, counts); `told`, of
 * what only a frame changes and a query tells (the camera as estimated, the pose's and biases' rows of
 * P); `large`, of all slots and the whole of P. A change within one aligned 32-bit word is always
 * found, any other with near certainty, by the next call that uses what was changed. The functions
 * `check` compare checksums with the memory; a call that changes memory ends with a `seal`, which
 * computes them anew. The workspace has no checksum: each call fills what it uses of it, but for the rows of the
 * last frame, which plr_filter_supervision reads, and noise.open, which is 0 between frames.
 *
 * Cost: two or three instructions a word; twice a frame over P, twice a reading over what it changes.
 * Once damage is found the checksums stay wrong, so that every later call is refused too, until an
 * init; or until a reset, if the constant part is undamaged.
 */
#ifndef PLR_FILTER_GUARD_H
#define PLR_FILTER_GUARD_H

#include "pelorus/state.h"

/* For a reading: it changes `moving` alone, and uses `told` only before an IMU's start and beside velocities that
 * are held. PLR_E_ARGUMENT if f is NULL; PLR_E_NOT_READY; PLR_E_DAMAGED. */
plr_status plr_guard_check_reading(const plr_filter *f);

/* For a query, and for what changes `moving` alone: `told` is checked too. */
plr_status plr_guard_check(const plr_filter *f);

/* For a call that reads or changes landmarks or P. */
plr_status plr_guard_check_whole(const plr_filter *f);

/* For a reset: settings, map, parameters, model. */
plr_status plr_guard_check_constant(const plr_filter *f);

/* R^T R = I, but for rounding and more, no mirror image, and p finite. */
bool plr_guard_is_pose(const plr_real R_WB[9], const double p_WB[3]);

/* The point is one that a landmark of the filter's model can have: in `body`, one whose chart is
 * defined (state/polar.h). */
bool plr_guard_is_landmark(const plr_filter *f, const plr_slot *slot);

/* After a call that changed `moving` alone; that changed more; and once, at init. */
void plr_guard_seal(plr_filter *f);
void plr_guard_seal_whole(plr_filter *f);
void plr_guard_seal_constant(plr_filter *f);

#endif
