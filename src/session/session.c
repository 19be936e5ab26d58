// SPDX-License-Identifier: MIT
#include "pelorus/session.h"

#include <string.h>

#include "session/data.h"
#include "session/input.h"
#include "session/layers.h"
#include "session/phase.h"
#include "session/saving.h"
#include "session/send.h"
#include "session/start.h"
#include "session/steps.h"

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
    switch (event) {
    case PLR_READ_MESSAGE:
        s->last_skip = PLR_SKIP_NONE;
        plr_input_handle(s);
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
        plr_data_use_waiting(s, UINT64_MAX);
        plr_steps_apply_held(s, UINT64_MAX);
        if ((s->options.output & PLR_OUTPUT_STATE) != 0)
            plr_saving_save(s, plr_filter_time(&s->filter));
        for (unsigned slot = 0; slot < plr_filter_landmark_count(&s->filter); slot++)
            if (plr_filter_landmark(&s->filter, slot, &landmark) == PLR_OK)
                plr_send_landmark(s, PLR_LANDMARK_FINAL, &landmark);
    }
    plr_phase_change(&s->phase, PLR_EVENT_END);
    plr_send_end(s);
}
