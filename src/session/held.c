// SPDX-License-Identifier: MIT
#include "session/held.h"

#include <string.h>

#include "pelorus/assertions.h"

/* --- steps --- */

/* The place of the one that `behind` others came before. */
static unsigned place(const plr_held_steps *held, unsigned behind) {
    return (held->first + behind) % PLR_SESSION_HELD_TWISTS;
}

static plr_held_step step_at(const plr_held_steps *held, unsigned at) {
    const plr_held_step step = {
        .t_ns = held->t_ns[at], .by = held->by[at], .leads = (held->leads >> at & 1) != 0};
    return step;
}

static void put(plr_held_steps *held, unsigned at, const plr_held_step *step) {
    const uint64_t bit = UINT64_C(1) << at;
    held->t_ns[at] = step->t_ns;
    held->by[at] = step->by;
    held->leads = step->leads ? held->leads | bit : held->leads & ~bit;
}

bool plr_held_insert(plr_held_steps *held, const plr_held_step *step) {
    PLR_ASSERT(held->count < PLR_SESSION_HELD_TWISTS);
    unsigned at = held->count;
    while (at > 0 && held->t_ns[place(held, at - 1U)] > step->t_ns)
        at--;
    if (at > 0 && held->t_ns[place(held, at - 1U)] == step->t_ns)
        return false;
    for (unsigned i = held->count++; i > at; i--) {
        const plr_held_step later = step_at(held, place(held, i - 1U));
        put(held, place(held, i), &later);
    }
    put(held, place(held, at), step);
    return true;
}

plr_time_ns plr_held_newest_ns(const plr_held_steps *held) {
    return held->count > 0 ? held->t_ns[place(held, held->count - 1U)] : 0;
}

bool plr_held_pop(plr_held_steps *held, plr_time_ns until_ns, plr_held_step *step) {
    if (held->count == 0 || held->t_ns[held->first] > until_ns)
        return false;
    *step = step_at(held, held->first);
    held->first = (uint8_t)place(held, 1);
    held->count--;
    return true;
}

/* --- frames --- */

/* As `place`, of frames. */
static unsigned frame_place(const plr_held_frames *held, unsigned behind) {
    return (held->first + behind) % PLR_SESSION_HELD_FRAMES;
}

static void copy_frame(plr_held_frame *to, const plr_frame *frame, plr_time_ns moved_ns) {
    to->frame = *frame;
    to->moved_ns = moved_ns;
    memcpy(to->observations, frame->observations, frame->count * sizeof *frame->observations);
    to->frame.observations = to->observations;
}

bool plr_held_has_frame(const plr_held_frames *held, plr_time_ns t_ns) {
    for (unsigned i = 0; i < held->count; i++)
        if (held->frames[frame_place(held, i)].frame.t_ns == t_ns)
            return true;
    return false;
}

void plr_held_insert_frame(plr_held_frames *held, const plr_frame *frame, plr_time_ns moved_ns) {
    PLR_ASSERT(held->count < PLR_SESSION_HELD_FRAMES && frame->count <= PLR_MAX_OBSERVATIONS);
    plr_held_frame *to = &held->frames[frame_place(held, held->count)];
    for (unsigned at = held->count++; at > 0; at--) {
        plr_held_frame *before = &held->frames[frame_place(held, at - 1U)];
        if (before->moved_ns <= moved_ns)
            break;
        copy_frame(to, &before->frame, before->moved_ns);
        to = before;
    }
    copy_frame(to, frame, moved_ns);
}

plr_time_ns plr_held_newest_frame_ns(const plr_held_frames *held) {
    return held->count > 0 ? held->frames[frame_place(held, held->count - 1U)].moved_ns : 0;
}

const plr_held_frame *plr_held_pop_frame(plr_held_frames *held, plr_time_ns until_ns) {
    const plr_held_frame *oldest = &held->frames[held->first];
    if (held->count == 0 || oldest->moved_ns > until_ns)
        return NULL;
    held->first = (uint8_t)frame_place(held, 1);
    held->count--;
    return oldest;
}

/* --- readings --- */

void plr_held_insert_reading(plr_held_readings *held, const plr_reading *reading) {
    PLR_ASSERT(held->count < PLR_SESSION_HELD_READINGS);
    unsigned at = held->count++;
    for (; at > 0 && held->readings[at - 1].t_ns > reading->t_ns; at--)
        held->readings[at] = held->readings[at - 1];
    held->readings[at] = *reading;
}

bool plr_held_pop_older(plr_held_readings *held, plr_time_ns t_ns, plr_reading *reading) {
    if (held->count == 0 || held->readings[0].t_ns >= t_ns)
        return false;
    *reading = held->readings[0];
    held->count--;
    for (unsigned i = 0; i < held->count; i++)
        held->readings[i] = held->readings[i + 1];
    return true;
}
