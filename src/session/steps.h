// SPDX-License-Identifier: MIT
/*
 * What moves the body: TWIST or IMU, as the setting `process` says, and the READINGs of small
 * sensors among them. With the setting twist-delay all of them wait, and while a frame waits for
 * them (data.h). The message is in s->in.
 *
 * Of the other process (TWIST with imu, IMU with twist) one message a drive is refused, with a TEXT
 * that says what would be right; the others are only counted. IMU readings that are refused for the
 * same reason one after the other are answered once; all are counted (totals.imu_refused).
 *
 * A step that comes after a frame or a reading of later time cannot be used any more: it is refused
 * with PLR_E_LATE, counted (totals.late), and a TEXT says how long those would have to wait. While
 * that goes on no fault of the IMU is told: of readings with holes nearly everything looks wrong.
 */
#ifndef PLR_SESSION_STEPS_H
#define PLR_SESSION_STEPS_H

#include "pelorus/session.h"

/* Each applies its message to the filter, which must be initialised, or delays it. */
void plr_steps_use_twist(plr_session *s);
void plr_steps_use_imu(plr_session *s);
void plr_steps_use_reading(plr_session *s);

/* Applies those of the delayed ones whose time is at most until_ns. */
void plr_steps_apply_held(plr_session *s, plr_time_ns until_ns);

/* Applies those that have waited for twist-delay. */
void plr_steps_apply_due(plr_session *s);

/* The filter took a frame or a reading of a small sensor of this time. */
void plr_steps_note_used(plr_session *s, plr_time_ns t_ns);

#endif
