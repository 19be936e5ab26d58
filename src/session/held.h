// SPDX-License-Identifier: MIT
/*
 * What waits, so that the filter is given everything in the order of time (setting twist-delay).
 *
 * Steps, the twists or readings of an IMU that move the body, wait for a late camera, since a frame
 * older than the last step is refused. A step is due once a newer one is `delay` ahead of it, or
 * when a frame at or after it is used. Frames wait for late steps, which may come in batches:
 * data.h.
 */
#ifndef PLR_SESSION_HELD_H
#define PLR_SESSION_HELD_H

#include "pelorus/session_parts.h"

/* --- steps --- */

bool plr_held_full(const plr_held_steps *held);

/* Inserts a step in the order of time. False, and nothing changes, if there is one of its time: it
 * came twice. The ring may not be full. */
bool plr_held_insert(plr_held_steps *held, const plr_held_step *step);

/* True if this step's time lies more than max_gap_ns before the newest one's: then order means
 * nothing any more, and what is held is due. False for an empty ring. */
bool plr_held_contradicts(const plr_held_steps *held, plr_time_ns t_ns, plr_time_ns max_gap_ns);

/* Removes the oldest step, *step, if it is at most at t_ns; false if there is none such. */
bool plr_held_pop_until(plr_held_steps *held, plr_time_ns t_ns, plr_held_step *step);

/* Removes the oldest step if the newest is at least delay_ns ahead of it. */
bool plr_held_pop_due(plr_held_steps *held, plr_time_ns delay_ns, plr_held_step *step);

/* Removes the oldest step; false if there is none. */
bool plr_held_pop(plr_held_steps *held, plr_held_step *step);

/* --- frames --- */

/* True if a frame of that time, by its sender's clock, is among them. */
bool plr_held_has_frame(const plr_held_frames *held, plr_time_ns t_ns);

/* Inserts a frame, with its observations, in the order of moved_ns. There must be room. */
void plr_held_insert_frame(plr_held_frames *held, const plr_frame *frame, plr_time_ns moved_ns);

/* The oldest and the newest frame; NULL if there is none. */
const plr_held_frame *plr_held_oldest_frame(const plr_held_frames *held);
const plr_held_frame *plr_held_newest_frame(const plr_held_frames *held);

/* Removes the oldest frame, which is there; it holds until the next one is inserted. */
const plr_held_frame *plr_held_pop_frame(plr_held_frames *held);

/* --- readings --- */

/* Inserts a reading in order of time, behind those of the same time. There must be room. */
void plr_held_insert_reading(plr_held_readings *held, const plr_reading *reading);

/* Removes the oldest reading, *reading, if it is older than t_ns; false if there is none such. */
bool plr_held_pop_older(plr_held_readings *held, plr_time_ns t_ns, plr_reading *reading);

#endif
