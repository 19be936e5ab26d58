// SPDX-License-Identifier: MIT
/* The parts that a session is made of. A caller needs their size, and may read the phase. */
#ifndef PELORUS_SESSION_PARTS_H
#define PELORUS_SESSION_PARTS_H

#include "pelorus/config.h"
#include "pelorus/wire.h"

enum {
    PLR_SESSION_HELD_FRAMES = 3,    /* most frames that wait for twists or readings of an IMU */
    PLR_SESSION_HELD_READINGS = 24, /* most readings of small sensors that wait with the twists */
    PLR_SESSION_HELD_TWISTS = 64,   /* most twists, or readings of an IMU, that wait because of the
                                       setting twist-delay */
    PLR_SESSION_AGREEING = 3 /* messages that must agree before the session follows a clock that
                                has jumped: src/session/reanchor.h */
};

/* Where a session is. What leads from one phase to another, and what each kind of message does in
 * each of them: docs/REPLAY-FORMAT.md, "What a session does with a message". */
typedef enum plr_session_phase {
    PLR_PHASE_WAITING = 0, /* for a HEADER */
    PLR_PHASE_READY,    /* for settings, START, known landmarks; the first data starts the filter */
    PLR_PHASE_REJECTED, /* HEADER and settings make no filter: data is refused until they do */
    /* from here on the filter runs */
    PLR_PHASE_STARTING, /* and its start pose is not set yet */
    PLR_PHASE_RESTORED, /* a STATE brought the saved state back, and no data has come since */
    PLR_PHASE_RUNNING,  /* from its start pose */
    PLR_PHASES
} plr_session_phase;

/* What moves the body: a twist, or a reading of an IMU. The setting `process` says which. */
typedef union plr_moved_by {
    plr_twist twist;
    plr_imu imu;
} plr_moved_by;

typedef struct plr_held_step {
    plr_time_ns t_ns;
    plr_moved_by by;
    bool leads; /* it is the first of its message */
} plr_held_step;

/* Twists or IMU readings that wait because of twist-delay: a ring, ascending by time. */
typedef struct plr_held_steps {
    uint8_t first, count;
    uint64_t leads; /* bit i: the one at place i is the first of its message */
    plr_time_ns t_ns[PLR_SESSION_HELD_TWISTS];
    plr_moved_by by[PLR_SESSION_HELD_TWISTS];
} plr_held_steps;

/* Readings of small sensors that wait with the twists, ascending by time. */
typedef struct plr_held_readings {
    unsigned count;
    plr_reading readings[PLR_SESSION_HELD_READINGS];
} plr_held_readings;

/* A frame whose time lies beyond the last step: it waits until the steps have come there. */
typedef struct plr_held_frame {
    plr_frame frame;      /* as it came; its observations are those below */
    plr_time_ns moved_ns; /* its time by the clock of the steps: setting camera-offset */
    plr_observation observations[PLR_MAX_OBSERVATIONS];
} plr_held_frame;

/* Such frames: a ring, ascending by moved_ns. */
typedef struct plr_held_frames {
    uint8_t first, count;
    plr_held_frame frames[PLR_SESSION_HELD_FRAMES];
} plr_held_frames;

/* Whether steps and frames come in the order of their times: src/session/steps.h. */
typedef struct plr_step_order {
    bool came;              /* a step */
    plr_time_ns newest_ns;  /* the newest time of those that came */
    bool stepped;           /* the filter took one */
    plr_time_ns stepped_ns; /* the time of the last that it took */
    bool used;              /* it took a frame, or a reading of a small sensor */
    plr_time_ns used_ns;    /* of the last that it took, by the clock of the steps */
    plr_time_ns ahead_ns;   /* so far was that ahead of the steps that had come */
    plr_time_ns late_ns;    /* the last used_ns that a step came behind; 0: none did */
    plr_time_ns told_ns;    /* how long frames were to wait, when a TEXT last told of it */
} plr_step_order;

/* Landmarks of known position, ascending by id. */
typedef struct plr_known_map {
    plr_landmark *landmarks;
    unsigned count, capacity;
} plr_known_map;

/* Detects a jump of the sender's clock: src/session/reanchor.h. */
typedef struct plr_clock_watch {
    unsigned agreeing;
    plr_time_ns last_ns;
} plr_clock_watch;

/* The measured cost of an observation: src/session/budget.h. */
typedef struct plr_budget {
    uint64_t deadline_ns;
    uint64_t cost_ns;      /* per observation; 0: not known yet */
    uint64_t recent_ns[2]; /* in each of the last two frames; 0: none yet */
} plr_budget;

#endif
