// SPDX-License-Identifier: MIT
/*
 * The inverse range at which a landmark is linearised while its estimate is poor (docs/MATH.md 10).
 * The derivative of a pixel by the motion is proportional to the inverse range. Taken at an
 * estimate that is mostly noise, the derivative is correlated with that noise, and every frame adds
 * information about the motion that no pixel contains.
 */
#ifndef PLR_FILTER_LINEARISATION_H
#define PLR_FILTER_LINEARISATION_H

#include "pelorus/state.h"

/* The usual inverse range of the landmarks, 1/m: their mean, weighted by how well each is known;
 * positive. */
plr_real plr_linearisation_usual(const plr_filter *f);

/* The linearisation point minus the landmark's estimate, in inverse range, 1/m. The point is the
 * one nearest to the usual inverse range within two sigmas of estimate + change: `change` is the
 * correction by the frame's observation, `variance` that of the inverse range after it. */
plr_real plr_linearisation_offset(const plr_slot *slot, plr_real usual, plr_real change,
                                  plr_real variance);

#endif
