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

/* Kinds of events, in the order in which those of one time are used. */
typedef enum plr_event_kind {
    PLR_EVENT_STEP,    /* the body moved */
    PLR_EVENT_FRAME,   /* the camera took a stereo pair */
    PLR_EVENT_READING, /* a small sensor measured */
    PLR_EVENT_KINDS
} plr_event_kind;

/* What is used in the order of time: src/session/events.h. */
typedef struct plr_event {
    plr_time_ns t_ns; /* by the clock of the steps */
    plr_event_kind kind;
    bool leads; /* a step that is the first of its message */
    union {
        plr_moved_by step;
        plr_frame frame; /* as it came: t_ns is by the camera's clock */
        plr_reading reading;
    } as;
} plr_event;

enum {
    PLR_QUEUE_PLACES = PLR_SESSION_HELD_TWISTS + PLR_SESSION_HELD_FRAMES + PLR_SESSION_HELD_READINGS
};

/* Events that wait: src/session/queue.h. Each kind has places of its own. */
typedef struct plr_queue {
    uint8_t count, counts[PLR_EVENT_KINDS]; /* events, and those of each kind */
    uint8_t order[PLR_QUEUE_PLACES]; /* places: first the events', in order, then the free ones */
    bool leads[PLR_SESSION_HELD_TWISTS];
    plr_time_ns t_ns[PLR_QUEUE_PLACES];
    plr_moved_by steps[PLR_SESSION_HELD_TWISTS];
    plr_frame frames[PLR_SESSION_HELD_FRAMES];
    plr_observation observations[PLR_SESSION_HELD_FRAMES][PLR_MAX_OBSERVATIONS];
    plr_reading readings[PLR_SESSION_HELD_READINGS];
} plr_queue;

/* Whether steps and frames come in the order of their times: src/session/use.h. */
typedef struct plr_step_order {
    bool came;              /* a step arrived */
    bool stepped;           /* the filter took one */
    plr_time_ns stepped_ns; /* the time of the last that it took */
    bool used;              /* it took a frame, or a reading of a small sensor */
    plr_time_ns used_ns;    /* of the last that it took, by the clock of the steps */
    plr_time_ns ahead_ns;   /* how far that was ahead of the newest step */
    plr_time_ns late_ns;    /* used_ns when a step last came too late; 0: none did */
    plr_time_ns told_ns;    /* the delay that the last TEXT about it asked for */
    plr_time_ns shared_ns;  /* the stamp of the last step that was refused for its time */
    unsigned shared;        /* so many in succession had that one */
    bool told_shared;       /* a TEXT has said so */
    bool told_clock;        /* and one that the steps' clock is not the frames' */
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
