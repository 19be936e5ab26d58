// SPDX-License-Identifier: MIT
/*
 * The queue of events: steps, frames and readings of small sensors that wait for each other, in the
 * order in which they are used. That is the order of time; of one time steps come first, then
 * frames, then readings, and of one kind the first that came. When an event leaves: events.h.
 */
#ifndef PLR_SESSION_QUEUE_H
#define PLR_SESSION_QUEUE_H

#include "pelorus/session_parts.h"

/* Empties it. Call before anything else. */
void plr_queue_clear(plr_queue *queue);

/* True if the queue has no room for another event of that kind. */
bool plr_queue_is_full(const plr_queue *queue, plr_event_kind kind);

/* True if an event of that kind and time is in the queue. */
bool plr_queue_holds(const plr_queue *queue, plr_event_kind kind, plr_time_ns t_ns);

/* Copies an event into the queue, a frame with its observations. There must be room. */
void plr_queue_insert(plr_queue *queue, const plr_event *event);

/* Removes the first event, *event, unless it goes after an event of that time and kind; false if it
 * does, or if there is none. The observations of a frame stay valid until the next insertion. */
bool plr_queue_pop_until(plr_queue *queue, plr_time_ns t_ns, plr_event_kind kind, plr_event *event);

/* The time of the first event of that kind, in *t_ns; false if there is none. */
bool plr_queue_first_ns(const plr_queue *queue, plr_event_kind kind, plr_time_ns *t_ns);

#endif
