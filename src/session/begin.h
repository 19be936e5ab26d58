// SPDX-License-Identifier: MIT
/* How a session gets from a HEADER to a running filter with a start pose. */
#ifndef PLR_SESSION_BEGIN_H
#define PLR_SESSION_BEGIN_H

#include "pelorus/session.h"

/* Forgets everything that came before: counts, settings, START, known landmarks, held twists. */
void plr_begin_anew(plr_session *s);

/* Composes the settings and initialises the filter. False if there is no HEADER, or if what it says
 * makes no sense, which is refused once. */
bool plr_begin_filter(plr_session *s);

/* From here on the filter takes data: sends the CONFIG in force. */
void plr_begin_announce(plr_session *s);

/* Makes sure that the filter runs: at the first data after a HEADER it does both. False where
 * plr_begin_filter says so. */
bool plr_begin_running(plr_session *s);

/* Sets the start pose from START if its time has come. Called before data of time t_ns. */
void plr_begin_at(plr_session *s, plr_time_ns t_ns);

/* Before the first frame: decides where the pose starts. False if the frame must wait for the START
 * or TRUTH that the options ask for. */
bool plr_begin_frame(plr_session *s, plr_time_ns t_ns);

/* Sets the pose, and counts it as a start if none was set before. P_xi as in plr_filter_set_pose.
 * A refusal is sent with that subject. */
void plr_begin_set_pose(plr_session *s, plr_kind subject, plr_time_ns t_ns, const plr_pose *T_WB,
                        const double *P_xi);

/* Sets the pose to that of s->start. */
void plr_begin_apply_start(plr_session *s);

#endif
