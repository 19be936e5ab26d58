// SPDX-License-Identifier: MIT
/* The gate: rejects measurements that are too far from their prediction (docs/MATH.md 8). */
#ifndef PLR_FILTER_GATE_H
#define PLR_FILTER_GATE_H

#include <stdbool.h>

#include "pelorus/state.h"
#include "sensor/measurement.h"

/* The gate's result for one measurement. */
typedef struct plr_verdict {
    bool accepted;
    plr_real d2;   /* r^T S^-1 r + extra_d2 */
    plr_real gain; /* det(S); a larger one means more information for the state */
} plr_verdict;

/* In work.gain, where an accepted observation has a number that is not negative. Far: rejected by so
 * much that another point is seen. A lost landmark's bearing is so uncertain that a linear correction
 * would be wrong, whatever is seen. */
#define PLR_GAIN_REJECTED PLR_R(-1)
#define PLR_GAIN_FAR      PLR_R(-2)
#define PLR_GAIN_LOST     PLR_R(-3)

/* Compares d^2 with `gate-d2`; with the setting `gate-residual`, the squared norm of the raw
 * residuals with that, px^2. */
bool plr_gate_accepts(const plr_filter *f, plr_real d2, plr_real residual2);

/* PLR_GAIN_REJECTED or PLR_GAIN_FAR. */
plr_real plr_gate_rejection(plr_real d2);

/* Judges a measurement at the current estimate. It is rejected, whatever its residual is, if the
 * variance of a predicted row exceeds max_variance. */
plr_verdict plr_gate_judge(const plr_filter *f, const plr_measurement *m);

#endif
