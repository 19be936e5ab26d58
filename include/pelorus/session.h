// SPDX-License-Identifier: MIT
/*
 * The loop: message in, filter, messages out. The desktop replay and every board run this one.
 *
 *     static plr_session session;                       // all of its memory
 *     plr_session_options options;
 *     plr_session_options_default(&options);
 *     plr_session_init(&session, &port, &options);
 *     for (;;)
 *         plr_session_step(&session);                   // at most one message, bounded time
 *
 * A session takes HEADER, CONFIG, LANDMARK (known) and START, or STATE (restore) in its place, then
 * TWIST, TRUTH and STEREO, and among them STATE (save), then END (docs/REPLAY-FORMAT.md). It
 * answers with the CONFIG in force, after each frame POSE and REPORT, LANDMARK for what leaves the
 * state, TEXT for what a human should know, END. Nothing that arrives stops it: what it cannot use
 * is answered with a REPORT that says what was refused (subject) and why (status), and counted.
 * After END it waits for the next HEADER.
 *
 * Settings in force: override (an option) over CONFIG over HEADER over default. Once data has
 * arrived neither HEADER nor CONFIG can change anything: the same ones again are ignored, others
 * are refused with PLR_E_MODE. A START then sets the pose anew.
 *
 * With a store the filter's state survives a power cut: STATE (save) keeps it, and STATE (restore)
 * before the data brings it back. That is then the start: a START or TRUTH before the data, and
 * option `start`, change nothing of it. Refused, it leaves the session ready for a START. Both are
 * answered with a TEXT and a REPORT of subject STATE, whose statuses stand in src/session/saving.h.
 * A save takes as long as the device does (seconds, on flash), and no data is taken meanwhile.
 *
 * Two sessions can live side by side; one is not thread-safe. No heap, no stdio.
 */
#ifndef PELORUS_SESSION_H
#define PELORUS_SESSION_H

#include "pelorus/filter.h"
#include "pelorus/port.h"
#include "pelorus/state_store.h"
#include "pelorus/wire.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Where the pose starts. START and TRUTH count at or before the first STEREO. */
typedef enum plr_start_choice {
    PLR_START_AUTO = 0,     /* START if there is one, else the first TRUTH, else identity */
    PLR_START_TRUTH = 1,    /* the first TRUTH; frames before it are refused */
    PLR_START_IDENTITY = 2, /* identity, whatever the recording says */
    PLR_START_RECORDED = 3, /* START; frames before it are refused */
    PLR_START_SAVED = 4 /* the state in the store, as by STATE (restore) at the first data; if it
                               is refused: as PLR_START_RECORDED */
} plr_start_choice;

/* What is sent: bits of plr_session_options.output. */
typedef enum plr_output {
    PLR_OUTPUT_CONFIG = 1 << 0,     /* the settings in force and the build, before the first data */
    PLR_OUTPUT_POSE = 1 << 1,       /* after each STEREO */
    PLR_OUTPUT_TWIST_POSE = 1 << 2, /* after each TWIST */
    PLR_OUTPUT_REPORT = 1 << 3,     /* after each STEREO, and for whatever is refused */
    PLR_OUTPUT_LANDMARK = 1 << 4,   /* evicted ones, and at the end those that are left */
    PLR_OUTPUT_TEXT = 1 << 5,       /* warnings */
    PLR_OUTPUT_END = 1 << 6,        /* counts, at the end */
    PLR_OUTPUT_ECHO = 1 << 7,       /* the inputs too: the output is then a flight log, which can
                                       be replayed to the same bits */
    PLR_OUTPUT_STATE = 1 << 8       /* the state into the store, at the end of every drive */
} plr_output;

