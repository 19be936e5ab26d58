// SPDX-License-Identifier: MIT
/* The result of a replay: collected frame by frame, printed at the end as text or as JSON. */
#ifndef PELORUS_POSIX_SUMMARY_H
#define PELORUS_POSIX_SUMMARY_H

#include "pelorus/session.h"
#include "posix/samples.h"

typedef struct summary {
    uint64_t frames, frames_refused;
    uint64_t observations, matched, used, gated, created, evicted;
    uint64_t refused_observations, duplicates, no_room, poor, left_out, blocks_failed;
    uint64_t health[PLR_HEALTH_DIVERGED + 1]; /* frames in each */
    uint64_t before_start; /* of those lost: waiting for an IMU to start, at first */
    uint64_t recoveries;   /* from divergence, in the same frame */
    uint64_t warnings;
    plr_time_ns first_ns, last_ns, diverged_ns; /* the first time; 0: never */
    plr_pose last_pose;
    double path_m;
    samples compute_us; /* double, a frame each */
    uint64_t compute_ns;

    /* Filled in at the end. */
    double wall_s;
    bool cut_in_frame, ended;
    uint64_t bytes;
} summary;

void summary_init(summary *s);
void summary_free(summary *s);

void summary_add_frame(summary *s, const plr_frame_result *result);

/* Frames of this health since the start; all, if there was none. */
uint64_t summary_frames_in(const summary *s, plr_health health);

/* Both sort what was collected. `path` is the recording's, `log` that of --out or NULL. */
void summary_print(summary *s, const plr_session *session, const char *path, const char *log);
void summary_print_json(summary *s, const plr_session *session, const char *path);

/* The figures that both print. */
typedef struct summary_figures {
    double update_us_median, update_us_p99, update_us_max; /* NaN without frames */
    double duration_s, realtime_factor;
} summary_figures;

void summary_figures_of(summary *s, summary_figures *figures);

#endif
