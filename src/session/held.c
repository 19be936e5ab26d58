// SPDX-License-Identifier: MIT
#include "session/held.h"

#include "pelorus/assertions.h"

void plr_held_init(plr_held_steps *held) {
    held->first = 0;
    held->count = 0;
    held->leads = 0;
}

bool plr_held_full(const plr_held_steps *held) {
    return held->count == PLR_SESSION_HELD_TWISTS;
}

/* The place of the one that `behind` others came before. */
static unsigned place(const plr_held_steps *held, unsigned behind) {
    return (held->first + behind) % PLR_SESSION_HELD_TWISTS;
}

static plr_time_ns newest_ns(const plr_held_steps *held) {
    return held->t_ns[place(held, held->count - 1U)];
}

void plr_held_push(plr_held_steps *held, const plr_held_step *step) {
    PLR_ASSERT(!plr_held_full(held));
    const unsigned at = place(held, held->count);
    const uint64_t bit = UINT64_C(1) << at;
    held->t_ns[at] = step->t_ns;
    held->by[at] = step->by;
    held->leads = step->leads ? held->leads | bit : held->leads & ~bit;
    held->count++;
}

bool plr_held_contradicts(const plr_held_steps *held, plr_time_ns t_ns) {
    return held->count > 0 && t_ns <= newest_ns(held);
}

bool plr_held_pop(plr_held_steps *held, plr_held_step *step) {
    if (held->count == 0)
        return false;
    const unsigned at = held->first;
    step->t_ns = held->t_ns[at];
    step->by = held->by[at];
    step->leads = (held->leads >> at & 1) != 0;
    held->first = (uint8_t)place(held, 1);
    held->count--;
    return true;
}

bool plr_held_pop_until(plr_held_steps *held, plr_time_ns t_ns, plr_held_step *step) {
    if (held->count == 0 || held->t_ns[held->first] > t_ns)
        return false;
    return plr_held_pop(held, step);
}

bool plr_held_pop_due(plr_held_steps *held, plr_time_ns delay_ns, plr_held_step *step) {
    if (held->count == 0 || newest_ns(held) - held->t_ns[held->first] < delay_ns)
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