enum {
    PLR_SESSION_HELD_TWISTS = 64, /* most twists that a twist-delay holds back */
    PLR_SESSION_CHUNK = 256,      /* bytes asked of the port at once */
    PLR_SESSION_AGREEING = 3,     /* messages that must agree before a new time is believed */
    PLR_SESSION_BODY = PLR_WIRE_STEREO_BODY(PLR_MAX_OBSERVATIONS) > PLR_WIRE_MIN_BUFFER
                           ? PLR_WIRE_STEREO_BODY(PLR_MAX_OBSERVATIONS)
                           : PLR_WIRE_MIN_BUFFER /* bytes of the longest frame */
};

/* What came of one STEREO. */
typedef struct plr_frame_result {
    const plr_frame *frame;       /* with the budget in force */
    const plr_report *report;     /* its status tells whether the frame was refused */
    const plr_pose_message *pose; /* NULL if there is no estimate for the frame's time */
    uint64_t compute_ns;          /* its update, and the predicts since the last frame */
} plr_frame_result;

/* What a host application wants to see. Each function may be NULL; none may call the session.
 * Pointers hold until the function returns. */
typedef struct plr_session_observer {
    void *context;
    /* The filter is about to get its first data; plr_filter_config(&session->filter) is in
     * force. */
    void (*started)(void *context);
    void (*frame)(void *context, const plr_frame_result *result);
    /* Every pose that is computed: after each frame, and after twists if they are sent. */
    void (*pose)(void *context, const plr_pose_message *pose);
    void (*truth)(void *context, const plr_truth *truth);
    void (*landmark)(void *context, const plr_landmark_message *landmark);
    void (*text)(void *context, const plr_text *text); /* the session's own */
    /* A message was refused. (Frames that are no message: PLR_STEP_SKIPPED.) `culprit` is the
     * setting to change, NULL where it is not one. */
    void (*refused)(void *context, plr_kind subject, plr_time_ns t_ns, plr_status status,
                    const plr_setting *culprit);
} plr_session_observer;

typedef struct plr_session_options {
    const plr_wire_setting *overrides; /* win over CONFIG and HEADER; later ones over earlier; must
                                          outlive the session */
    unsigned override_count;
    plr_start_choice start;
    uint32_t output;      /* bits of plr_output */
    uint32_t deadline_us; /* time that an update may take; 0: no limit. The rule:
                             src/session/budget.h */
    plr_landmark *known;  /* memory for LANDMARK (known); must outlive the session */
    unsigned known_capacity;
    const plr_landmark
        *map;               /* known landmarks of every drive, besides the stream's own; ids once */
    unsigned map_count;     /* at most known_capacity; an echo of them stands in a flight log */
    plr_state_store *store; /* initialised; NULL: there is no storage. Must outlive the session */
    plr_session_observer observer;
} plr_session_options;

/* What one step met. */
typedef enum plr_step {
    PLR_STEP_IDLE,    /* no byte was there */
    PLR_STEP_BYTES,   /* bytes, but no whole frame */
    PLR_STEP_MESSAGE, /* a message was handled; it may have been refused */
    PLR_STEP_SKIPPED, /* a frame was skipped: .reader.skipped_why, .reader.skipped_at */
    PLR_STEP_FUTURE,  /* a HEADER of a higher major version was refused */
    PLR_STEP_ENDED,   /* END: everything was sent; the next HEADER starts anew */
    PLR_STEP_CLOSED,  /* the port has no more bytes */
    PLR_STEP_FAILED   /* the port reports a failure */
} plr_step;

/* Counts since init or since the HEADER that followed an END. */
typedef struct plr_session_totals {
    uint32_t twists, stereos, truths, landmarks; /* received */
    uint32_t refused;                            /* messages refused, of whatever kind; what the
                                                    reader skips is in reader.counts */
    uint32_t without_truth;                      /* mapping: frames without a TRUTH of their time */
    uint32_t reanchored;                         /* times a jump of the clock was followed */
    uint32_t held_short;    /* twists not held as long as asked: more than fit */
    uint32_t over_deadline; /* frames that took longer than the deadline */
    uint32_t not_sent;      /* messages that the port did not take */
} plr_session_totals;

