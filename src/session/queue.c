// SPDX-License-Identifier: MIT
#include "session/queue.h"

#include <string.h>

#include "pelorus/assertions.h"

/* Where the places of each kind begin; those of the last one end at PLR_QUEUE_PLACES. */
enum {
    FRAMES = PLR_SESSION_HELD_TWISTS,
    READINGS = FRAMES + PLR_SESSION_HELD_FRAMES,
};

static plr_event_kind kind_of(unsigned place) {
    PLR_ASSERT(place < PLR_QUEUE_PLACES);
    return place < FRAMES ? PLR_EVENT_STEP : place < READINGS ? PLR_EVENT_FRAME : PLR_EVENT_READING;
}

void plr_queue_clear(plr_queue *queue) {
    queue->count = 0;
    memset(queue->counts, 0, sizeof queue->counts);
    for (unsigned i = 0; i < PLR_QUEUE_PLACES; i++)
        queue->order[i] = (uint8_t)i;
}

bool plr_queue_is_full(const plr_queue *queue, plr_event_kind kind) {
    static const uint8_t places[PLR_EVENT_KINDS] = {
        PLR_SESSION_HELD_TWISTS, PLR_SESSION_HELD_FRAMES, PLR_SESSION_HELD_READINGS};
    return queue->counts[kind] == places[kind];
}

bool plr_queue_holds(const plr_queue *queue, plr_event_kind kind, plr_time_ns t_ns) {
    for (unsigned i = 0; i < queue->count; i++)
        if (queue->t_ns[queue->order[i]] == t_ns && kind_of(queue->order[i]) == kind)
            return true;
    return false;
}

bool plr_queue_first_ns(const plr_queue *queue, plr_event_kind kind, plr_time_ns *t_ns) {
    for (unsigned i = 0; i < queue->count; i++)
        if (kind_of(queue->order[i]) == kind) {
            *t_ns = queue->t_ns[queue->order[i]];
            return true;
        }
    return false;
}

static void store(plr_queue *queue, unsigned place, const plr_event *event) {
    const plr_frame *frame = &event->as.frame;
    queue->t_ns[place] = event->t_ns;
    switch (event->kind) {
    case PLR_EVENT_STEP:
        queue->steps[place] = event->as.step;
        queue->leads[place] = event->leads;
        break;
    case PLR_EVENT_FRAME:
        PLR_ASSERT(frame->count <= PLR_MAX_OBSERVATIONS);
        queue->frames[place - FRAMES] = *frame;
        memcpy(queue->observations[place - FRAMES], frame->observations,
               frame->count * sizeof *frame->observations);
        break;
    default:
        queue->readings[place - READINGS] = event->as.reading;
    }
}

static void load(const plr_queue *queue, unsigned place, plr_event *event) {
    event->t_ns = queue->t_ns[place];
    event->kind = kind_of(place);
    switch (event->kind) {
    case PLR_EVENT_STEP:
        event->as.step = queue->steps[place];
        event->leads = queue->leads[place];
        break;
    case PLR_EVENT_FRAME:
        event->as.frame = queue->frames[place - FRAMES];
        event->as.frame.observations = queue->observations[place - FRAMES];
        break;
    default:
        event->as.reading = queue->readings[place - READINGS];
    }
}

/* True if an event of t_ns and `kind` goes before the one at that place. */
static bool goes_before(plr_time_ns t_ns, plr_event_kind kind, const plr_queue *queue,
                        unsigned place) {
    const plr_time_ns there_ns = queue->t_ns[place];
    return t_ns < there_ns || (t_ns == there_ns && kind < kind_of(place));
}

void plr_queue_insert(plr_queue *queue, const plr_event *event) {
    PLR_ASSERT(!plr_queue_is_full(queue, event->kind));
    uint8_t *order = queue->order;
    unsigned at = queue->count, free = at;
    while (kind_of(order[free]) != event->kind)
        free++;
    const uint8_t place = order[free];
    while (at > 0 && goes_before(event->t_ns, event->kind, queue, order[at - 1]))
        at--;
    memmove(order + at + 1, order + at, free - at);
    order[at] = place;
    queue->count++;
    queue->counts[event->kind]++;
    store(queue, place, event);
    PLR_ASSERT(queue->count <= PLR_QUEUE_PLACES);
}

bool plr_queue_pop_until(plr_queue *queue, plr_time_ns t_ns, plr_event_kind kind,
                         plr_event *event) {
    const uint8_t place = queue->order[0];
    if (queue->count == 0 || goes_before(t_ns, kind, queue, place))
        return false;
    load(queue, place, event);
    PLR_ASSERT(queue->counts[event->kind] > 0);
    queue->count--;
    queue->counts[event->kind]--;
    memmove(queue->order, queue->order + 1, queue->count);
    queue->order[queue->count] = place;
    return true;
}
