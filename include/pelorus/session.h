// SPDX-License-Identifier: MIT
/*
 * The main loop around a filter: messages in, estimates out. The desktop replay and every board run
 * this same loop.
 *
 *     static plr_session session;                       // all of its memory
 *     plr_session_options options;
 *     plr_session_options_default(&options);
 *     plr_session_init(&session, &port, &options);
 *     for (;;)
 *         plr_session_step(&session);                   // at most one message, bounded time
 *
 * Messages in (docs/REPLAY-FORMAT.md), in this order: HEADER; CONFIG and known LANDMARKs, as
 * needed; START, or instead of it STATE (restore); then TWIST or IMU, STEREO, TRUTH and READING,
 * and at any time among them STATE (save); END. Pictures (IMAGE, RIG)
 * are for a session with eyes (eyes.h). Messages out: the CONFIG in use; a POSE and a
 * REPORT after each frame; a LANDMARK for each one that leaves the filter; TEXT for a human; END.
 * No input stops the session: a message that it cannot use is counted, and answered with a REPORT
 * that names what was refused (subject) and why (status). After END it waits for the next HEADER.
 *
 * A setting's value comes from the first of these that has it: the option `overrides`, CONFIG,
 * HEADER, the default. After the first data HEADER and CONFIG cannot change anything: equal ones
 * are ignored, different ones refused with PLR_E_MODE. A START after the first data sets the pose.
 *
 * With a store the filter's state survives a power cut: STATE (save) writes it, and STATE (restore)
 * before the data reads it back. After a restore, START and TRUTH before the data and the option
 * `start` have no effect; after a refused restore the session waits for a START. Both requests are
 * answered with a TEXT and a REPORT of subject STATE; src/session/saving.h lists its statuses. A
 * save lasts as long as the device needs (on flash up to seconds); no input is read meanwhile.
 *
 * A program may have several sessions; one session is not thread-safe. No heap, no stdio.
 */
#ifndef PELORUS_SESSION_H
#define PELORUS_SESSION_H

#include "pelorus/filter.h"
#include "pelorus/port.h"
#include "pelorus/session_parts.h"
#include "pelorus/state_store.h"
#include "pelorus/wire.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Where the start pose comes from. Only a START or TRUTH at or before the first STEREO is used. */
typedef enum plr_start_choice {
    PLR_START_AUTO = 0,     /* START if there is one, else the first TRUTH, else identity */
    PLR_START_TRUTH = 1,    /* the first TRUTH; frames before it are refused */
    PLR_START_IDENTITY = 2, /* identity, whatever the recording says */
    PLR_START_RECORDED = 3, /* START; frames before it are refused */
    PLR_START_SAVED = 4     /* the state in the store, as if a STATE (restore) came before the first
                               data; if it is refused: as PLR_START_RECORDED */
} plr_start_choice;

/* Which messages are sent: bits of plr_session_options.output. */
typedef enum plr_output {
    PLR_OUTPUT_CONFIG = 1 << 0,     /* the settings in use and the build, before the first data */
    PLR_OUTPUT_POSE = 1 << 1,       /* after each STEREO */
    PLR_OUTPUT_TWIST_POSE = 1 << 2, /* after each TWIST, or each reading of an IMU */
    PLR_OUTPUT_REPORT = 1 << 3,     /* after each STEREO, and for every refused message */
    PLR_OUTPUT_LANDMARK = 1 << 4,   /* those that are evicted, and at END all in the filter */
    PLR_OUTPUT_TEXT = 1 << 5,       /* warnings */
    PLR_OUTPUT_END = 1 << 6,        /* counts, at the end */
    PLR_OUTPUT_ECHO = 1 << 7,       /* every input: the output is then a flight log, and a replay of
                                       it computes the same bits */
    PLR_OUTPUT_EVIDENCE =
        1 << 9, /* after each REPORT of a STEREO, what the supervisor saw; not by default */
    PLR_OUTPUT_STATE = 1 << 8 /* no message: at END the state is written to the store */
} plr_output;

enum {
    PLR_SESSION_CHUNK = 256, /* most bytes read from the port at once */
    PLR_SESSION_BODY = PLR_WIRE_STEREO_BODY(PLR_MAX_OBSERVATIONS) > PLR_WIRE_MIN_BUFFER
                           ? PLR_WIRE_STEREO_BODY(PLR_MAX_OBSERVATIONS)
                           : PLR_WIRE_MIN_BUFFER /* bytes of the longest frame */
};

