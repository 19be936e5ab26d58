// SPDX-License-Identifier: MIT
/* The gate: rejects observations that are too far from their prediction (docs/MATH.md 8). */
#ifndef PLR_FILTER_GATE_H
#define PLR_FILTER_GATE_H

#include <stdbool.h>

#include "pelorus/state.h"
#include "state/model.h"

/* The gate's result for one observation. */
typedef struct plr_verdict {
    bool accepted;
    plr_real d2;   /* r^T S^-1 r + (vL - vR)^2 / (2 s^2): 4 degrees of freedom */
    plr_real gain; /* det(S), px^6; a larger one means more information for the state */
} plr_verdict;

/* r = (uL, uR, (vL + vR) / 2) - z: the innovation, px. */
void plr_gate_innovation(plr_real r[3], const plr_observation *seen, const plr_linearisation *lin);

/* R, the noise of rows (uL, uR, v): s^2, s^2, s^2 / 2. */
plr_real plr_gate_noise(const plr_filter *f, unsigned row);

/* The verdict itself: d^2 against `gate-d2`, or with `gate-residual` the squared norm of the four
 * residuals against that, px^2. */
bool plr_gate_accepts(const plr_filter *f, plr_real d2, plr_real residual2);

/* Judges an observation of a slot at the current estimate. Rejected whatever its residual: a point
 * nearer than min-depth, and one whose predicted pixels have a sigma of more than a focal length
 * (but for known ones). */
plr_verdict plr_gate_judge(const plr_filter *f, unsigned slot, const plr_observation *seen);

#endif
