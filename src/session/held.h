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

/* Inserts a step in the order of time; there must be room. False: one of its time is there. */
bool plr_held_insert(plr_held_steps *held, const plr_held_step *step);

/* The time of the newest step; 0 if there is none. */
plr_time_ns plr_held_newest_ns(const plr_held_steps *held);

/* Removes the oldest step, *step, if it is at most at until_ns; false if there is none such. */
bool plr_held_pop(plr_held_steps *held, plr_time_ns until_ns, plr_held_step *step);

/* --- frames --- */

/* True if a frame of that time, by its sender's clock, is among them. */
bool plr_held_has_frame(const plr_held_frames *held, plr_time_ns t_ns);

/* Inserts a frame, with its observations, in the order of moved_ns. There must be room. */
void plr_held_insert_frame(plr_held_frames *held, const plr_frame *frame, plr_time_ns moved_ns);

/* moved_ns of the newest frame; 0 if there is none. */
plr_time_ns plr_held_newest_frame_ns(const plr_held_frames *held);

/* Removes the oldest frame, if its moved_ns is at most until_ns: it holds until the next one is
 * inserted. NULL if there is none such. */
const plr_held_frame *plr_held_pop_frame(plr_held_frames *held, plr_time_ns until_ns);

/* --- readings --- */

/* Inserts a reading in order of time, behind those of the same time. There must be room. */
void plr_held_insert_reading(plr_held_readings *held, const plr_reading *reading);

/* Removes the oldest reading, *reading, if it is older than t_ns; false if there is none such. */
bool plr_held_pop_older(plr_held_readings *held, plr_time_ns t_ns, plr_reading *reading);

#endif
