// SPDX-License-Identifier: MIT
/* plr_filter_health: how it stands at some time, frame or no frame. A camera or an odometry that has
 * fallen silent sends nothing that could say so. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/reseal.h"
#include "support/rig.h"

static plr_health_state state;

void setUp(void) {
    rig_set_up();
    rig.config.pixel_sigma_px = 1;
    rig_begin();
    memset(&state, 0x5A, sizeof state);
}

static void ask(plr_time_ns t_ns) {
    static plr_filter before;
    memcpy(&before, &rig.filter, sizeof before);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_health(&rig.filter, t_ns, &state));
    TEST_ASSERT_EQUAL_MEMORY(&before, &rig.filter, sizeof before);
}

static const uint32_t none_seen = PLR_REASON_NO_FRAMES | PLR_REASON_NO_OBSERVATIONS;

static void test_before_anything_has_come_it_is_lost_and_times_are_infinite(void) {
    ask(5000000000);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_LOST, state.health);
    TEST_ASSERT_EQUAL_HEX32(none_seen | PLR_REASON_NO_TWISTS | PLR_REASON_FEW_OBSERVATIONS,
                            state.reasons);
    TEST_ASSERT_TRUE(isinf(state.seconds_without_frame));
    TEST_ASSERT_TRUE(isinf(state.seconds_without_use));
    TEST_ASSERT_TRUE(isinf(state.seconds_without_twist));
    TEST_ASSERT_EQUAL_UINT32(0, state.resets);
}

static void test_on_a_drive_it_is_that_of_the_last_frame(void) {
    rig_drive(5);
    ask(rig.world.t_ns);
    TEST_ASSERT_EQUAL_INT(rig.report.health, state.health);
    TEST_ASSERT_EQUAL_HEX32(rig.report.reasons, state.reasons);
    TEST_ASSERT_EQUAL_DOUBLE(0, state.seconds_without_frame);
    TEST_ASSERT_EQUAL_DOUBLE(0, state.seconds_without_use);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.01, state.seconds_without_twist);
    ask(1); /* of the past nothing is known: it is that of the estimate */
    TEST_ASSERT_EQUAL_DOUBLE(0, state.seconds_without_frame);
}

/* 0 was taken for "never": a twist at time 0 stayed new for ever, and a frame had not been. */
static void test_what_came_at_time_zero_has_come(void) {
    static const plr_frame frame = {.t_ns = 0, .budget = PLR_NO_BUDGET};
    static const plr_twist twist = {{1, 0, 0}, {0, 0, 0}};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, 0, &twist));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
    ask(0);
    TEST_ASSERT_EQUAL_DOUBLE(0, state.seconds_without_frame);
    TEST_ASSERT_EQUAL_DOUBLE(0, state.seconds_without_twist);
    TEST_ASSERT_TRUE(isinf(state.seconds_without_use));
    ask(6000000000);
    TEST_ASSERT_EQUAL_DOUBLE(6, state.seconds_without_frame);
    TEST_ASSERT_EQUAL_DOUBLE(6, state.seconds_without_twist);
    TEST_ASSERT_TRUE(state.reasons & PLR_REASON_NO_TWISTS);
}

static void test_a_camera_that_falls_silent_is_told_after_a_second(void) {
    rig_drive(5);
    const plr_time_ns last = rig.world.t_ns;
    while (rig.world.t_ns < last + 1000000000)
        rig_twist();
    ask(last + 1000000000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1, state.seconds_without_frame);
    TEST_ASSERT_FALSE(state.reasons & none_seen);
    ask(last + 1000000001);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_LOST, state.health);
    TEST_ASSERT_EQUAL_HEX32(none_seen, state.reasons & none_seen);
    TEST_ASSERT_FALSE(state.reasons & PLR_REASON_NO_TWISTS);
    rig_frame(); /* it is back */
    ask(rig.world.t_ns);
    TEST_ASSERT_FALSE(state.reasons & none_seen);
}

static void test_a_camera_that_sees_nothing_is_told_too(void) {
    rig_drive(5);
    const plr_time_ns last = rig.world.t_ns;
    for (int k = 0; k < 11; k++) {
        rig_twists();
        const plr_frame dark = {.t_ns = rig.world.t_ns, .budget = PLR_NO_BUDGET};
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &dark, &rig.report));
    }
    ask(rig.world.t_ns);
    TEST_ASSERT_EQUAL_DOUBLE(0, state.seconds_without_frame);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, (double)(rig.world.t_ns - last) * 1e-9,
                              state.seconds_without_use);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_LOST, state.health);
    TEST_ASSERT_EQUAL_HEX32(PLR_REASON_NO_OBSERVATIONS, state.reasons & none_seen);
}

