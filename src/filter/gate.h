// SPDX-License-Identifier: MIT
/* The gate: rejects measurements that are too far from their prediction (docs/MATH.md 8). */
#ifndef PLR_FILTER_GATE_H
#define PLR_FILTER_GATE_H

#include <stdbool.h>

#include "pelorus/state.h"
#include "sensor/measurement.h"
#include "state/sightings.h"

/* The gate's result for one measurement. */
typedef struct plr_verdict {
    bool accepted;
    plr_real d2;    /* r^T S^-1 r + extra_d2 */
    plr_real det_S; /* a larger one means more information for the state */
} plr_verdict;

/* In plr_sighting.verdict. Far: rejected by so much that another point is seen. A lost landmark's bearing is
 * so uncertain that a linear correction would be wrong, whatever is seen. */
typedef enum plr_gate_result {
    PLR_GATE_ACCEPTED,
    PLR_GATE_REJECTED,
    PLR_GATE_FAR,
    PLR_GATE_LOST,
    PLR_GATE_NOT_JUDGED /* not yet, or there is no landmark */
} plr_gate_result;

/* Compares d^2 with `gate-d2`; with the setting `gate-residual`, the squared norm of the raw
 * residuals with that, px^2, and d^2 only where the supervisor opens such a gate. */
bool plr_gate_accepts(const plr_filter *f, bool opens, plr_real d2, plr_real residual2);

/* PLR_GATE_REJECTED or PLR_GATE_FAR. `left_out`: the supervisor's rules that are left out. */
plr_gate_result plr_gate_rejection(uint64_t left_out, plr_real d2);

static inline bool plr_gate_accepted(const plr_sighting *s) {
    PLR_ASSERT(plr_is_matched(s) && s->verdict != PLR_GATE_NOT_JUDGED);
    return s->verdict == PLR_GATE_ACCEPTED;
}

static inline bool plr_gate_rejected(const plr_sighting *s) {
    return plr_is_matched(s) && s->verdict != PLR_GATE_NOT_JUDGED && !plr_gate_accepted(s);
}

/* Judges a measurement at the current estimate. It is rejected, whatever its residual is, if the
 * variance of a predicted row exceeds max_variance. */
plr_verdict plr_gate_judge(const plr_filter *f, bool opens, const plr_measurement *m);

/* The same of a wheel's reading: what its errors of scale and track explain is no slip. */
plr_verdict plr_gate_judge_wheel(const plr_filter *f, const plr_measurement *m);

#endif
