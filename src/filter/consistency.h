// SPDX-License-Identifier: MIT
/*
 * Do twists and pictures tell the same story? Each frame says how the motion differed from what the
 * twists had announced, in sigmas of their own noise (nu). Over windows that fade, and in single
 * frames, that must look like noise. Where it does not, the twists are believed less, the pose's
 * covariance covers both stories, and health says so until they agree again (docs/MATH.md 17).
 */
#ifndef PLR_FILTER_CONSISTENCY_H
#define PLR_FILTER_CONSISTENCY_H

#include <stdbool.h>

#include "filter/motion.h"
#include "pelorus/types.h"

/* Nothing seen yet, everything in agreement. */
void plr_consistency_clear(plr_filter *f);

/* Q <- what the twists' noise must be taken for in this frame: more, as long as they are contradicted.
 * Call it before plr_motion_prior; `believed` receives the prior as the twists' own sigmas have it. */
void plr_consistency_widen(plr_filter *f, plr_applied_motion *believed);

/* A frame's motion was found to differ from the twists by nu: prior N(0, I) in units of applied->L,
 * information Lambda (6x6 packed) with the prior. `outright`: this very frame contradicts them. */
void plr_consistency_add(plr_filter *f, const plr_applied_motion *believed,
                         const plr_applied_motion *applied, const plr_real nu[6],
                         const plr_real Lambda[21], bool outright);

/* True if this picture was sent before: most of the matched observations have the pixels of the frame
 * before, to the bit, while the twists have moved the body since by more than their noise. Call it once
 * a frame, after matching. */
bool plr_consistency_is_frozen(plr_filter *f, const plr_frame *frame, unsigned n);

/* Takes in the counts of a frame; returns the reasons that they give. */
uint32_t plr_consistency_judge(plr_filter *f, const plr_report *report, bool lost);

/* Adds to the pose's covariance, as long as a contradiction lasts, what reaches from one story to the
 * other: d d^T of the way d between them, and a share of it to all sides. P_xi, 6x6, is of now. */
void plr_consistency_cover(const plr_filter *f, plr_real P_xi[36]);

#endif
