// SPDX-License-Identifier: MIT
/* The Kalman correction by a frame's observations, in blocks (docs/MATH.md 10). */
#ifndef PLR_FILTER_CORRECTION_H
#define PLR_FILTER_CORRECTION_H

#include "pelorus/state.h"

/* The result of all blocks. */
typedef struct plr_correction {
    unsigned applied;       /* observations in blocks that were applied */
    unsigned failed_blocks; /* left out: S could not be factorised */
    unsigned cut;           /* landmark corrections limited: PLR_REASON_RANGE_LIMITED */
    plr_real nu[6];         /* estimated noise of the motion, in units of its sigmas */
    plr_real Lambda[21];    /* information about nu, prior included: 6x6, packed upper triangle */
    bool moved;             /* a motion with noise was applied: nu and Lambda are filled */
} plr_correction;

/* Applies the observations work.used[0..count-1] (positions in work.order). All are linearised at
 * the current estimate, and the estimate is corrected once, at the end. If a variance would not be
 * positive or the correction is not finite, the filter is marked as diverged and keeps the result
 * of the blocks before. */
plr_correction plr_correct(plr_filter *f, const plr_observation *observations, unsigned count);

#endif
