// SPDX-License-Identifier: MIT
/* The firmware: runs a session over the link until the board is reset. */
#include <string.h>

#include "board.h"
#include "clock.h"
#include "core.h"
#include "eyes.h"
#include "fault.h"
#include "pelorus/pelorus.h"
#include "pelorus/session.h"
#include "pelorus/state_store.h"
#include "port_serial.h"
#include "sensors.h"
#include "serial.h"
#include "startup.h"
#include "telemetry.h"
#include "text.h"

/* Landmarks of known position that the board can be given: a map for mode localization. */
enum { KNOWN_LANDMARKS = 64 };

static plr_session session;
static plr_landmark known[KNOWN_LANDMARKS];
static plr_state_store store;
static plr_message message; /* the firmware's own */

/* The first frames after a reset. A host that receives the REPORT during a drive knows that the board
 * has lost its state; the TEXT tells people the name of the board, its build, and why it started. */
static void announce(void) {
    static text words;
    const uint8_t delimiter = 0; /* ends a frame that the reset may have cut */
    (void)serial_write(&serial_link, &delimiter, 1);
    message.kind = PLR_KIND_REPORT;
    message.as.report.notice = PLR_NOTICE_STARTED;
    message.as.report.report.budget = PLR_NO_BUDGET;
    (void)plr_writer_put(&session.writer, &message);
    text_clear(&words);
    text_add(&words, "pelorus ");
    text_add(&words, plr_version());
    text_add(&words, " on ");
    text_add(&words, board_name);
    text_add(&words, ", build ");
    text_add_hex(&words, plr_build_fingerprint());
    text_add(&words, ": ");
    fault_add_history(&words);
    message.kind = PLR_KIND_TEXT;
    message.as.text.severity = fault_count() == 0 ? PLR_SEVERITY_INFO : PLR_SEVERITY_WARNING;
    memcpy(message.as.text.text, words.characters, words.length + 1);
    (void)plr_writer_put(&session.writer, &message);
}

/* Cameras and IMU of the board's own: what is wrong with them, or NULL, people are told. */
static void tell_trouble(const char *trouble) {
    if (trouble != NULL) {
        message.kind = PLR_KIND_TEXT;
        message.as.text.severity = PLR_SEVERITY_ERROR;
        strncpy(message.as.text.text, trouble, PLR_WIRE_MAX_TEXT);
        (void)plr_writer_put(&session.writer, &message);
    }
}

/* Where a state is kept, or NULL where the board has no such place. */
static plr_state_store *storage(void) {
    plr_block_device device;
    return board_storage(&device) && plr_state_store_init(&store, &device) == PLR_OK ? &store
                                                                                     : NULL;
}

int main(void) {
    board_init();
    clock_start(board_core_hz());
    serial_start(&serial_link);
    board_watchdog_start();
    core_irq_on();
    const plr_port port = port_serial();
    plr_session_options options;
    plr_session_options_default(&options);
    options.known = known;
    options.known_capacity = KNOWN_LANDMARKS;
    options.store = storage();
    options.eyes = firmware_eyes();
    options.output |= sensors_output;
    options.observer = telemetry_observer(&session);
    if (plr_session_init(&session, &port, &options) != PLR_OK) {
        return 1; /* startup resets the board: only a broken build comes here */
    }
    announce();
    tell_trouble(sensors_start());
    for (;;) {
        (void)plr_session_step(&session);
        tell_trouble(sensors_step(&session));
    }
}
