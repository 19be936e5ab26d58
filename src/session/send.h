// SPDX-License-Identifier: MIT
/* What a session sends, and what it shows to its observer. Each message is sent only if its bit of
 * plr_session_options.output is set; the observer sees it in any case. A message that the port does
 * not take is counted, and the loop goes on. */
#ifndef PLR_SESSION_SEND_H
#define PLR_SESSION_SEND_H

#include "pelorus/session.h"

/* The message that just came in. */
void plr_send_echo(plr_session *s);

/* The settings in force, and the build. */
void plr_send_config(plr_session *s);

/* The estimate at the filter's time. Valid until the next plr_send_*; NULL if there is none. */
const plr_pose_message *plr_send_pose(plr_session *s, bool after_update);

/* From here on a POSE counts its resets. */
void plr_send_resets_from_here(plr_session *s);

/* The report of a frame. */
void plr_send_report(plr_session *s, const plr_report *report, uint64_t compute_ns);

/* A REPORT that says what came of a message that is no frame, with the health of the last frame. */
void plr_send_answer(plr_session *s, plr_kind subject, plr_time_ns t_ns, plr_status status);

/* The REPORT that answers a STATE that was done. */
void plr_send_state_answer(plr_session *s, plr_time_ns t_ns, plr_notice notice);

/* A message was refused: counted, shown, and sent as a REPORT. `culprit` is the setting to change,
 * or NULL. */
void plr_send_refusal(plr_session *s, plr_kind subject, plr_time_ns t_ns, plr_status status,
                      const plr_setting *culprit);

/* One that the filter computed; or a known one, of options.map, as an echo: with it a flight log can
 * be replayed without the map. */
void plr_send_landmark(plr_session *s, plr_landmark_role role, const plr_landmark *landmark);

/* A line, built with session/line.h in s->out.as.text. */
void plr_send_text(plr_session *s);

/* How many messages arrived in this drive, of those kinds of which the END that came in tells another
 * number. */
void plr_send_describe_end(const plr_session *s, plr_end *end);

void plr_send_end(plr_session *s);

#endif
