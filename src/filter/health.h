// SPDX-License-Identifier: MIT
/* How far the estimate may be trusted, judged from what happened in the last frames. */
#ifndef PLR_FILTER_HEALTH_H
#define PLR_FILTER_HEALTH_H

#include <stdbool.h>

#include "pelorus/state.h"

/* What a frame met besides its counts. */
typedef struct plr_frame_events {
    bool sink_failed;
    bool locked;
    bool recovered;
    unsigned cut;
} plr_frame_events;

/* Counts this frame; true if the gate rejected at least 80 % of at least 5 matches in 10 successive
 * frames, and again after each 10 more. */
bool plr_health_gate_is_locked(plr_filter *f, const plr_report *report);

/* True from a lock, or from the tenth frame without one used observation, until a frame is seen
 * again: a gate of fixed pixels does not know how uncertain the pose has become, and would be wrong
 * for ever. */
bool plr_health_fixed_gate_is_open(const plr_filter *f);

/* Fills health and reasons of a frame that was processed. */
void plr_health_judge(plr_filter *f, const plr_frame_events *events, plr_report *report);

/* Fills health of a frame that was refused. */
void plr_health_after_refusal(const plr_filter *f, plr_report *report);

/* Fills health where a guard found the filter's memory changed. */
void plr_health_damaged(plr_filter *f, plr_report *report);

/* Adds a frame to the totals. */
void plr_health_count(plr_filter *f, const plr_report *report);

#endif
