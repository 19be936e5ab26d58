// SPDX-License-Identifier: MIT
#include "pelorus/session.h"

#include <float.h>
#include <string.h>

#include "math/finite.h"
#include "pelorus/assertions.h"
#include "record/messages.h"
#include "session/events.h"
#include "session/layers.h"
#include "session/line.h"
#include "session/look.h"
#include "session/phase.h"
#include "session/plausible.h"
#include "session/saving.h"
#include "session/send.h"
#include "session/start.h"
#include "session/use.h"

void plr_session_options_default(plr_session_options *options) {
    memset(options, 0, sizeof *options);
    options->start = PLR_START_AUTO;
    options->output = PLR_OUTPUT_CONFIG | PLR_OUTPUT_POSE | PLR_OUTPUT_REPORT |
                      PLR_OUTPUT_LANDMARK | PLR_OUTPUT_TEXT | PLR_OUTPUT_END;
}

plr_status plr_session_init_sized(plr_session *s, const plr_port *port,
                                  const plr_session_options *options, const plr_sizes *caller) {
    const plr_sizes here = plr_sizes_here(sizeof(plr_session));
    if (!caller)
        return PLR_E_ARGUMENT;
    if (!plr_sizes_agree(caller, &here))
        return PLR_E_SIZE;
    if (s == NULL || port == NULL || options == NULL || port->read == NULL ||
        (options->override_count > 0 && options->overrides == NULL) ||
        (options->map_count > 0 && options->map == NULL) ||
        options->map_count > options->known_capacity)
        return PLR_E_ARGUMENT;
    if (!plr_layers_allow(options->overrides, options->override_count))
        return PLR_E_CONFIG;
    memset(s, 0, sizeof *s);
    s->port = *port;
    s->options = *options;
    plr_start_clear(s); /* and the phase is PLR_PHASE_WAITING, which is 0 */
    plr_status status =
        plr_reader_init(&s->reader, s->body, sizeof s->body, s->observations, PLR_MAX_OBSERVATIONS);
    if (status == PLR_OK && port->write != NULL)
        status = plr_writer_init(&s->writer, port->write, port->context);
    return status;
}

/* --- END --- */

/* END says how many there were: ", 10 of 12 TWIST" if 10 arrived. */
static void compare_counts(plr_session *s) {
    static const char *const names[PLR_COUNTED] = {" TWIST",    " STEREO",  " TRUTH",
                                                   " LANDMARK", " READING", " IMU"};
    plr_end answer;
    plr_text *line = &s->out.as.text;
    plr_send_describe_end(s, &answer);
    plr_line_begin(line, PLR_SEVERITY_WARNING,
                   "the recording is not complete: not everything arrived");
    for (unsigned i = 0; i < PLR_COUNTED; i++)
        if (answer.differs >> i & 1) {
            plr_line_count(line, ", ", answer.arrived[i]);
            plr_line_count(line, " of ", s->in.as.end.sent[i]);
            plr_line_text(line, names[i]);
        }
    if (answer.differs != 0)
        plr_send_text(s);
}

/* --- the table --- */

/* What happens to a message. All but those of IGNORE are echoed, into a flight log. */
typedef enum plr_rule {
    IGNORE = 0, /* nothing */
    ECHO,       /* no more than that */
    EARLY,      /* refused: PLR_E_NOT_READY */
    LATE,       /* refused: PLR_E_MODE */
    SAME,       /* refused: PLR_E_MODE; ignored if it says what is in force already */
    NEW,        /* used; ignored if it says what is in force already */
    FIRST,      /* leads to another phase, whose rule then applies */
    KEEP,       /* kept until its time comes */
    USE         /* used */
} plr_rule;

static void save(plr_session *s) {
    plr_saving_save(s, s->in.as.state.t_ns);
}

enum { RESTORE = PLR_WIRE_KINDS + 1, ROWS };

/* docs/REPLAY-FORMAT.md shows it too. What other filters computed (POSE, REPORT, LANDMARK of
 * another role) is ignored everywhere: row PLR_KIND_NONE. */
