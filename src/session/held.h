// SPDX-License-Identifier: MIT
/*
 * Twists, or readings of an IMU, held back for a late camera: the steps that move the body.
 *
 * A frame that is older than the last step is refused, so with a camera that needs, say, 80 ms
 * from shutter to message the session hands steps to the filter 80 ms late (setting twist-delay).
 * A step is due once a newer one is `delay` ahead of it, or when a frame at or after it is used.
 */
#ifndef PLR_SESSION_HELD_H
#define PLR_SESSION_HELD_H

#include "pelorus/session_parts.h"

void plr_held_init(plr_held_steps *held);

bool plr_held_full(const plr_held_steps *held);

/* Appends a step. The ring may not be full. */
void plr_held_push(plr_held_steps *held, const plr_held_step *step);

/* True if this step's time does not follow the newest one's: then order means nothing any more,
 * and what is held is due. False for an empty ring. */
bool plr_held_contradicts(const plr_held_steps *held, plr_time_ns t_ns);

/* Removes the oldest step, *step, if it is at most at t_ns; false if there is none such. */
bool plr_held_pop_until(plr_held_steps *held, plr_time_ns t_ns, plr_held_step *step);

/* Removes the oldest step if the newest is at least delay_ns ahead of it. */
bool plr_held_pop_due(plr_held_steps *held, plr_time_ns delay_ns, plr_held_step *step);

/* Removes the oldest step; false if there is none. */
bool plr_held_pop(plr_held_steps *held, plr_held_step *step);

/* --- readings --- */

/* Inserts a reading in order of time, behind those of the same time. There must be room. */
void plr_held_insert(plr_held_readings *held, const plr_reading *reading);

/* Removes the oldest reading, *reading, if it is older than t_ns; false if there is none such. */
bool plr_held_pop_older(plr_held_readings *held, plr_time_ns t_ns, plr_reading *reading);

#endif
