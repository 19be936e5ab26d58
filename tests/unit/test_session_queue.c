// SPDX-License-Identifier: MIT
/* The queue of events, held against a plain list that is searched for what goes first. */
#include <string.h>
#include <unity.h>

#include "session/queue.h"
#include "support/random.h"

static plr_queue queue;

void setUp(void) {
    plr_queue_clear(&queue);
}

static plr_event event_of(plr_event_kind kind, plr_time_ns t_ns, unsigned number) {
    static plr_observation seen[2];
    plr_event event = {.t_ns = t_ns, .kind = kind};
    if (kind == PLR_EVENT_STEP) {
        event.leads = number % 3 == 0;
        event.as.step.imu = (plr_imu){{number, 0.5, -1}, {2.0 * number, 0, 3}};
    } else if (kind == PLR_EVENT_FRAME) {
        seen[1].id = number;
        event.as.frame = (plr_frame){1000 + t_ns, PLR_NO_BUDGET, 2, seen};
    } else {
        event.as.reading = (plr_reading){.t_ns = t_ns, .axes = 1, .value = {number, 0, 0}};
    }
    return event;
}

static void push(plr_event_kind kind, plr_time_ns t_ns, unsigned number) {
    const plr_event event = event_of(kind, t_ns, number);
    plr_queue_insert(&queue, &event);
}

static void assert_is(const plr_event *found, plr_event_kind kind, plr_time_ns t_ns,
                      unsigned number) {
    TEST_ASSERT_EQUAL_UINT64(t_ns, found->t_ns);
    TEST_ASSERT_EQUAL_INT(kind, found->kind);
    if (kind == PLR_EVENT_STEP) {
        TEST_ASSERT_EQUAL_INT(number % 3 == 0, found->leads);
        TEST_ASSERT_EQUAL_DOUBLE(number, found->as.step.imu.a_B_mps2[0]);
        TEST_ASSERT_EQUAL_DOUBLE(2.0 * number, found->as.step.imu.w_B_radps[0]);
    } else if (kind == PLR_EVENT_FRAME) {
        TEST_ASSERT_EQUAL_UINT64(1000 + t_ns, found->as.frame.t_ns);
        TEST_ASSERT_EQUAL_UINT16(2, found->as.frame.count);
        TEST_ASSERT_EQUAL_UINT32(number, found->as.frame.observations[1].id);
    } else {
        TEST_ASSERT_EQUAL_DOUBLE(number, found->as.reading.value[0]);
    }
}

static void assert_pops(plr_event_kind kind, plr_time_ns t_ns, unsigned number) {
    plr_event found;
    TEST_ASSERT_TRUE(plr_queue_pop_until(&queue, UINT64_MAX, PLR_EVENT_READING, &found));
    assert_is(&found, kind, t_ns, number);
}

static void assert_empty(void) {
    plr_event found;
    TEST_ASSERT_FALSE(plr_queue_pop_until(&queue, UINT64_MAX, PLR_EVENT_READING, &found));
}

static void test_of_one_time_steps_leave_first_then_frames_then_readings_as_they_came(void) {
    push(PLR_EVENT_READING, 5, 1);
    push(PLR_EVENT_FRAME, 5, 2);
    push(PLR_EVENT_READING, 5, 3);
    push(PLR_EVENT_STEP, 5, 4);
    push(PLR_EVENT_READING, 4, 5);
    assert_pops(PLR_EVENT_READING, 4, 5);
    assert_pops(PLR_EVENT_STEP, 5, 4);
    assert_pops(PLR_EVENT_FRAME, 5, 2);
    assert_pops(PLR_EVENT_READING, 5, 1);
    assert_pops(PLR_EVENT_READING, 5, 3);
    assert_empty();
}

