// SPDX-License-Identifier: MIT
/*
 * From pictures to a pose: replays a recording with pictures that is part of the image through a session with
 * eyes, and writes a line of text for each pair: the core clocks that eyes took and those of the frame's update, and
 * the CRC of observations and pose, which the desk's are held against. Clocks as in main_bench.c.
 */
#include <string.h>

#include "board.h"
#include "clock.h"
#include "core.h"
#include "eyes.h"
#include "pelorus/pelorus.h"
#include "pelorus/session.h"
#include "serial.h"
#include "startup.h"
#include "text.h"

/* From bench_recording.S. */
extern const uint8_t bench_recording[], bench_recording_end[];

enum { KNOWN_LANDMARKS = 64 }; /* as in the firmware, whose memory this is to need */

static plr_session session;
static plr_landmark known[KNOWN_LANDMARKS];
static const uint8_t *at;
static uint32_t look_clocks, look_ended;
static const plr_eyes_calls *calls;
static text line;

static int read_recording(void *context, uint8_t *bytes, size_t n) {
    const size_t left = (size_t)(bench_recording_end - at), taken = n < left ? n : left;
    (void)context;
    if (taken == 0) {
        return PLR_PORT_CLOSED;
    }
    memcpy(bytes, at, taken);
    at += taken;
    return (int)taken;
}

static void feed_watchdog(void *context) {
    (void)context;
    board_watchdog_feed();
}

/* The counter runs down, in 24 bits. */
static plr_status timed_look(plr_eyes *e, const plr_picture_pair *pair, bool place_known,
                             plr_frame *frame) {
    const uint32_t start = SYST_CVR;
    const plr_status status = calls->look(e, pair, place_known, frame);
    look_ended = SYST_CVR;
    look_clocks = (start - look_ended) & SYST_MAX;
    return status;
}

static uint32_t crc_of_pose(const plr_pose_message *pose) {
    const uint32_t crc = plr_crc32(0, (const uint8_t *)&pose->T_WB, sizeof pose->T_WB);
    return plr_crc32(crc, (const uint8_t *)pose->P_xi, sizeof pose->P_xi);
}

static uint32_t crc_of_frame(const plr_frame *frame) {
    return plr_crc32(0, (const uint8_t *)frame->observations,
                     frame->count * sizeof *frame->observations);
}

static void on_frame(void *context, const plr_frame_result *result) {
    const uint32_t update = (look_ended - SYST_CVR) & SYST_MAX;
    (void)context;
    text_add_field(&line, "pair", result->frame->t_ns);
    text_add_field(&line, "look", look_clocks);
    text_add_field(&line, "update", update);
    text_add_field(&line, "observations", result->frame->count);
    text_add_field(&line, "used", result->report->used);
    text_add_field(&line, "seen", crc_of_frame(result->frame));
    text_add_field(&line, "pose", result->pose != NULL ? crc_of_pose(result->pose) : 0);
    text_put_line(&line);
}

static void on_refused(void *context, plr_kind subject, plr_time_ns t_ns, plr_status status,
                       const plr_setting *culprit) {
    (void)context;
    (void)culprit;
    text_add_field(&line, "refused", (uint64_t)subject);
    text_add_field(&line, "at", t_ns);
    text_add(&line, plr_status_text(status));
    text_put_line(&line);
}

int main(void) {
    static plr_eyes_calls timed;
    board_init();
    SYST_RVR = SYST_MAX;
    SYST_CVR = 0;
    SYST_CSR = SYST_CSR_ENABLE | SYST_CSR_CORE_CLOCK; /* counts, and does not interrupt */
    const plr_port port = {.read = read_recording, .feed_watchdog = feed_watchdog};
    plr_session_options options;
    plr_session_options_default(&options);
    options.known = known;
    options.known_capacity = KNOWN_LANDMARKS;
    options.observer.frame = on_frame;
    options.observer.refused = on_refused;
    options.eyes = firmware_eyes();
    if (options.eyes != NULL) {
        calls = options.eyes->calls;
        timed = *calls;
        timed.look = timed_look;
        options.eyes->calls = &timed;
    }
    text_add_field(&line, "size eyes", sizeof(plr_eyes));
    text_add_field(&line, "session", sizeof(plr_session));
    text_add_field(&line, "pixels", PLR_VISION_PIXELS);
    text_add_field(&line, "hz", board_core_hz());
    text_put_line(&line);
    at = bench_recording;
    if (plr_session_init(&session, &port, &options) != PLR_OK) {
        return 1;
    }
    while (plr_session_step(&session) != PLR_STEP_CLOSED) {
    }
    text_add_field(&line, "done stack", stack_used());
    text_put_line(&line);
    for (;;) {
        board_watchdog_feed();
    }
}
