// SPDX-License-Identifier: MIT
/* How a drive begins: HEADER, settings, known landmarks, the filter, its start pose. */
#ifndef PLR_SESSION_START_H
#define PLR_SESSION_START_H

#include "pelorus/session.h"

/* Clears what belongs to a drive: counts, settings, START, known landmarks, delayed twists. */
void plr_start_clear(plr_session *s);

/* True if s->in, a HEADER, CONFIG or RIG, equals the one in use. */
bool plr_start_in_force(const plr_session *s);

/* Begins a drive with the HEADER s->in. */
void plr_start_begin(plr_session *s);

/* Adds the settings of the CONFIG s->in, before the data, but for values that are not allowed. */
void plr_start_change_settings(plr_session *s);

/* Stores the START s->in until its time has come, if the options use one. */
void plr_start_keep(plr_session *s);

/* Adds the known LANDMARK s->in to the map. */
void plr_start_add_landmark(plr_session *s);

/* In PLR_PHASE_READY: initialises the filter. An error is sent, and leads to PLR_PHASE_REJECTED. */
plr_status plr_start_filter(plr_session *s);

/* Before the first data: sends the CONFIG in use, landmarks of the option `map`, and warnings. */
void plr_start_announce(plr_session *s);

/* Sets the bias prior of a START, if there is one; also if the pose starts from something else. */
void plr_start_set_bias(plr_session *s);

/* Sets the filter's pose, which is the start pose if none was set before. P_xi as in
 * plr_filter_set_pose. If it is refused, a REPORT of that subject is sent. */
plr_status plr_start_set_pose(plr_session *s, plr_kind subject, plr_time_ns t_ns,
                              const plr_pose *T_WB, const double *P_xi);

/* Sets the pose to that of s->start, and with an IMU the velocity. */
void plr_start_apply(plr_session *s);

/* Call before data of time t_ns: applies the stored START if its time has come. */
void plr_start_apply_until(plr_session *s, plr_time_ns t_ns);

/* Call before a frame of time t_ns: the same; without a START the pose starts where the options
 * say. If they need a START or TRUTH that has not arrived, the phase stays PLR_PHASE_STARTING. */
void plr_start_choose(plr_session *s, plr_time_ns t_ns);

/* From the camera's clock to that of the steps, the setting camera-offset. In mapping there are none:
 * a frame has the time of its TRUTH. */
double plr_camera_offset_s(const plr_config *config);

#endif
