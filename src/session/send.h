// SPDX-License-Identifier: MIT
/* The messages that a session sends. Each is sent only if its bit of plr_session_options.output is
 * set; the observer, a struct of functions of the host application, is called in any case. If the
 * port cannot send a message, it is lost and counted, and the session continues. */
#ifndef PLR_SESSION_SEND_H
#define PLR_SESSION_SEND_H

#include "pelorus/session.h"

/* Sends the message that was just received, so that the output can be replayed. */
void plr_send_echo(plr_session *s);

/* Sends the settings in use, and the build. */
void plr_send_config(plr_session *s);

/* Sends the estimate. Returns it, valid until the next plr_send_*, or NULL if there is none. */
const plr_pose_message *plr_send_pose(plr_session *s, bool after_update);

/* reset_count of POSE, before it is cut to 16 bits; and to make it another number. */
uint32_t plr_send_resets(const plr_session *s);
void plr_send_resets_become(plr_session *s, uint32_t number);

/* Sends the report of a frame. */
void plr_send_report(plr_session *s, const plr_report *report, uint64_t compute_ns);

/* Sends the calibration, if it is estimated. */
void plr_send_calibration(plr_session *s);

/* Answers a message other than a STEREO: a REPORT with the last frame's health, and the notice. */
void plr_send_answer(plr_session *s, plr_kind subject, plr_time_ns t_ns, plr_status status,
                     plr_notice notice);

/* Counts a refusal, tells the observer, sends a REPORT. culprit: the setting to change, or NULL. */
void plr_send_refusal(plr_session *s, plr_kind subject, plr_time_ns t_ns, plr_status status,
                      const plr_setting *culprit);

/* The same of a frame, whose observer is told too. */
void plr_send_frame_refusal(plr_session *s, const plr_frame *frame, plr_status status);

/* Sends a landmark: a computed one, or one of options.map, so that a log is complete without it. */
void plr_send_landmark(plr_session *s, plr_landmark_role role, const plr_landmark *landmark);

/* Sends the text in s->out.as.text, which was built with session/line.h. */
void plr_send_text(plr_session *s);

/* Sends one whole text. */
void plr_send_words(plr_session *s, plr_severity severity, const char *words);

/* Fills in `differs` and `arrived`: where what came and what the last END says are not the same. */
void plr_send_describe_end(const plr_session *s, plr_end *end);

void plr_send_end(plr_session *s);

#endif
