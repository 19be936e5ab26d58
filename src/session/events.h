// SPDX-License-Identifier: MIT
/*
 * The order of time: steps, frames and READINGs as events of one queue, and when they leave it.
 *
 * An event that leaves takes all older ones with it, so none overtakes another. It leaves:
 *
 *     frame     at once, if steps of its time or later have come; else when they come, or when another
 *               frame is newer by twist-delay and what camera-offset moves it ahead
 *     step      at once, without twist-delay and while no frame waits; else when a step has come that
 *               is newer by twist-delay and what camera-offset moves frames back
 *     reading   at once, where a step would; else with the next step or frame
 *     each      if its kind has no room left (totals.held_short), if an event of its kind is behind it
 *               by more than max-gap, which is another clock, and at END
 *
 * Messages alone tell the time, so that a replay does the same. The message is in s->in, and the
 * filter must be initialised.
 */
#ifndef PLR_SESSION_EVENTS_H
#define PLR_SESSION_EVENTS_H

#include "pelorus/session.h"

/* TWIST and IMU. Of the other process (TWIST with imu, IMU with twist) the first message of a drive
 * is refused with a TEXT that says what would be right; the others are only counted. */
void plr_events_take_twist(plr_session *s);
void plr_events_take_imu(plr_session *s);

/* STEREO, READING, TRUTH and a START among the data. */
void plr_events_take_stereo(plr_session *s);
void plr_events_take_reading(plr_session *s);
void plr_events_take_truth(plr_session *s);
void plr_events_take_start(plr_session *s);

/* Uses the frames before t_ns. */
void plr_events_use_frames_before(plr_session *s, plr_time_ns t_ns);

/* Uses all that waits. */
void plr_events_use_all(plr_session *s);

#endif
