// SPDX-License-Identifier: MIT
/*
 * What an event does: the filter is given a step (a TWIST or a reading of an IMU, as the setting
 * `process` says), a frame or a READING, and the answer is sent. Events come in the order of time:
 * events.h.
 *
 * IMU readings that are refused for the same reason one after the other are answered once; all are
 * counted (totals.imu_refused).
 *
 * A step that comes after a frame or a READING of later time cannot be used any more: it is refused
 * with PLR_E_LATE and counted (totals.late), and a TEXT says how long those would have to wait. For
 * a second after that no fault of the IMU is reported: readings with gaps look faulty.
 */
#ifndef PLR_SESSION_USE_H
#define PLR_SESSION_USE_H

#include "pelorus/session.h"

/* Gives the event to the filter. */
void plr_use(plr_session *s, const plr_event *event);

/* Lowers the budget of a frame to what can be computed before the deadline. */
void plr_use_limit(const plr_session *s, plr_frame *frame);

/* Answers an event that is refused. */
void plr_use_refuse(plr_session *s, const plr_event *event, plr_status status);

#endif
