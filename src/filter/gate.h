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

/* In work.verdict. Far: rejected by so much that another point is seen. A lost landmark's bearing is so
 * uncertain that a linear correction would be wrong, whatever is seen. */
typedef enum plr_gate_result {
    PLR_GATE_ACCEPTED,
    PLR_GATE_REJECTED,
    PLR_GATE_FAR,
    PLR_GATE_LOST
} plr_gate_result;

/* Compares d^2 with `gate-d2`; with the setting `gate-residual`, the squared norm of the raw
 * residuals with that, px^2. */
bool plr_gate_accepts(const plr_filter *f, plr_real d2, plr_real residual2);

/* PLR_GATE_REJECTED or PLR_GATE_FAR. */
plr_gate_result plr_gate_rejection(plr_real d2);

/* Notes the result of the gate for a slot; `gain` is det S. */
static inline void plr_gate_note(plr_filter *f, unsigned slot, plr_gate_result result,
                                 plr_real gain) {
    f->work.verdict[slot] = (uint8_t)result;
    f->work.gain[slot] = gain;
}

static inline bool plr_gate_accepted(const plr_filter *f, unsigned slot) {
    return f->work.verdict[slot] == PLR_GATE_ACCEPTED;
}

/* Judges a measurement at the current estimate. It is rejected, whatever its residual is, if the
 * variance of a predicted row exceeds max_variance. */
plr_verdict plr_gate_judge(const plr_filter *f, const plr_measurement *m);

#endif
