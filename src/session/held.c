// SPDX-License-Identifier: MIT
#include "session/held.h"

#include "pelorus/assertions.h"

void plr_held_init(plr_held_twists *held) {
    held->first = 0;
    held->count = 0;
}

bool plr_held_full(const plr_held_twists *held) {
    return held->count == PLR_SESSION_HELD_TWISTS;
}

static const plr_twist_message *newest(const plr_held_twists *held) {
    return &held->twists[(held->first + held->count - 1u) % PLR_SESSION_HELD_TWISTS];
}

void plr_held_push(plr_held_twists *held, const plr_twist_message *twist) {
    PLR_ASSERT(!plr_held_full(held));
    held->twists[(held->first + held->count) % PLR_SESSION_HELD_TWISTS] = *twist;
    held->count++;
}

bool plr_held_contradicts(const plr_held_twists *held, plr_time_ns t_ns) {
    return held->count > 0 && t_ns <= newest(held)->t_ns;
}

bool plr_held_pop(plr_held_twists *held, plr_twist_message *twist) {
    if (held->count == 0)
        return false;
    *twist = held->twists[held->first];
    held->first = (held->first + 1u) % PLR_SESSION_HELD_TWISTS;
    held->count--;
    return true;
}

bool plr_held_pop_until(plr_held_twists *held, plr_time_ns t_ns, plr_twist_message *twist) {
    if (held->count == 0 || held->twists[held->first].t_ns > t_ns)
        return false;
    return plr_held_pop(held, twist);
}

bool plr_held_pop_due(plr_held_twists *held, plr_time_ns delay_ns, plr_twist_message *twist) {
    if (held->count == 0 || newest(held)->t_ns - held->twists[held->first].t_ns < delay_ns)
        return false;
    return plr_held_pop(held, twist);
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