/* The result of one STEREO. */
typedef struct plr_frame_result {
    const plr_frame *frame;       /* as received, with the budget that was applied */
    const plr_report *report;     /* its status says whether the frame was refused */
    const plr_pose_message *pose; /* at the frame's time moved by the setting camera-offset; NULL if
                                     there is no estimate for it */
    uint64_t compute_ns;          /* time of its update and of the predicts since the last frame */
} plr_frame_result;

/* Functions of the host application that the session calls. Each may be NULL; none may call the
 * session. Pointers are valid until the function returns. */
typedef struct plr_session_observer {
    void *context;
    /* Before the first data; plr_filter_config(&session->filter) has the final settings. */
    void (*started)(void *context);
    void (*frame)(void *context, const plr_frame_result *result);
    /* After each frame; after each twist or IMU reading too if PLR_OUTPUT_TWIST_POSE is set. */
    void (*pose)(void *context, const plr_pose_message *pose);
    void (*truth)(void *context, const plr_truth *truth);
    void (*landmark)(void *context, const plr_landmark_message *landmark);
    void (*text)(void *context, const plr_text *text); /* texts of this session */
    /* A message was refused. (For damaged frames see PLR_STEP_SKIPPED.) `culprit` is the setting to
     * change; NULL if the refusal is not about a setting. */
    void (*refused)(void *context, plr_kind subject, plr_time_ns t_ns, plr_status status,
                    const plr_setting *culprit);
} plr_session_observer;

struct plr_eyes;         /* eyes.h */
struct plr_picture_pair; /* vision.h */

typedef struct plr_session_options {
    const plr_wire_setting *overrides; /* settings used instead of those in CONFIG and HEADER; of
                                          two with one id the later; must outlive the session */
    unsigned override_count;
    plr_start_choice start;
    uint32_t output;         /* bits of plr_output */
    uint64_t left_out;       /* rules of the supervisor that are left out: plr_filter_leave_out */
    uint32_t deadline_us;    /* time that an update may take, us; 0: no limit. Kept by using fewer
                             observations: src/session/budget.h */
    plr_landmark *known;     /* memory for known LANDMARKs; must outlive the session */
    unsigned known_capacity; /* landmarks that fit there */
    const plr_landmark *map; /* known landmarks for every drive, in addition to those that arrive as
                                messages; each id once. A flight log repeats them */
    unsigned map_count;      /* at most known_capacity */
    plr_state_store *store;  /* initialised; NULL: no storage. Must outlive the session */
    struct plr_eyes *eyes; /* initialised; NULL: IMAGEs are refused once, and ignored. Must outlive
                              the session */
    plr_session_observer observer;
} plr_session_options;

/* What one step did. */
typedef enum plr_step {
    PLR_STEP_IDLE,    /* no byte was there */
    PLR_STEP_BYTES,   /* bytes, but no whole frame */
    PLR_STEP_MESSAGE, /* a message was handled; it may have been refused */
    PLR_STEP_SKIPPED, /* a frame was skipped: .reader.skipped_why, .reader.skipped_at */
    PLR_STEP_FUTURE,  /* a HEADER of a later major version was refused */
    PLR_STEP_ENDED,   /* END was handled and answered; the next HEADER starts a new drive */
    PLR_STEP_CLOSED,  /* the port has no more bytes */
    PLR_STEP_FAILED   /* the port reports a failure */
} plr_step;

/* Counts since init or since the HEADER that followed an END. */
typedef struct plr_session_totals {
    uint32_t twists, stereos, truths, landmarks, readings, imus, images; /* messages received */
    /* Messages of any kind that were refused; frames that were skipped are in reader.counts. */
    uint32_t refused;
    uint32_t imu_readings;  /* in those messages */
    uint32_t imu_refused;   /* IMU readings that were refused; of those that follow one another for
                               the same reason only the first counts in `refused` */
    uint32_t other_process; /* TWISTs with process = imu, IMUs with process = twist: not used; only
                               the first counts in `refused` */
    uint32_t without_truth; /* mapping: frames without a TRUTH of the same time */
    uint32_t reanchored;    /* times the session followed a jump of the clock */
    uint32_t held_short;    /* of what waits, used before its time for want of room */
    uint32_t late;          /* steps that came behind a frame of later time, and were refused */
    uint32_t over_deadline; /* frames that took longer than the deadline */
    uint32_t not_sent;      /* messages that could not be written to the port */
} plr_session_totals;