/* clang-format off */
static const struct {
    uint8_t rules[PLR_PHASES];
    void (*use)(plr_session *s);
} table[ROWS] = {
    /*                      WAITING READY  REJECTED STARTING RESTORED RUNNING */
    [PLR_KIND_HEADER]   = {{USE,    NEW,   NEW,     SAME,    SAME,    SAME}, plr_start_begin},
    [PLR_KIND_CONFIG]   = {{EARLY,  USE,   USE,     SAME,    SAME,    SAME}, plr_start_change_settings},
    [PLR_KIND_LANDMARK] = {{EARLY,  USE,   USE,     USE,     USE,     USE},  plr_start_add_landmark},
    [PLR_KIND_START]    = {{EARLY,  KEEP,  KEEP,    KEEP,    ECHO,    USE},  plr_events_take_start},
    [RESTORE]           = {{EARLY,  USE,   USE,     LATE,    USE,     LATE}, plr_saving_restore},
    [PLR_KIND_TWIST]    = {{EARLY,  FIRST, EARLY,   USE,     FIRST,   USE},  plr_events_take_twist},
    [PLR_KIND_IMU]      = {{EARLY,  FIRST, EARLY,   USE,     FIRST,   USE},  plr_events_take_imu},
    [PLR_KIND_STEREO]   = {{EARLY,  FIRST, EARLY,   USE,     FIRST,   USE},  plr_events_take_stereo},
    [PLR_KIND_IMAGE]    = {{EARLY,  FIRST, EARLY,   USE,     FIRST,   USE},  plr_look_take},
    [PLR_KIND_RIG]      = {{EARLY,  USE,   USE,     SAME,    SAME,    SAME}, plr_look_take_rig},
    [PLR_KIND_TRUTH]    = {{ECHO,   FIRST, ECHO,    USE,     FIRST,   USE},  plr_events_take_truth},
    [PLR_KIND_READING]  = {{EARLY,  FIRST, EARLY,   USE,     FIRST,   USE},  plr_events_take_reading},
    [PLR_KIND_STATE]    = {{EARLY,  EARLY, EARLY,   USE,     USE,     USE},  save},
    [PLR_KIND_TEXT]     = {{ECHO,   ECHO,  ECHO,    ECHO,    ECHO,    ECHO}, NULL},
    [PLR_KIND_END]      = {{USE,    USE,   USE,     USE,     USE,     USE},  compare_counts},
};
/* clang-format on */

static unsigned row_of(const plr_message *in) {
    if (in->kind == PLR_KIND_STATE && in->as.state.action == PLR_STATE_RESTORE)
        return RESTORE;
    const bool computed =
        in->kind == PLR_KIND_LANDMARK && in->as.landmark.role != PLR_LANDMARK_KNOWN;
    return computed ? PLR_KIND_NONE : in->kind;
}

/* --- each message --- */

/* A flight log contains one, a recording does not. */
static bool is_in_force(const plr_message *in) {
    return in->kind == PLR_KIND_CONFIG && in->as.config.build_fingerprint != 0;
}

static void count(plr_session *s) {
    s->totals.twists += s->in.kind == PLR_KIND_TWIST;
    s->totals.stereos += s->in.kind == PLR_KIND_STEREO;
    s->totals.truths += s->in.kind == PLR_KIND_TRUTH;
    s->totals.landmarks += s->in.kind == PLR_KIND_LANDMARK;
    s->totals.readings += s->in.kind == PLR_KIND_READING;
    s->totals.imus += s->in.kind == PLR_KIND_IMU;
    s->totals.images += s->in.kind == PLR_KIND_IMAGE;
    s->totals.imu_readings += s->in.kind == PLR_KIND_IMU ? s->in.as.imu.count : 0;
    s->is_log = s->is_log || is_in_force(&s->in);
}

/* What this session says itself is not echoed: CONFIG in force, END, a log's TEXT. A restore that
 * is used is echoed later, and what pictures show as a STEREO. */
static void echo(plr_session *s, unsigned row, plr_rule rule) {
    const bool own = is_in_force(&s->in) || row == PLR_KIND_END || row == PLR_KIND_IMAGE ||
                     (row == PLR_KIND_TEXT && s->is_log) || (row == RESTORE && rule == USE);
    if (!own)
        plr_send_echo(s);
    if (row == PLR_KIND_TRUTH && s->options.observer.truth != NULL)
        s->options.observer.truth(s->options.observer.context, &s->in.as.truth);
}

/* What is wrong with a message, if anything. A save without storage and a landmark that is none are
 * refused for that wherever they come. */
static plr_status check(const plr_session *s, unsigned row, plr_rule rule) {
    const plr_status plausible = plr_plausible_message(&s->in) ? PLR_OK : PLR_E_RANGE;
    if (rule == LATE || (rule == SAME && !plr_start_in_force(s)))
        return PLR_E_MODE;
    if (rule != EARLY)
        return plausible;
    if (row == PLR_KIND_STATE && s->options.store == NULL)
        return PLR_E_MODE;
    return row == PLR_KIND_LANDMARK && plausible != PLR_OK ? plausible : PLR_E_NOT_READY;
}

