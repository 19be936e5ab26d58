// SPDX-License-Identifier: MIT
/*
 * At which inverse range a landmark is linearised while its own is poorly known (docs/MATH.md 10). How
 * the motion moves a point in the picture is proportional to its inverse range. Taken at an estimate that
 * is mostly noise, this is larger than it is, and agrees with that noise: every frame then learns of the
 * motion what no pixel has said.
 */
#ifndef PLR_FILTER_VANTAGE_H
#define PLR_FILTER_VANTAGE_H

#include "pelorus/state.h"

/* What the inverse ranges of the landmarks usually are, 1/m: their mean, each weighed by how well it is
 * known; positive. */
plr_real plr_vantage_usual(const plr_filter *f);

/* From a landmark's estimated inverse range to where it is linearised: to the place nearest to the usual
 * one within two sigmas of estimate + change. Change is what the frame's observation is about to make of
 * it, and variance what it leaves. */
plr_real plr_vantage_offset(const plr_slot *slot, plr_real usual, plr_real change,
                            plr_real variance);

#endif
