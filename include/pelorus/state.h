// SPDX-License-Identifier: MIT
/*
 * The memory of a filter: belief, camera, source of motion, motion, workspace and the supervisor's memory
 * side by side, each in a header of its own. It is public so that a caller can reserve it statically; the
 * fields are for the library alone, and their layout may change with any version. plr_totals, which comes
 * first, is part of the interface.
 */
#ifndef PELORUS_STATE_H
#define PELORUS_STATE_H

#include <stddef.h>

#include "pelorus/belief.h"
#include "pelorus/camera.h"
#include "pelorus/config.h"
#include "pelorus/map.h"
#include "pelorus/settings.h"
#include "pelorus/source.h"
#include "pelorus/supervisor.h"
#include "pelorus/types.h"
#include "pelorus/workspace.h"

/* Counts since init or reset. */
typedef struct plr_totals {
    uint32_t twists;        /* accepted; with an IMU its readings, as in twists_refused */
    uint32_t frames;        /* accepted */
    uint32_t late;          /* frames and readings refused with PLR_E_LATE */
    uint32_t refused;       /* other calls refused because of their data */
    uint32_t resets;        /* poses set by plr_filter_set_pose */
    uint32_t locks;         /* times the gate rejected nearly everything: PLR_REASON_GATE_LOCKED */
    uint32_t range_limited; /* landmark corrections limited: PLR_REASON_RANGE_LIMITED */
    uint32_t blocks_failed; /* as in plr_report */
    uint32_t widened;       /* times the pose's covariance was enlarged: the pose may have jumped */
    uint32_t recoveries;    /* times the landmarks were dropped after a divergence */
    uint32_t contradictions; /* times the filter followed vision against twists or IMU */
    uint32_t twists_refused, frames_refused;             /* for any reason */
    uint32_t damaged;                                    /* frames refused with PLR_E_DAMAGED */
    uint32_t readings, readings_gated, readings_refused; /* of small sensors */
    uint64_t observations, matched, used, gated, created, evicted;
    plr_time_ns diverged_ns; /* when a variance was last found not positive; 0: never */
} plr_totals;

/* What the settings make of the gate and of pauses. */
typedef struct plr_parameters {
    plr_real gate_d2, gate_residual2;
    plr_time_ns max_gap_ns;
} plr_parameters;

/* Checksums of the filter's memory, to find out whether something else wrote to it. */
typedef struct plr_guard {
    uint64_t constant, moving, told, large;
} plr_guard;

/* The checksums depend on the order of the members: config to par never change after init, source to belief
 * hold what a reading changes in one piece, work and evidence change without a checksum, guard is last. See
 * src/filter/guard.h. */
typedef struct plr_filter {
    uint32_t magic; /* set by a successful init */
    plr_config config;
    plr_map map;
    plr_parameters par;

    plr_camera_model camera;
    plr_source source;
    plr_motion motion; /* that is in the pose and not yet in P */
    plr_belief belief;
    plr_workspace work;
    plr_frame_evidence evidence; /* of this frame, for the supervisor */

    plr_supervisor supervisor;
    plr_real recovery_P
        [PLR_POSE_TRIANGLE];     /* the pose's covariance when it was last in order, plus the motion
                                since; packed lower triangle */
    uint16_t frames_off_the_map; /* in succession, that rejected nearly all known landmarks */
    uint8_t clock_started;
    plr_totals totals;
    plr_guard guard;
} plr_filter;

#endif