static void refuse(plr_session *s, plr_status status) {
    const plr_message *in = &s->in;
    if (in->kind == PLR_KIND_STEREO)
        plr_send_frame_refusal(s, &in->as.stereo, status);
    else if (in->kind == PLR_KIND_IMAGE && in->as.image.first_px > 0)
        s->totals.refused++; /* its first band was answered */
    else if (in->kind == PLR_KIND_STATE)
        plr_saving_refuse(s, (plr_state_action)in->as.state.action, plr_message_time(in), status);
    else
        plr_send_refusal(s, in->kind, plr_message_time(in), status, NULL);
}

/* The first data after a HEADER starts the filter. */
static void start(plr_session *s) {
    if (plr_start_filter(s) != PLR_OK)
        return;
    plr_phase_change(&s->phase, PLR_TRIGGER_FILTER);
    plr_start_announce(s);
    plr_start_set_bias(s);
    if (s->options.start == PLR_START_SAVED)
        plr_saving_restore_at_start(s, plr_message_time(&s->in));
    if (plr_filter_config(&s->filter)->mode == PLR_MODE_MAPPING) {
        s->start_pending = false; /* every pose comes as a TRUTH there */
        plr_phase_change(&s->phase, PLR_TRIGGER_POSE);
    }
}

/* What happens to a message of that row now; the first data lead to another phase. */
static plr_rule enter(plr_session *s, unsigned row) {
    if (table[row].rules[s->phase] == FIRST) {
        plr_phase_change(&s->phase, PLR_TRIGGER_DATA);
        if (s->phase == PLR_PHASE_READY)
            start(s);
    }
    return (plr_rule)table[row].rules[s->phase];
}

static void handle(plr_session *s) {
    const unsigned row = row_of(&s->in);
    PLR_ASSERT(row < ROWS && s->phase < PLR_PHASES);
    count(s);
    (void)enter(s, row);
    if ((row == PLR_KIND_START || row == PLR_KIND_TRUTH) && s->phase == PLR_PHASE_STARTING)
        plr_events_use_frames_before(s, plr_message_time(&s->in)); /* it may set the start pose */
    const plr_rule rule = (plr_rule)table[row].rules[s->phase];
    PLR_ASSERT(rule != FIRST);
    if (rule == IGNORE)
        return;
    if (row == PLR_KIND_STEREO)
        plr_use_limit(s, &s->in.as.stereo);
    echo(s, row, rule);
    const plr_status status = check(s, row, rule);
    if (status != PLR_OK)
        refuse(s, status);
    else if (rule == USE || (rule == NEW && !plr_start_in_force(s)))
        table[row].use(s);
    else if (rule == KEEP)
        plr_start_keep(s);
}

plr_status plr_session_look(plr_session *s, const plr_picture_pair *pair) {
    if (s == NULL || pair == NULL)
        return PLR_E_ARGUMENT;
    if (s->options.eyes == NULL)
        return PLR_E_MODE;
    memset(&s->in, 0, sizeof s->in);
    s->in.kind = PLR_KIND_IMAGE;
    s->in.as.image.t_ns = pair->left.t_ns;
    return enter(s, PLR_KIND_IMAGE) == USE ? plr_look_at(s, pair) : PLR_E_NOT_READY;
}

/* As a message's float32. What float32 cannot hold becomes the most that it can, which is refused as implausible: C
 * leaves that conversion undefined. Through memory: gcc 12.2 leaves the rounding out where several stand side by
 * side (docs/NUMERICS.md 7). */
static double narrow(double wide) {
    static const double most = (double)FLT_MAX;
    if (plr_all_finite(&wide, 1) && (wide > most || wide < -most))
        return wide > 0 ? most : -most;
    const volatile float rounded = (float)wide;
    return (double)rounded;
}

plr_status plr_session_inertial(plr_session *s, plr_time_ns t_ns, const plr_imu *reading) {
    if (s == NULL || reading == NULL)
        return PLR_E_ARGUMENT;
    if (table[PLR_KIND_IMU].rules[s->phase] == EARLY)
        return PLR_E_NOT_READY;
    memset(&s->in, 0, sizeof s->in);
    plr_imu_message *imu = &s->in.as.imu;
    s->in.kind = PLR_KIND_IMU;
    imu->t_ns = t_ns;
    imu->count = 1;
    for (unsigned i = 0; i < 3; i++) {
        imu->readings[0].a_B_mps2[i] = narrow(reading->a_B_mps2[i]);
        imu->readings[0].w_B_radps[i] = narrow(reading->w_B_radps[i]);
    }
    handle(s);
    return PLR_OK;
}