static void test_nothing_leaves_that_goes_after_the_time_and_kind_asked_for(void) {
    plr_event found;
    push(PLR_EVENT_STEP, 10, 1);
    push(PLR_EVENT_FRAME, 10, 2);
    TEST_ASSERT_FALSE(plr_queue_pop_until(&queue, 9, PLR_EVENT_READING, &found));
    TEST_ASSERT_TRUE(plr_queue_pop_until(&queue, 10, PLR_EVENT_STEP, &found));
    assert_is(&found, PLR_EVENT_STEP, 10, 1);
    TEST_ASSERT_FALSE(plr_queue_pop_until(&queue, 10, PLR_EVENT_STEP, &found));
    TEST_ASSERT_TRUE(plr_queue_pop_until(&queue, 10, PLR_EVENT_FRAME, &found));
    assert_empty();
}

static void test_the_first_of_a_kind_is_known(void) {
    plr_time_ns first_ns;
    TEST_ASSERT_FALSE(plr_queue_first_ns(&queue, PLR_EVENT_STEP, &first_ns));

    push(PLR_EVENT_STEP, 30, 0);
    push(PLR_EVENT_STEP, 20, 0);
    push(PLR_EVENT_READING, 10, 0);
    push(PLR_EVENT_FRAME, 40, 0);
    TEST_ASSERT_TRUE(plr_queue_first_ns(&queue, PLR_EVENT_STEP, &first_ns));
    TEST_ASSERT_EQUAL_UINT64(20, first_ns);

    TEST_ASSERT_TRUE(plr_queue_holds(&queue, PLR_EVENT_STEP, 30));
    TEST_ASSERT_FALSE(plr_queue_holds(&queue, PLR_EVENT_STEP, 40));
}

static void test_each_kind_has_room_of_its_own(void) {
    static const unsigned room[PLR_EVENT_KINDS] = {PLR_SESSION_HELD_TWISTS, PLR_SESSION_HELD_FRAMES,
                                                   PLR_SESSION_HELD_READINGS};
    for (unsigned kind = 0; kind < PLR_EVENT_KINDS; kind++)
        for (unsigned i = 0; i < room[kind]; i++) {
            TEST_ASSERT_FALSE(plr_queue_is_full(&queue, (plr_event_kind)kind));
            push((plr_event_kind)kind, 1000 - i, kind + i);
        }
    for (unsigned kind = 0; kind < PLR_EVENT_KINDS; kind++) {
        TEST_ASSERT_TRUE(plr_queue_is_full(&queue, (plr_event_kind)kind));
        TEST_ASSERT_EQUAL_UINT(room[kind], queue.counts[kind]);
    }
    for (unsigned i = 0; i < PLR_QUEUE_PLACES; i++) {
        plr_event found;
        TEST_ASSERT_TRUE(plr_queue_pop_until(&queue, UINT64_MAX, PLR_EVENT_READING, &found));
    }
    assert_empty();
}

/* --- against a plain list --- */

enum { MOST = PLR_QUEUE_PLACES };

static struct {
    plr_event_kind kind;
    plr_time_ns t_ns;
    unsigned number;
} list[MOST];
static unsigned listed;

/* The earliest, of those the first kind, of those the first that came. */
static unsigned first_listed(void) {
    unsigned first = 0;
    for (unsigned i = 1; i < listed; i++)
        if (list[i].t_ns < list[first].t_ns ||
            (list[i].t_ns == list[first].t_ns && list[i].kind < list[first].kind))
            first = i;
    return first;
}

static void pop_both(void) {
    const unsigned first = first_listed();
    assert_pops(list[first].kind, list[first].t_ns, list[first].number);
    listed--;
    memmove(&list[first], &list[first + 1], (listed - first) * sizeof list[0]);
}

static void test_events_that_come_in_any_order_leave_in_that_of_time(void) {
    rng random = rng_seeded(47);
    listed = 0;
    for (unsigned number = 0; number < 5000; number++) {
        const plr_event_kind kind = (plr_event_kind)rng_below(&random, PLR_EVENT_KINDS);
        const plr_time_ns t_ns = number / 8 + rng_below(&random, 30); /* many are equal */
        if (plr_queue_is_full(&queue, kind)) {
            pop_both();
            continue;
        }
        push(kind, t_ns, number);
        list[listed].kind = kind;
        list[listed].t_ns = t_ns;
        list[listed++].number = number;
        while (listed > 0 && rng_below(&random, 3) == 0)
            pop_both();
    }
    while (listed > 0)
        pop_both();
    assert_empty();
}