/* Twists held back for a late camera: a ring, oldest first. */
typedef struct plr_held_twists {
    unsigned first, count;
    plr_twist_message twists[PLR_SESSION_HELD_TWISTS];
} plr_held_twists;

/* Landmarks of known position, ascending by id. */
typedef struct plr_known_map {
    plr_landmark *landmarks;
    unsigned count, capacity;
} plr_known_map;

/* Is the clock still the one that the estimate runs on? See src/session/reanchor.h. */
typedef struct plr_clock_watch {
    unsigned agreeing;
    plr_time_ns last_ns;
} plr_clock_watch;

/* What an observation costs. See src/session/budget.h. */
typedef struct plr_budget {
    uint64_t deadline_ns;
    uint64_t cost_ns;      /* per observation; 0: not known yet */
    uint64_t recent_ns[2]; /* what it was in the last two frames; 0: none yet */
} plr_budget;

typedef enum plr_session_phase {
    PLR_PHASE_WAITING = 0, /* for a HEADER */
    PLR_PHASE_READY = 1,   /* for data */
    PLR_PHASE_RUNNING = 2
} plr_session_phase;

/* `filter`, `totals`, `phase`, `header`, `known`, `init_failed`, `in` (the last message),
 * `reader.counts` and `reader.skipped_*` are for the caller to read; the rest is the session's
 * own. */
typedef struct plr_session {
    plr_filter filter;
    plr_session_totals totals;
    plr_session_phase phase;
    plr_header header; /* in force, from PLR_PHASE_READY on */

    plr_port port;
    plr_session_options options;

    plr_reader reader;
    uint8_t chunk[PLR_SESSION_CHUNK];
    unsigned chunk_at, chunk_count;
    uint8_t body[PLR_SESSION_BODY];
    plr_observation observations[PLR_MAX_OBSERVATIONS];
    plr_message in;
    uint8_t last_skip; /* plr_skip of the last frame, so that a run of noise is answered once */

    plr_writer writer;
    plr_message out;

    plr_config_message wanted; /* the CONFIG, as far as it made sense */
    bool is_log;               /* the input holds a filter's outputs too */
    bool start_known, started; /* a START was given; the pose has been set */
    bool restored;             /* by a STATE, and no data has come since */
    bool init_failed; /* settings or calibration were refused: data waits for better ones */
    plr_start start;
    uint32_t start_resets;
    plr_held_twists held;
    plr_known_map known;
    plr_clock_watch watch;
    plr_budget budget;
    uint64_t predict_ns; /* computing time since the last frame */
    plr_report last;     /* of the last frame */
} plr_session;

/* --- use --- */

/* Start automatically, send all but twist poses and echoes, no deadline, no overrides, no memory
 * for known landmarks, no storage, no observer. */
void plr_session_options_default(plr_session_options *options);

/* What plr_session_init calls, with the sizes of whoever calls it. */
plr_status plr_session_init_sized(plr_session *s, const plr_port *port,
                                  const plr_session_options *options, const plr_sizes *caller);

/* Prepares a session. Port and options are copied; what they point to is not. PLR_E_ARGUMENT a null
 * pointer or a port without read; PLR_E_CONFIG an override that no setting allows; PLR_E_SIZE the
 * caller was compiled with other sizes than the library: nothing is written. */
static inline plr_status plr_session_init(plr_session *s, const plr_port *port,
                                          const plr_session_options *options) {
    const plr_sizes here = plr_sizes_here(sizeof(plr_session));
    return plr_session_init_sized(s, port, options, &here);
}

/* Reads what is there, up to the end of one frame, and handles it. Bounded: PLR_SESSION_CHUNK
 * bytes, one filter update, and, at END, one LANDMARK for each slot. */
plr_step plr_session_step(plr_session *s);

/* What END does, for a stream that was cut before it: applies the twists that are held back, sends
 * the landmarks that are left, and END. The next HEADER starts anew. */
void plr_session_finish(plr_session *s);

#ifdef __cplusplus
}
#endif

#endif