/* --- the loop --- */

/* Frames skipped one after the other for the same reason are answered once: noise has few bytes. */
static void answer_skip(plr_session *s) {
    static const plr_status statuses[] = {
        [PLR_SKIP_NONE] = PLR_OK,           [PLR_SKIP_DAMAGED] = PLR_E_CORRUPT,
        [PLR_SKIP_UNKNOWN] = PLR_E_FOREIGN, [PLR_SKIP_MALFORMED] = PLR_E_ARGUMENT,
        [PLR_SKIP_TOO_LONG] = PLR_E_FULL,
    };
    const plr_skip why = s->reader.skipped_why;
    const plr_kind subject =
        why == PLR_SKIP_DAMAGED ? PLR_KIND_NONE : (plr_kind)s->reader.skipped_kind;
    if (why != (plr_skip)s->last_skip)
        plr_send_answer(s, subject, 0, statuses[why], PLR_NOTICE_NONE);
    s->last_skip = (uint8_t)why;
}

/* A sender of a later version: refused, and read on, for it may not be the last sender. */
static void refuse_future(plr_session *s) {
    const plr_reader_counts counts = s->reader.counts;
    (void)plr_reader_init(&s->reader, s->body, sizeof s->body, s->observations,
                          PLR_MAX_OBSERVATIONS);
    s->reader.counts = counts;
    plr_send_refusal(s, PLR_KIND_HEADER, 0, PLR_E_FOREIGN, NULL);
}

static plr_step feed_reader(plr_session *s) {
    size_t used = 0;
    const plr_read_event event = plr_reader_feed(&s->reader, s->chunk + s->chunk_at,
                                                 s->chunk_count - s->chunk_at, &used, &s->in);
    s->chunk_at += (unsigned)used;
    PLR_ASSERT(s->chunk_at <= s->chunk_count);
    switch (event) {
    case PLR_READ_MESSAGE:
        s->last_skip = PLR_SKIP_NONE;
        handle(s);
        if (s->in.kind != PLR_KIND_END)
            return PLR_STEP_MESSAGE;
        plr_session_finish(s);
        return PLR_STEP_ENDED;
    case PLR_READ_SKIPPED:
        answer_skip(s);
        return PLR_STEP_SKIPPED;
    case PLR_READ_FUTURE:
        refuse_future(s);
        return PLR_STEP_FUTURE;
    case PLR_READ_MORE:
        break;
    }
    return PLR_STEP_BYTES;
}

plr_step plr_session_step(plr_session *s) {
    if (s->port.feed_watchdog != NULL)
        s->port.feed_watchdog(s->port.context);
    if (s->chunk_at == s->chunk_count) {
        const int count = s->port.read(s->port.context, s->chunk, sizeof s->chunk);
        if (count < 0)
            return count == PLR_PORT_CLOSED ? PLR_STEP_CLOSED : PLR_STEP_FAILED;
        if (count == PLR_PORT_NOTHING) {
            if (s->port.idle != NULL)
                s->port.idle(s->port.context);
            return PLR_STEP_IDLE;
        }
        if ((size_t)count > sizeof s->chunk)
            return PLR_STEP_FAILED; /* the port wrote past its bytes: nothing of it is used */
        s->chunk_at = 0;
        s->chunk_count = (unsigned)count;
    }
    return feed_reader(s);
}

void plr_session_finish(plr_session *s) {
    if (s->phase >= PLR_PHASE_STARTING) {
        plr_landmark landmark;
        plr_events_use_all(s);
        if ((s->options.output & PLR_OUTPUT_STATE) != 0)
            plr_saving_save(s, plr_filter_time(&s->filter));
        plr_send_calibration(s);
        for (unsigned slot = 0; slot < plr_filter_landmark_count(&s->filter); slot++)
            if (plr_filter_landmark(&s->filter, slot, &landmark) == PLR_OK)
                plr_send_landmark(s, PLR_LANDMARK_FINAL, &landmark);
    }
    plr_phase_change(&s->phase, PLR_TRIGGER_END);
    plr_send_end(s);
}
