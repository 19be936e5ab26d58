// SPDX-License-Identifier: MIT
#include "session/held.h"

#include "pelorus/assertions.h"

void plr_held_init(plr_held_steps *held) {
    held->first = 0;
    held->count = 0;
}

bool plr_held_full(const plr_held_steps *held) {
    return held->count == PLR_SESSION_HELD_TWISTS;
}

static const plr_held_step *newest(const plr_held_steps *held) {
    return &held->steps[(held->first + held->count - 1u) % PLR_SESSION_HELD_TWISTS];
}

void plr_held_push(plr_held_steps *held, const plr_held_step *step) {
    PLR_ASSERT(!plr_held_full(held));
    held->steps[(held->first + held->count) % PLR_SESSION_HELD_TWISTS] = *step;
    held->count++;
}

bool plr_held_contradicts(const plr_held_steps *held, plr_time_ns t_ns) {
    return held->count > 0 && t_ns <= newest(held)->t_ns;
}

bool plr_held_pop(plr_held_steps *held, plr_held_step *step) {
    if (held->count == 0)
        return false;
    *step = held->steps[held->first];
    held->first = (held->first + 1u) % PLR_SESSION_HELD_TWISTS;
    held->count--;
    return true;
}

bool plr_held_pop_until(plr_held_steps *held, plr_time_ns t_ns, plr_held_step *step) {
    if (held->count == 0 || held->steps[held->first].t_ns > t_ns)
        return false;
    return plr_held_pop(held, step);
}

bool plr_held_pop_due(plr_held_steps *held, plr_time_ns delay_ns, plr_held_step *step) {
    if (held->count == 0 || newest(held)->t_ns - held->steps[held->first].t_ns < delay_ns)
        return false;
    return plr_held_pop(held, step);
}

void plr_held_insert(plr_held_readings *held, const plr_reading *reading) {
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
