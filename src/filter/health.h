// SPDX-License-Identifier: MIT
/* How far the estimate may be trusted, judged from what happened in the last frames. */
#ifndef PLR_FILTER_HEALTH_H
#define PLR_FILTER_HEALTH_H

#include <stdbool.h>

#include "pelorus/state.h"

/* Events of a frame that are not counts in its report. */
typedef struct plr_frame_events {
    bool sink_failed;
    bool locked;
    bool recovered;
    bool relocated;
    bool left_out; /* known landmarks in sight have not come in; they must not be born as others */
    bool map_disagrees; /* filter/map_check.h */
    unsigned adopted;   /* known landmarks that have come in */
    unsigned unplaced;  /* known landmarks in sight that could not come in at the predicted pose */
    unsigned cut;
} plr_frame_events;

/* Adds this frame; true if in each of the last 10 frames the gate rejected at least 80 % of at
 * least 5 matches. While that lasts, true again after every 10 frames. */
bool plr_health_gate_is_locked(plr_filter *f, const plr_report *report);

/* True after plr_health_gate_is_locked, or after ten frames without a used observation, until one
 * is used again. The gate gate-residual then accepts by gate-d2: a limit in pixels does not grow
 * with the pose's uncertainty, and would reject everything for ever. */
bool plr_health_fixed_gate_is_open(const plr_filter *f);

/* True if the last reading is too old to say how the body moves now. */
bool plr_health_readings_are_old(const plr_filter *f);

/* Fills health and reasons of a frame that was processed. */
void plr_health_judge(plr_filter *f, const plr_frame_events *events, plr_report *report);

/* Fills health of a frame that came before an IMU's start. */
void plr_health_waits(plr_filter *f, plr_report *report);

/* A frame of dead reckoning came: NO_TWISTS says whether readings were refused since the last one. */
void plr_health_dead_reckons(plr_filter *f);

/* Fills health of a frame that was refused. */
void plr_health_after_refusal(const plr_filter *f, plr_report *report);

/* Fills health where a guard found the filter's memory changed. */
void plr_health_damaged(plr_filter *f, plr_report *report);

/* Adds a frame to the totals. */
void plr_health_count(plr_filter *f, const plr_report *report);

#endif
