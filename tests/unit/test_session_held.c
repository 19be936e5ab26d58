// SPDX-License-Identifier: MIT
/* The queues of steps that wait for a late camera, and of frames that wait for late steps. */
#include <string.h>
#include <unity.h>

#include "session/held.h"

static plr_held_steps held;

void setUp(void) {
    memset(&held, 0, sizeof held);
}

static void push(plr_time_ns t_ns) {
    const plr_held_step step = {.t_ns = t_ns};
    TEST_ASSERT_TRUE(plr_held_insert(&held, &step));
}

static void test_twists_come_out_in_the_order_they_went_in(void) {
    plr_held_step step;
    for (plr_time_ns t = 1; t <= 3; t++)
        push(t);
    for (plr_time_ns t = 1; t <= 3; t++) {
        TEST_ASSERT_TRUE(plr_held_pop(&held, UINT64_MAX, &step));
        TEST_ASSERT_EQUAL_UINT64(t, step.t_ns);
    }
    TEST_ASSERT_FALSE(plr_held_pop(&held, UINT64_MAX, &step));
}

static void test_the_ring_goes_round_many_times(void) {
    plr_held_step step;
    for (plr_time_ns t = 1; t <= 5 * PLR_SESSION_HELD_TWISTS; t++) {
        push(t);
        if (t > 10) {
            TEST_ASSERT_TRUE(plr_held_pop(&held, UINT64_MAX, &step));
            TEST_ASSERT_EQUAL_UINT64(t - 10, step.t_ns);
        }
    }
}

static void test_each_is_given_back_as_it_was(void) {
    plr_held_step step;
    for (unsigned i = 0; i < 3 * PLR_SESSION_HELD_TWISTS; i++) {
        const plr_held_step pushed = {
            .t_ns = 1000 + i, .by.imu = {{i, 0.5, -1.0}, {2.0 * i, 0, 3}}, .leads = i % 3 == 0};
        TEST_ASSERT_TRUE(plr_held_insert(&held, &pushed));
        if (i < 20)
            continue;
        TEST_ASSERT_TRUE(plr_held_pop(&held, UINT64_MAX, &step));
        TEST_ASSERT_EQUAL_UINT64(1000 + i - 20, step.t_ns);
        TEST_ASSERT_EQUAL_INT((i - 20) % 3 == 0, step.leads);
        TEST_ASSERT_EQUAL_DOUBLE(i - 20.0, step.by.imu.a_B_mps2[0]);
        TEST_ASSERT_EQUAL_DOUBLE(2.0 * (i - 20.0), step.by.imu.w_B_radps[0]);
    }
}

static void test_a_frame_takes_the_twists_up_to_its_time(void) {
    plr_held_step step;
    push(10);
    push(20);
    push(30);
    TEST_ASSERT_TRUE(plr_held_pop(&held, 20, &step));
    TEST_ASSERT_TRUE(plr_held_pop(&held, 20, &step));
    TEST_ASSERT_EQUAL_UINT64(20, step.t_ns);
    TEST_ASSERT_FALSE(plr_held_pop(&held, 20, &step));
    TEST_ASSERT_EQUAL_UINT(1, held.count);
}

static void test_steps_that_come_in_any_order_leave_in_that_of_time(void) {
    plr_held_step step;
    for (unsigned first = 0; first < PLR_SESSION_HELD_TWISTS; first += 7) { /* wherever it begins */
        for (plr_time_ns k = 0; k < PLR_SESSION_HELD_TWISTS; k++) {
            const plr_time_ns t = 1 + 37 * k % PLR_SESSION_HELD_TWISTS; /* 37 and 64: all once */
            const plr_held_step inserted = {
                .t_ns = t, .by.twist = {{(double)t, 0, 0}, {0, 0, 0}}, .leads = t % 3 == 0};
            TEST_ASSERT_TRUE(plr_held_insert(&held, &inserted));
        }
        for (plr_time_ns t = 1; t <= PLR_SESSION_HELD_TWISTS; t++) {
            TEST_ASSERT_TRUE(plr_held_pop(&held, UINT64_MAX, &step));
            TEST_ASSERT_EQUAL_UINT64(t, step.t_ns);
            TEST_ASSERT_EQUAL_INT(t % 3 == 0, step.leads);
            TEST_ASSERT_EQUAL_DOUBLE((double)t, step.by.twist.v_B_mps[0]);
        }
        for (unsigned i = 0; i < 7; i++) {
            push(i);
            TEST_ASSERT_TRUE(plr_held_pop(&held, UINT64_MAX, &step));
        }
    }
}