/* Readings came every 10 ms: three of them and 50 ms more may be missing. */
static void test_an_odometry_that_falls_silent_is_told(void) {
    rig_drive(5);
    const plr_time_ns last = rig.filter.source.reading_ns;
    ask(last + 79000000);
    TEST_ASSERT_FALSE(state.reasons & PLR_REASON_NO_TWISTS);
    ask(last + 81000000);
    TEST_ASSERT_TRUE(state.reasons & PLR_REASON_NO_TWISTS);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DEGRADED, state.health);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.081, state.seconds_without_twist);
}

static void test_a_refused_reading_is_told_at_once(void) {
    const plr_twist bad = {{(double)NAN, 0, 0}, {0}};
    rig_drive(5);
    ask(rig.world.t_ns);
    TEST_ASSERT_FALSE(state.reasons & PLR_REASON_NO_TWISTS);
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_FINITE, plr_filter_predict(&rig.filter, rig.world.t_ns, &bad));
    ask(rig.world.t_ns);
    TEST_ASSERT_TRUE(state.reasons & PLR_REASON_NO_TWISTS);
}

/* Frames of another clock say nothing of this one: not that they have just come, nor for how long none
 * has. */
/* In dead reckoning too a frame asks whether readings were refused since the last one. */
static void test_in_dead_reckoning_a_refused_reading_is_forgotten_as_readings_come_again(void) {
    const plr_twist broken = {{(double)NAN, 0, 0}, {0}};
    rig.config.mode = PLR_MODE_DEAD_RECKONING;
    rig_begin();
    rig_drive(2);
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_FINITE,
                          plr_filter_predict(&rig.filter, rig.world.t_ns, &broken));
    rig_drive(1);
    ask(rig.world.t_ns);
    TEST_ASSERT_EQUAL_HEX32(PLR_REASON_NO_TWISTS, state.reasons);
    rig_drive(1);
    ask(rig.world.t_ns);
    TEST_ASSERT_EQUAL_HEX32(0, state.reasons);
}

static void test_on_another_clock_no_frame_has_come_yet(void) {
    static const plr_pose origin = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    const plr_time_ns clocks[] = {1000, UINT64_C(86400000000000)};
    for (int way = 0; way < 4; way++) {
        const plr_time_ns now = clocks[way % 2];
        rig_begin();
        rig_drive(3);
        TEST_ASSERT_EQUAL_INT(PLR_OK, way < 2
                                          ? plr_filter_resume(&rig.filter, now, NULL)
                                          : plr_filter_set_pose(&rig.filter, now, &origin, NULL));
        ask(now + 1000000);
        TEST_ASSERT_EQUAL_INT(PLR_HEALTH_LOST, state.health);
        TEST_ASSERT_EQUAL_HEX32(none_seen, state.reasons & none_seen);
        TEST_ASSERT_TRUE(isinf(state.seconds_without_frame));
        TEST_ASSERT_TRUE(isinf(state.seconds_without_twist));
    }
}

static void test_on_the_same_clock_a_pose_from_outside_forgets_no_frame(void) {
    static const plr_pose origin = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    rig_drive(3);
    const plr_time_ns last = rig.world.t_ns;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&rig.filter, last + 1000, &origin, NULL));
    ask(last + 200000000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.2, state.seconds_without_frame);
    TEST_ASSERT_EQUAL_UINT32(1, state.resets);
}

static void test_what_a_mode_does_without_is_not_missed(void) {
    plr_pose pose;
    rig.config.mode = PLR_MODE_DEAD_RECKONING;
    rig_begin();
    rig_twist();
    ask(rig.world.t_ns);
    TEST_ASSERT_FALSE(state.reasons & none_seen);
    rig.config.mode = PLR_MODE_MAPPING;
    rig_begin();
    scene_pose(&rig.world, &pose);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(&rig.filter, rig.world.t_ns, &pose));
    rig_frame();
    ask(rig.world.t_ns);
    TEST_ASSERT_FALSE(state.reasons & PLR_REASON_NO_TWISTS);
}

static void test_damaged_memory_and_null_pointers(void) {
    rig_drive(2);
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_health(NULL, 0, &state));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_health(&rig.filter, 0, NULL));
    rig.filter.totals.frames++;
    TEST_ASSERT_EQUAL_INT(PLR_E_DAMAGED, plr_filter_health(&rig.filter, 0, &state));
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DIVERGED, state.health);
    TEST_ASSERT_EQUAL_HEX32(PLR_REASON_STATE_DAMAGED, state.reasons);
}
