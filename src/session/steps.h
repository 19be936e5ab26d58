// SPDX-License-Identifier: MIT
/*
 * What a step does: a TWIST or a reading of an IMU, as the setting `process` says; and what a READING
 * of a small sensor does. Both come in the order of time (events.h).
 *
 * IMU readings that are refused for the same reason one after the other are answered once; all are
 * counted (totals.imu_refused).
 *
 * A step that comes after a frame or a READING of later time cannot be used any more: it is refused
 * with PLR_E_LATE and counted (totals.late), and a TEXT says how long those would have to wait. For
 * a second after that no fault of the IMU is reported: readings with gaps look faulty.
 */
#ifndef PLR_SESSION_STEPS_H
#define PLR_SESSION_STEPS_H

#include "pelorus/session.h"

/* Gives the filter an event that is a step, or one that is a reading. */
void plr_steps_use(plr_session *s, const plr_event *event);
void plr_steps_use_reading(plr_session *s, const plr_reading *reading);

/* Answers a step that is refused. */
void plr_steps_refuse(plr_session *s, plr_time_ns t_ns, plr_status status);

/* Notes that a step of this time arrived. */
void plr_steps_note_arrival(plr_session *s, plr_time_ns t_ns);

/* Notes that the filter used a frame or a reading of a small sensor of this time. */
void plr_steps_note_used(plr_session *s, plr_time_ns t_ns);

/* True if the setting `process` is imu. */
bool plr_steps_are_inertial(const plr_session *s);

#endif
