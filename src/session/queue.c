// SPDX-License-Identifier: MIT
#include "session/queue.h"

#include <string.h>

#include "pelorus/assertions.h"

/* Where the places of each kind begin, and, at the end, how many places there are. */
static const uint8_t begins[PLR_EVENT_KINDS + 1] = {
    [PLR_EVENT_STEP] = 0,
    [PLR_EVENT_FRAME] = PLR_SESSION_HELD_TWISTS,
    [PLR_EVENT_READING] = PLR_SESSION_HELD_TWISTS + PLR_SESSION_HELD_FRAMES,
    [PLR_EVENT_KINDS] = PLR_QUEUE_PLACES,
};

static plr_event_kind kind_of(unsigned place) {
    unsigned kind = 0;
    PLR_ASSERT(place < PLR_QUEUE_PLACES);
    while (place >= begins[kind + 1])
        kind++;
    return (plr_event_kind)kind;
}

static unsigned count_all(const plr_queue *queue) {
    unsigned count = 0;
    for (unsigned kind = 0; kind < PLR_EVENT_KINDS; kind++)
        count += queue->counts[kind];
    PLR_ASSERT(count <= PLR_QUEUE_PLACES);
    return count;
}

void plr_queue_clear(plr_queue *queue) {
    memset(queue->counts, 0, sizeof queue->counts);
    for (unsigned i = 0; i < PLR_QUEUE_PLACES; i++)
        queue->order[i] = (uint8_t)i;
}

bool plr_queue_is_full(const plr_queue *queue, plr_event_kind kind) {
    return queue->counts[kind] == begins[kind + 1] - begins[kind];
}

bool plr_queue_holds(const plr_queue *queue, plr_event_kind kind, plr_time_ns t_ns) {
    for (unsigned i = count_all(queue); i > 0; i--)
        if (queue->t_ns[queue->order[i - 1]] == t_ns && kind_of(queue->order[i - 1]) == kind)
            return true;
    return false;
}

/* --- payload --- */

static void store(plr_queue *queue, unsigned place, const plr_event *event) {
    const unsigned at = place - begins[event->kind];
    queue->t_ns[place] = event->t_ns;
    if (event->kind == PLR_EVENT_STEP) {
        queue->steps[at] = event->as.step;
        queue->leads[at] = event->leads;
    } else if (event->kind == PLR_EVENT_READING) {
        queue->readings[at] = event->as.reading;
    } else {
        const plr_frame *frame = &event->as.frame;
        PLR_ASSERT(frame->count <= PLR_MAX_OBSERVATIONS);
        memcpy(queue->observations[at], frame->observations,
               frame->count * sizeof *frame->observations);
        queue->frames[at] = *frame;
        queue->frames[at].observations = queue->observations[at];
    }
}

static void load(const plr_queue *queue, unsigned place, plr_event *event) {
    event->t_ns = queue->t_ns[place];
    event->kind = kind_of(place);
    const unsigned at = place - begins[event->kind];
    event->leads = event->kind == PLR_EVENT_STEP && queue->leads[at];
    if (event->kind == PLR_EVENT_STEP)
        event->as.step = queue->steps[at];
    else if (event->kind == PLR_EVENT_READING)
        event->as.reading = queue->readings[at];
    else
        event->as.frame = queue->frames[at];
}

/* --- order --- */

/* True if an event of t_ns and `kind` goes before the one at that place. */
static bool overtakes(const plr_queue *queue, plr_time_ns t_ns, plr_event_kind kind,
                      unsigned place) {
    const plr_time_ns there_ns = queue->t_ns[place];
    return t_ns < there_ns || (t_ns == there_ns && kind < kind_of(place));
}

void plr_queue_insert(plr_queue *queue, const plr_event *event) {
    PLR_ASSERT(!plr_queue_is_full(queue, event->kind));
    uint8_t *order = queue->order;
    unsigned at = count_all(queue), free = at;
    while (kind_of(order[free]) != event->kind)
        free++;
    const uint8_t place = order[free];
    while (at > 0 && overtakes(queue, event->t_ns, event->kind, order[at - 1]))
        at--;
    memmove(order + at + 1, order + at, free - at);
    order[at] = place;
    queue->counts[event->kind]++;
    store(queue, place, event);
}

bool plr_queue_pop_until(plr_queue *queue, plr_time_ns t_ns, plr_event_kind kind,
                         plr_event *event) {
    const unsigned count = count_all(queue);
    const uint8_t place = queue->order[0];
    if (count == 0 || overtakes(queue, t_ns, kind, place))
        return false;
    load(queue, place, event);
    memmove(queue->order, queue->order + 1, count - 1U);
    queue->order[count - 1U] = place;
    queue->counts[event->kind]--;
    return true;
}

bool plr_queue_first_ns(const plr_queue *queue, plr_event_kind kind, plr_time_ns *t_ns) {
    if (queue->counts[kind] == 0)
        return false;
    unsigned i = 0;
    while (kind_of(queue->order[i]) != kind)
        i++;
    *t_ns = queue->t_ns[queue->order[i]];
    return true;
}

plr_time_ns plr_queue_last_ns(const plr_queue *queue, plr_event_kind kind) {
    if (queue->counts[kind] == 0)
        return 0;
    unsigned i = count_all(queue) - 1U;
    while (kind_of(queue->order[i]) != kind)
        i--;
    return queue->t_ns[queue->order[i]];
}
