// SPDX-License-Identifier: MIT
/*
 * A session on the desk: one for a whole test program, its options, and the faulty port that it
 * reads from and answers to.
 */
#ifndef PELORUS_TEST_SESSION_DESK_H
#define PELORUS_TEST_SESSION_DESK_H

#include <stdbool.h>

#include "pelorus/session.h"
#include "support/faulty_port.h"
#include "support/pose_of.h"
#include "support/session_drive.h"

extern plr_session session;
extern plr_session_options options;
extern faulty_port port;

/* What the observer heard first of a refusal since desk_clear. */
extern plr_status refused_status;
extern plr_kind refused_kind;
extern const plr_setting *refused_setting;

/* An empty port that does nothing wrong yet, and default options: for setUp. */
void desk_clear(uint64_t seed);

/* Initialises the session with `options`, which must be accepted. */
void desk_begin(void);

/* The same, and sends the drive's HEADER. */
void desk_begin_drive(void);

void desk_send(plr_message message);

/* A TWIST and a STEREO of the drive every 0.1 s, first .. end-1. */
void desk_send_frames(int first, int end);

/* Steps until the port has nothing more. */
void desk_run(void);

/* The next answer of a kind, which must be there. */
plr_message desk_answer(plr_kind kind);

/* The next REPORT that refuses something; false if there is none. */
bool desk_next_refusal(plr_report_message *report);

/* The next one is of this kind and status. */
void desk_assert_refused(plr_kind subject, plr_status status);

void desk_assert_nothing_refused(void);

/* How many TEXTs hold those words; the next answer is the first again. */
unsigned desk_texts_with(const char *words);

/* Overrides one setting more, two at most, in the options of the next session. */
void desk_use_setting(const char *name, double value);

#endif
