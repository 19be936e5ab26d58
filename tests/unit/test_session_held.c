// SPDX-License-Identifier: MIT
/* The queue of twists that wait for a late camera. */
#include <unity.h>

#include "session/held.h"

static plr_held_steps held;

void setUp(void) {
    plr_held_init(&held);
}

void tearDown(void) {
}

static void push(plr_time_ns t_ns) {
    const plr_held_step step = {.t_ns = t_ns};
    plr_held_push(&held, &step);
}

static void test_twists_come_out_in_the_order_they_went_in(void) {
    plr_held_step step;
    for (plr_time_ns t = 1; t <= 3; t++)
        push(t);
    for (plr_time_ns t = 1; t <= 3; t++) {
        TEST_ASSERT_TRUE(plr_held_pop(&held, &step));
        TEST_ASSERT_EQUAL_UINT64(t, step.t_ns);
    }
    TEST_ASSERT_FALSE(plr_held_pop(&held, &step));
}

static void test_the_ring_goes_round_many_times(void) {
    plr_held_step step;
    for (plr_time_ns t = 1; t <= 5 * PLR_SESSION_HELD_TWISTS; t++) {
        push(t);
        if (t > 10) {
            TEST_ASSERT_TRUE(plr_held_pop(&held, &step));
            TEST_ASSERT_EQUAL_UINT64(t - 10, step.t_ns);
        }
    }
}

static void test_each_is_given_back_as_it_was(void) {
    plr_held_step step;
    for (unsigned i = 0; i < 3 * PLR_SESSION_HELD_TWISTS; i++) {
        const plr_held_step pushed = {
            .t_ns = 1000 + i, .by.imu = {{i, 0.5, -1.0}, {2.0 * i, 0, 3}}, .leads = i % 3 == 0};
        plr_held_push(&held, &pushed);
        if (i < 20)
            continue;
        TEST_ASSERT_TRUE(plr_held_pop(&held, &step));
        TEST_ASSERT_EQUAL_UINT64(1000 + i - 20, step.t_ns);
        TEST_ASSERT_EQUAL_INT((i - 20) % 3 == 0, step.leads);
        TEST_ASSERT_EQUAL_DOUBLE(i - 20.0, step.by.imu.a_B_mps2[0]);
        TEST_ASSERT_EQUAL_DOUBLE(2.0 * (i - 20.0), step.by.imu.w_B_radps[0]);
    }
}

static void test_it_is_full_at_its_capacity_and_not_before(void) {
    for (unsigned i = 0; i < PLR_SESSION_HELD_TWISTS; i++) {
        TEST_ASSERT_FALSE(plr_held_full(&held));
        push(i);
    }
    TEST_ASSERT_TRUE(plr_held_full(&held));
}

static void test_a_twist_is_due_when_the_newest_is_the_delay_ahead(void) {
    plr_held_step step;
    push(100);
    push(149);
    TEST_ASSERT_FALSE(plr_held_pop_due(&held, 50, &step));
    push(150);
    TEST_ASSERT_TRUE(plr_held_pop_due(&held, 50, &step));
    TEST_ASSERT_EQUAL_UINT64(100, step.t_ns);
    TEST_ASSERT_FALSE(plr_held_pop_due(&held, 50, &step));
}

static void test_a_frame_takes_the_twists_up_to_its_time(void) {
    plr_held_step step;
    push(10);
    push(20);
    push(30);
    TEST_ASSERT_TRUE(plr_held_pop_until(&held, 20, &step));
    TEST_ASSERT_TRUE(plr_held_pop_until(&held, 20, &step));
    TEST_ASSERT_EQUAL_UINT64(20, step.t_ns);
    TEST_ASSERT_FALSE(plr_held_pop_until(&held, 20, &step));
    TEST_ASSERT_EQUAL_UINT(1, held.count);
}

static void test_time_that_repeats_or_goes_back_contradicts(void) {
    TEST_ASSERT_FALSE(plr_held_contradicts(&held, 0));
    push(10);
    TEST_ASSERT_TRUE(plr_held_contradicts(&held, 9));
    TEST_ASSERT_TRUE(plr_held_contradicts(&held, 10));
    TEST_ASSERT_FALSE(plr_held_contradicts(&held, 11));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_twists_come_out_in_the_order_they_went_in);
    RUN_TEST(test_the_ring_goes_round_many_times);
    RUN_TEST(test_each_is_given_back_as_it_was);
    RUN_TEST(test_it_is_full_at_its_capacity_and_not_before);
    RUN_TEST(test_a_twist_is_due_when_the_newest_is_the_delay_ahead);
    RUN_TEST(test_a_frame_takes_the_twists_up_to_its_time);
    RUN_TEST(test_time_that_repeats_or_goes_back_contradicts);
    return UNITY_END();
}