static void test_a_step_of_a_time_that_is_there_is_not_taken(void) {
    plr_held_step step = {.t_ns = 20, .by.twist = {{9, 0, 0}, {0, 0, 0}}};
    push(10);
    push(20);
    push(30);
    TEST_ASSERT_FALSE(plr_held_insert(&held, &step));
    TEST_ASSERT_EQUAL_UINT(3, held.count);
    TEST_ASSERT_TRUE(plr_held_pop(&held, UINT64_MAX, &step));
    TEST_ASSERT_TRUE(plr_held_pop(&held, UINT64_MAX, &step));
    TEST_ASSERT_EQUAL_DOUBLE(0, step.by.twist.v_B_mps[0]);
}

static void test_the_newest_step_is_known(void) {
    TEST_ASSERT_EQUAL_UINT64(0, plr_held_newest_ns(&held));
    push(10);
    push(5);
    TEST_ASSERT_EQUAL_UINT64(10, plr_held_newest_ns(&held));
}

/* --- frames --- */

static void test_frames_leave_as_they_came_with_their_observations(void) {
    static plr_held_frames frames;
    plr_observation seen[2] = {{.id = 0}, {.id = 1}};
    TEST_ASSERT_NULL(plr_held_pop_frame(&frames, UINT64_MAX));
    TEST_ASSERT_EQUAL_UINT64(0, plr_held_newest_frame_ns(&frames));
    for (unsigned k = 0; k < 4 * PLR_SESSION_HELD_FRAMES; k++) {
        seen[0].id = 100 + k;
        const plr_frame frame = {k, PLR_NO_BUDGET, 2, seen};
        plr_held_insert_frame(&frames, &frame, 1000 + k);
        TEST_ASSERT_EQUAL_UINT64(1000 + k, plr_held_newest_frame_ns(&frames));
        if (k + 1 < PLR_SESSION_HELD_FRAMES)
            continue;
        const unsigned due = k + 1 - PLR_SESSION_HELD_FRAMES;
        TEST_ASSERT_NULL(plr_held_pop_frame(&frames, 999 + due));
        const plr_held_frame *held_frame = plr_held_pop_frame(&frames, 1000 + due);
        TEST_ASSERT_EQUAL_UINT64(due, held_frame->frame.t_ns);
        TEST_ASSERT_EQUAL_UINT64(1000 + due, held_frame->moved_ns);
        TEST_ASSERT_EQUAL_UINT32(100 + due, held_frame->frame.observations[0].id);
        TEST_ASSERT_EQUAL_UINT16(2, held_frame->frame.count);
    }
    TEST_ASSERT_EQUAL_UINT8(PLR_SESSION_HELD_FRAMES - 1, frames.count);
}

static void test_frames_that_overtake_each_other_leave_in_the_order_of_time(void) {
    static plr_held_frames frames;
    const plr_time_ns came[PLR_SESSION_HELD_FRAMES] = {3, 1, 2};
    for (unsigned turn = 0; turn < PLR_SESSION_HELD_FRAMES;
         turn++) { /* from each place of the ring */
        for (unsigned i = 0; i < PLR_SESSION_HELD_FRAMES; i++) {
            const plr_observation seen = {.id = (uint32_t)came[i]};
            const plr_frame frame = {came[i], PLR_NO_BUDGET, 1, &seen};
            TEST_ASSERT_FALSE(plr_held_has_frame(&frames, came[i]));
            plr_held_insert_frame(&frames, &frame, 10 + came[i]);
            TEST_ASSERT_TRUE(plr_held_has_frame(&frames, came[i]));
        }
        for (unsigned k = 1; k <= PLR_SESSION_HELD_FRAMES; k++) {
            const plr_held_frame *oldest = plr_held_pop_frame(&frames, UINT64_MAX);
            TEST_ASSERT_EQUAL_UINT64(10 + k, oldest->moved_ns);
            TEST_ASSERT_EQUAL_UINT32(k, oldest->frame.observations[0].id);
        }
        const plr_observation none = {.id = 9};
        const plr_frame one = {9, PLR_NO_BUDGET, 1, &none};
        plr_held_insert_frame(&frames, &one, 9);
        (void)plr_held_pop_frame(&frames, UINT64_MAX);
    }
}
