// SPDX-License-Identifier: MIT
/*
 * A velocity is held for two of its sensor's intervals if the next reading does not come. Where one had
 * been rejected or lost, that was twice as long, and after a pause as long as the pause: a robot
 * that had said that it rests, and drove off, was held back by a standstill of before (0.09 m from the
 * truth became 0.23). Of two wheels that measured at one time none was held at all.
 */
#include <unity.h>

#include "pelorus/pelorus.h"
#include "support/axes.h"
#include "support/rig.h"

static const plr_time_ns interval_ns = 10 * RIG_STEP_NS;

void setUp(void) {
    rig_set_up();
    rig.options.speed_mps = rig.options.turn_radps = rig.options.sway = 0;
    each_axis(rig.config.velocity_sigma, rig.options.velocity_sigma_mps);
    each_axis(rig.config.gyro_sigma, rig.options.gyro_sigma_radps);
    rig_begin();
}

/* Twists for so many intervals. */
static void wait(unsigned intervals) {
    for (plr_time_ns t = 0; t < intervals * interval_ns; t += RIG_STEP_NS)
        rig_twist();
}

static void say(double speed_mps, bool due) {
    plr_reading_result result;
    plr_reading reading = {.sensor = PLR_SENSOR_WHEEL, .axes = 1, .value = {speed_mps}};
    reading.t_ns = plr_filter_time(&rig.filter);
    each_axis(reading.sigma, 0.001);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(&rig.filter, &reading, &result));
    TEST_ASSERT_EQUAL(due, result.used);
}

/* A step that begins within two intervals is held, one that begins after them is not. */
static void demand_held_for_two_intervals(void) {
    const plr_held_velocity *held = &rig.filter.source.velocities.held[0];
    TEST_ASSERT_EQUAL_UINT64(2 * interval_ns, held->until_ns - plr_filter_time(&rig.filter));
}

static void begin(void) {
    wait(1);
    say(0, true);
    wait(1);
    say(0, true);
    demand_held_for_two_intervals();
}

static void test_a_rejected_reading_does_not_prolong_the_next_one(void) {
    begin();
    wait(1);
    say(50, false);
    wait(1);
    say(0, true);
    demand_held_for_two_intervals();
}

static void test_nor_does_a_lost_one(void) {
    begin();
    wait(2);
    say(0, true);
    demand_held_for_two_intervals();
}

static void test_the_first_one_after_a_pause_is_not_held(void) {
    const plr_held_velocity *held = &rig.filter.source.velocities.held[0];
    begin();
    wait(8);
    say(0, true);
    TEST_ASSERT_EQUAL_UINT64(plr_filter_time(&rig.filter), held->until_ns);
    wait(1);
    say(0, true);
    demand_held_for_two_intervals();
}

static void test_of_two_wheels_at_one_time_the_last_is_held(void) {
    for (int k = 0; k < 2; k++) {
        wait(1);
        say(0.1, true);
        say(0, true);
    }
    demand_held_for_two_intervals();
    TEST_ASSERT_TRUE(rig.filter.source.velocities.held[0].z[0] == 0);
    TEST_ASSERT_TRUE(rig.filter.source.velocities.held[0].density[0] > 0);
}

static void test_a_sensor_that_becomes_slower_is_held_for_two_of_its_new_intervals(void) {
    begin();
    for (int k = 0; k < 2; k++) {
        wait(2);
        say(0, true);
    }
    const plr_held_velocity *held = &rig.filter.source.velocities.held[0];
    TEST_ASSERT_EQUAL_UINT64(4 * interval_ns, held->until_ns - plr_filter_time(&rig.filter));
}