/* A caller may read `filter`, `totals`, `phase`, `header`, `known`, `in` (the last message),
 * `reader.counts` and `reader.skipped_*`; the rest is for the library alone. */
typedef struct plr_session {
    plr_filter filter;
    plr_session_totals totals;
    plr_session_phase phase;
    plr_header header; /* of this drive, from PLR_PHASE_READY on */

    plr_port port;
    plr_session_options options;

    plr_reader reader;
    uint8_t chunk[PLR_SESSION_CHUNK];
    unsigned chunk_at, chunk_count;
    uint8_t body[PLR_SESSION_BODY];
    plr_observation observations[PLR_MAX_OBSERVATIONS];
    plr_message in;
    uint8_t last_skip; /* plr_skip of the last frame: a series of skipped frames is answered once */

    plr_writer writer;
    plr_message out;

    plr_config_message wanted; /* the valid settings of the CONFIGs */
    bool is_log;               /* the input contains the outputs of a filter too */
    bool start_pending;        /* `start` sets the pose when its time has come */
    plr_start start;
    uint32_t start_resets;
    plr_time_ns calibration_ns; /* when CALIBRATION was sent last */
    plr_queue queue;
    plr_time_ns newest_ns[PLR_EVENT_KINDS]; /* the newest time of each kind that arrived */
    plr_step_order order;
    plr_known_map known;
    plr_clock_watch watch, step_watch; /* of all, and of the steps alone */
    plr_budget budget;
    uint64_t predict_ns;   /* computing time since the last frame */
    plr_report last;       /* of the last frame */
    plr_status imu_status; /* of the last IMU reading */
    uint32_t imu_faults;   /* bits of plr_imu_fault that were reported in this drive */
} plr_session;

/* --- use --- */

/* PLR_START_AUTO; sends everything but twist poses, evidence and echoes; no deadline, no overrides, no memory
 * for known landmarks, no storage, no observer. */
void plr_session_options_default(plr_session_options *options);

/* plr_session_init for a caller whose compiled-in sizes are given; use plr_session_init. */
plr_status plr_session_init_sized(plr_session *s, const plr_port *port,
                                  const plr_session_options *options, const plr_sizes *caller);

/* The settings that a session begins with: those of *wanted over what the HEADER suggests over
 * the defaults. PLR_E_CONFIG, with the row in *culprit, NULL if none has its id: the result makes no sense. */
plr_status plr_session_settings(plr_config *config, const plr_header *header,
                                const plr_config_message *wanted, const plr_setting **culprit);

/* Prepares a session. Port and options are copied; what they point to is not.
 * PLR_E_ARGUMENT a null pointer or a port without read; PLR_E_CONFIG an override that no setting
 * allows; PLR_E_SIZE the caller was compiled with other sizes: nothing is written. */
static inline plr_status plr_session_init(plr_session *s, const plr_port *port,
                                          const plr_session_options *options) {
    const plr_sizes here = plr_sizes_here(sizeof(plr_session));
    return plr_session_init_sized(s, port, options, &here);
}

/* Reads the bytes that are there, up to the end of one frame, and handles its message. The work of
 * one step is bounded: at most PLR_SESSION_CHUNK bytes, one filter update, PLR_WIRE_MAX_IMU
 * readings, PLR_SESSION_HELD_FRAMES updates that waited, and, at END, one LANDMARK a slot. */
plr_step plr_session_step(plr_session *s);

/* With eyes: a pair of the program's own camera, between two steps; it is done with when the call returns. The
 * frame that it shows goes on as a STEREO does.
 * PLR_E_ARGUMENT a null pointer; PLR_E_MODE no eyes; PLR_E_NOT_READY before a HEADER, or its settings make no
 * filter; else what plr_vision_track says, or PLR_E_CALIBRATION, _RANGE the cameras: answered as an IMAGE. */
plr_status plr_session_look(plr_session *s, const struct plr_picture_pair *pair);

/* A reading of the program's own IMU, between two steps: used as if it had come in an IMU message, which has
 * float32. PLR_E_ARGUMENT a null pointer; PLR_E_NOT_READY before a HEADER, or its settings make no filter: nothing
 * is done. What else is wrong is answered as to an IMU message. */
plr_status plr_session_inertial(plr_session *s, plr_time_ns t_ns, const plr_imu *reading);

/* Does what END does, for a stream that stopped without one: applies the twists that still wait,
 * sends the landmarks in the filter, and END. The next HEADER starts a new drive. */
void plr_session_finish(plr_session *s);

#ifdef __cplusplus
}
#endif

#endif
