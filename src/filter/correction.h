// SPDX-License-Identifier: MIT
/* The Kalman correction by a frame's observations, in blocks (docs/MATH.md 10). */
#ifndef PLR_FILTER_CORRECTION_H
#define PLR_FILTER_CORRECTION_H

#include "pelorus/state.h"

/* What the blocks came to. */
typedef struct plr_correction {
    unsigned applied;       /* observations in blocks that were applied */
    unsigned failed_blocks; /* left out: S could not be factorised */
    unsigned cut;           /* landmark corrections stopped at the limits of range */
    plr_real nu[6];         /* of the motion's noise, in its own sigmas: what came out */
    plr_real Lambda[21];    /* the information on it, with the prior */
    bool moved;             /* a motion with noise was applied: nu and Lambda are filled */
} plr_correction;

/* Takes the observations work.used[0..count-1] (positions in work.order), all linearised at the
 * current estimate, and moves the estimate once. Marks the filter diverged, leaving the valid
 * posterior of the blocks before, where a variance would cease to be positive or the correction
 * makes no sense. */
plr_correction plr_correct(plr_filter *f, const plr_observation *observations, unsigned count);

#endif
