// SPDX-License-Identifier: MIT
/* Small sensors that are off by less than the gate, over many readings. */
#include <string.h>
#include <unity.h>

#include "sensor/sensor.h"
#include "supervise/readings.h"
#include "supervise/supervise.h"
#include "support/axes.h"
#include "support/random.h"
#include "support/rig.h"

static plr_supervisor supervisor;
static plr_reading reading;
static rng numbers;

void setUp(void) {
    rig_set_up();
    plr_sensors_forget(&supervisor);
    memset(&reading, 0, sizeof reading);
    reading.sensor = PLR_SENSOR_POSITION;
    reading.axes = 7;
    numbers = rng_seeded(5);
}

/* A reading whose errors are `times` as large as its sigma says, and `off` sigmas beside. */
static void add(double times, double off) {
    double d2 = 0;
    unsigned count = 0;
    for (unsigned i = 0; i < 3; i++) {
        const double error = times * rng_normal(&numbers) + off;
        d2 += plr_reading_has(&reading, i) ? error * error : 0;
        count += plr_reading_has(&reading, i);
    }
    reading.t_ns++;
    plr_sensors_add(&supervisor, &reading, count, d2 < 13.3, (plr_real)d2);
}

static bool are_off(void) {
    return plr_sensors_are_wrong(&supervisor);
}

static void test_readings_as_stated_are_never_off(void) {
    for (unsigned axes = 1; axes <= 7; axes += 3)
        for (unsigned k = 0; k < 20000; k++) {
            reading.axes = (uint8_t)axes;
            add(1, 0);
            TEST_ASSERT_FALSE(are_off());
            TEST_ASSERT_TRUE(plr_supervise_widening(&supervisor, PLR_SENSOR_POSITION) == 1);
        }
}

static void test_errors_of_twice_the_sigma_are_off_and_their_variance_is_found(void) {
    for (unsigned k = 0; k < 40; k++)
        add(2, 0);
    TEST_ASSERT_TRUE(are_off());
    TEST_ASSERT_TRUE(plr_supervise_widening(&supervisor, PLR_SENSOR_POSITION) > PLR_R(1.8));
    for (unsigned k = 0; k < 100; k++)
        add(1, 0);
    TEST_ASSERT_FALSE(are_off());
}

static void test_a_height_that_is_two_sigmas_off_is_found(void) {
    reading.axes = 4;
    for (unsigned k = 0; k < 60; k++)
        add(1, 2);
    TEST_ASSERT_TRUE(are_off());
}

static void test_wild_readings_now_and_then_are_no_sensor_that_is_off(void) {
    for (unsigned k = 0; k < 300; k++) {
        add(k % 10 ? 1 : 100, 0);
        TEST_ASSERT_FALSE(are_off());
    }
}

static void test_one_sensor_says_nothing_of_another(void) {
    for (unsigned k = 0; k < 40; k++)
        add(3, 0);
    TEST_ASSERT_TRUE(plr_supervise_widening(&supervisor, PLR_SENSOR_WHEEL) == 1);
}

static void test_ten_rejected_in_succession_are_wrong_and_nine_are_not(void) {
    for (unsigned k = 0; k < 9; k++) {
        reading.t_ns++;
        plr_sensors_add(&supervisor, &reading, 3, false, 3);
    }
    TEST_ASSERT_FALSE(are_off());
    plr_sensors_add(&supervisor, &reading, 3, false, 3);
    TEST_ASSERT_TRUE(are_off());
    plr_sensors_add(&supervisor, &reading, 3, true, 3);
    TEST_ASSERT_FALSE(are_off());
}

static void test_the_same_reading_again_says_nothing_new(void) {
    TEST_ASSERT_FALSE(plr_supervise_repeats(&supervisor, &reading));
    plr_sensors_add(&supervisor, &reading, 3, true, 3);
    TEST_ASSERT_TRUE(plr_supervise_repeats(&supervisor, &reading));
    reading.value[2] = 1; /* a correction */
    TEST_ASSERT_FALSE(plr_supervise_repeats(&supervisor, &reading));
}

static void test_a_position_with_a_third_of_its_sigma_is_told_and_weighed_as_it_scatters(void) {
    rig_drive(10);
    for (unsigned k = 0; k < 60; k++) {
        rig_twists();
        plr_pose at;
        scene_pose(&rig.world, &at);
        plr_reading place = {.t_ns = rig.world.t_ns, .sensor = PLR_SENSOR_POSITION, .axes = 7};
        for (unsigned i = 0; i < 3; i++)
            place.value[i] = at.p[i] + 0.3 * rng_normal(&numbers);
        each_axis(place.sigma, 0.1);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(&rig.filter, &place, NULL));
        rig_frame();
    }
    double e[6];
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_READINGS_REJECTED);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DEGRADED, rig.report.health);
    TEST_ASSERT_LESS_THAN_DOUBLE(30, rig_squared_error(e));
}
