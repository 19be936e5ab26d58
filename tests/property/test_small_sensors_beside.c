// SPDX-License-Identifier: MIT
/* Wheel, standstill and position beside the nominal case: what is refused and rejected, how long a
 * velocity is held, what a sensor that is wrong can do. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/axes.h"
#include "support/rig.h"
#include "support/small_sensors.h"
#include "support/specimens.h"

void setUp(void) {
    small_sensors_set_up();
}

/* ---------------------------------------------------------------- what is refused, and rejected */

static void refuse(plr_reading reading, plr_status expected) {
    plr_reading_result result;
    rig_remember();
    rig_demand_untouched(expected, plr_filter_measure(&rig.filter, &reading, &result));
    TEST_ASSERT_EQUAL_INT(expected, result.status);
    TEST_ASSERT_FALSE(result.used);
    TEST_ASSERT_EQUAL_UINT32(rig.before.totals.readings_refused + 1,
                             rig.filter.totals.readings_refused);
}

static void test_bad_readings_are_refused_and_change_nothing(void) {
    plr_reading good = wheel(7, 0.1), bad;
    refuse(good, PLR_E_TIME); /* before the first twist */
    rig_twist();
    good.t_ns = rig.world.t_ns;
    bad = good, bad.sensor = PLR_SENSORS + 1, refuse(bad, PLR_E_ARGUMENT);
    bad = good, bad.sensor = 0, refuse(bad, PLR_E_ARGUMENT);
    bad = good, bad.axes = 0, refuse(bad, PLR_E_ARGUMENT);
    bad = good, bad.axes = 8, refuse(bad, PLR_E_ARGUMENT);
    bad = good, bad.sensor = PLR_SENSOR_STANDSTILL, bad.axes = 4, refuse(bad, PLR_E_ARGUMENT);
    bad = good, bad.value[1] = (double)NAN, refuse(bad, PLR_E_NOT_FINITE);
    bad = good, bad.at_B_m[2] = (double)INFINITY, refuse(bad, PLR_E_NOT_FINITE);
    bad = good, bad.sigma[0] = (double)NAN, refuse(bad, PLR_E_NOT_FINITE);
    bad = good, bad.sigma[0] = 0, refuse(bad, PLR_E_ARGUMENT);
    bad = good, bad.sensor = PLR_SENSOR_STANDSTILL, bad.axes = 3, bad.value[1] = 0.5;
    refuse(bad, PLR_E_ARGUMENT); /* a standstill has no value */
    bad = good, bad.sigma[2] = 1e7, refuse(bad, PLR_E_RANGE);
    bad = good, bad.value[0] = 2e4, refuse(bad, PLR_E_RANGE);
    bad = good, bad.sensor = PLR_SENSOR_POSITION, bad.value[0] = 2e9, refuse(bad, PLR_E_RANGE);
    bad = good, bad.at_B_m[0] = 1e4, refuse(bad, PLR_E_RANGE);
    bad = good, bad.t_ns = 1, refuse(bad, PLR_E_LATE);
    bad = good, bad.t_ns += 10000000000U, refuse(bad, PLR_E_GAP);
    bad = good, bad.axes = 1, bad.sigma[1] = (double)NAN; /* not measured: not looked at */
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(&rig.filter, &bad, NULL));
}

static void test_what_the_gate_rejects_changes_nothing_but_the_time(void) {
    plr_reading_result result;
    rig_drive(10);
    for (int sensor = PLR_SENSOR_WHEEL; sensor <= PLR_SENSOR_POSITION; sensor++) {
        plr_reading wild = sensor == PLR_SENSOR_POSITION ? position(7, 0.1) : wheel(7, 0.01);
        wild.sensor = (uint8_t)sensor;
        wild.axes = sensor == PLR_SENSOR_STANDSTILL ? 3 : 7;
        if (sensor == PLR_SENSOR_STANDSTILL)
            memset(wild.value, 0, sizeof wild.value);
        else
            wild.value[0] += 100;
        each_axis(wild.sigma, 0.001);
        plr_filter_predict(&rig.filter, rig.world.t_ns, &(plr_twist){{2, 0, 0}, {0, 0, 0}});
        rig_remember();
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(&rig.filter, &wild, &result));
        TEST_ASSERT_FALSE(result.used);
        TEST_ASSERT_GREATER_THAN_DOUBLE(40, result.d2);
        TEST_ASSERT_EQUAL_UINT32(rig.before.totals.readings_gated + 1,
                                 rig.filter.totals.readings_gated);
        rig.before.totals = rig.filter.totals;
        memcpy(rig.before.supervisor.sensors, rig.filter.supervisor.sensors,
               sizeof rig.before.supervisor.sensors);
        rig.before.source.wheels = rig.filter.source.wheels; /* that it slips is noted */
        TEST_ASSERT_TRUE(specimen_same_state(&rig.before, &rig.filter));
        scene_move(&rig.world, RIG_STEP_NS);
    }
}

/* Six wrong ones add up to more than chance, and they are told until good ones outweigh them. */
static void test_rejected_ones_in_succession_are_a_reason(void) {
    rig_drive(20);
    for (int k = 0; k < 10; k++) {
        TEST_ASSERT_EQUAL_INT(k > 5, (rig.report.reasons & PLR_REASON_READINGS_REJECTED) != 0);
        rig_twist();
        plr_reading wild = position(7, 0.05);
        wild.value[0] += 30;
        measure(wild);
        rig_frame();
    }
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_READINGS_REJECTED);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DEGRADED, rig.report.health);
    for (int k = 0; k < 40; k++) {
        rig_twist();
        measure(position(7, 0.05));
        rig_frame();
    }
    TEST_ASSERT_FALSE(rig.report.reasons & PLR_REASON_READINGS_REJECTED);
}

static void test_positions_in_the_dark_are_degraded_and_not_lost(void) {
    rig_drive(10);
    rig.options.most_seen = rig.world.is.most_seen = 0; /* the lamp goes out */
    for (int k = 0; k < 40; k++) {
        rig_twists();
        if (k % 10 == 0 && k < 20)
            measure(position(7, 0.05));
        rig_frame();
        if (k == 25)
            TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DEGRADED, rig.report.health);
    }
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_NO_OBSERVATIONS);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_LOST,
                          rig.report.health); /* the positions have ended as well */
}

/* ---------------------------------------------------------------- what is held, and for how long */

/* Twists of v m/s along x at 100 Hz, without noise or camera. */
static void plain_twists(unsigned steps, double v) {
    for (unsigned i = 0; i < steps; i++) {
        const plr_twist twist = {{v, 0, 0}, {0, 0, 0}};
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, rig.world.t_ns, &twist));
        rig.world.t_ns += RIG_STEP_NS;
    }
}

static double x_now(double *sigma) {
    double P[36];
    const plr_pose pose = pose_of(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    *sigma = sqrt(P[0]);
    return pose.p[0];
}

static void test_a_standstill_does_not_stop_a_robot_that_drives_off(void) {
    rig.config.gate_d2 = 13.3;
    for (unsigned every_ns = 100000000; every_ns <= 2000000000; every_ns *= 20) {
        double sigma;
        rig_begin();
        for (int k = 0; k < 5; k++) {
            plain_twists(every_ns / RIG_STEP_NS, 0);
            rig.world.t_ns -= RIG_STEP_NS;
            measure(reading_of(PLR_SENSOR_STANDSTILL, 3, 0.01));
            rig.world.t_ns += RIG_STEP_NS;
        }
        const double before = x_now(&sigma);
        plain_twists(301, 1);
        TEST_ASSERT_DOUBLE_WITHIN(0.05, 3, x_now(&sigma) - before);
        TEST_ASSERT_LESS_THAN_DOUBLE(5, fabs(x_now(&sigma) - before - 3) / sigma);
    }
}

static void test_a_wheel_that_has_ended_is_not_believed_for_seconds(void) {
    double with, without;
    for (int wheels = 0; wheels < 2; wheels++) {
        rig_begin();
        for (unsigned k = 0; k < 20; k++) {
            plain_twists(1, 1);
            rig.world.t_ns -= RIG_STEP_NS;
            plr_reading reading = reading_of(PLR_SENSOR_WHEEL, 7, 0.001);
            reading.value[0] = 1;
            if (wheels)
                measure(reading);
            rig.world.t_ns += RIG_STEP_NS;
        }
        rig.world.t_ns += 1900000000;
        plain_twists(1, 1);
        (void)x_now(wheels ? &with : &without);
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.2 * without, without, with);
}

static void test_two_readings_of_one_time_count_as_readings(void) {
    double once, twice, never;
    for (int readings = 0; readings < 3; readings++) {
        rig_begin();
        for (unsigned k = 0; k < 200; k++) {
            plain_twists(1, 1);
            rig.world.t_ns -= RIG_STEP_NS;
            plr_reading reading = reading_of(PLR_SENSOR_WHEEL, 7, 0.01);
            reading.value[0] = 1;
            for (int i = 0; i < readings; i++)
                measure(reading);
            rig.world.t_ns += RIG_STEP_NS;
        }
        (void)x_now(readings == 0 ? &never : readings == 1 ? &once : &twice);
    }
    TEST_ASSERT_LESS_THAN_DOUBLE(0.9 * never, once);
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * once, once, twice);
}

/* With the gate off a reading may say anything. */
static void test_an_impossible_velocity_does_not_take_the_pose_along(void) {
    rig.config.gate_d2 = 0;
    rig_begin();
    for (unsigned k = 0; k < 20; k++) {
        plain_twists(1, 1);
        rig.world.t_ns -= RIG_STEP_NS;
        plr_reading reading = reading_of(PLR_SENSOR_WHEEL, 7, 0.01);
        reading.value[1] = 9e3;
        measure(reading);
        rig.world.t_ns += RIG_STEP_NS;
    }
    double sigma;
    TEST_ASSERT_TRUE(isfinite(x_now(&sigma)) && isfinite(sigma));
}

static void test_wheel_and_standstill_that_disagree_leave_the_biases_finite(void) {
    rig_begin();
    for (unsigned k = 0; k < 50; k++) {
        plain_twists(1, 0);
        rig.world.t_ns -= RIG_STEP_NS;
        plr_reading reading = reading_of(PLR_SENSOR_WHEEL, 7, 1e-10);
        reading.value[0] = 0.15;
        measure(reading);
        measure(reading_of(PLR_SENSOR_STANDSTILL, 3, 1e-10));
        rig.world.t_ns += RIG_STEP_NS;
    }
    rig_drive(2);
    double b[6], P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P));
    for (int i = 0; i < 6; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1, 0, b[i]);
}

static void test_a_position_a_kilometre_off_is_rejected_and_nothing_diverges(void) {
    double P_xi[36] = {0};
    plr_reading_result result;
    for (int i = 0; i < 6; i++)
        P_xi[7 * i] = i < 3 ? 1e8 : 1e-4;
    rig_begin();
    plain_twists(2, 0);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_set_pose(&rig.filter, rig.world.t_ns, &rig_identity, P_xi));
    plain_twists(2, 0);
    plr_reading far = reading_of(PLR_SENSOR_POSITION, 7, 1);
    far.value[0] = 1500;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(&rig.filter, &far, &result));
    TEST_ASSERT_FALSE(result.used);
    far.value[0] = 500; /* and one within reach is used, however sharp it is */
    each_axis(far.sigma, 0.02);
    for (int k = 0; k < 5; k++) {
        plain_twists(1, 0);
        far.t_ns = rig.world.t_ns;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(&rig.filter, &far, &result));
    }
    double sigma;
    TEST_ASSERT_TRUE(result.used);
    TEST_ASSERT_DOUBLE_WITHIN(2, 500, x_now(&sigma));
    TEST_ASSERT_EQUAL_UINT32(0, rig.filter.totals.recoveries);
}

static void test_a_frozen_picture_is_seen_between_positions_too(void) {
    rig_drive(20);
    plr_frame frozen = scene_look(&rig.world);
    unsigned told = 0;
    for (int k = 0; k < 20; k++) {
        rig_twists();
        measure(position(7, 0.5));
        frozen.t_ns = rig.world.t_ns;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frozen, &rig.report));
        told += (rig.report.reasons & PLR_REASON_FROZEN_IMAGE) != 0;
    }
    TEST_ASSERT_GREATER_THAN_UINT(15, told);
}

static void test_a_position_given_twice_is_one(void) {
    rig_drive(5);
    plr_reading place = position(7, 0.05);
    measure(place);
    refuse(place, PLR_E_TIME);
    place.value[0] += 0.01; /* another sensor's, of the same time */
    measure(place);
}

/* With 10 m and 0.1 rad of uncertainty a height differs by half a metre for the second order alone. */
static void test_a_height_tells_no_tilt_where_place_and_tilt_are_unknown(void) {
    double P[36] = {0}, after[36];
    const double variance[6] = {100, 100, 1, 0.01, 0.01, 0.01};
    for (int i = 0; i < 6; i++)
        P[7 * i] = variance[i];
    rig_drive(1);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_set_pose(&rig.filter, rig.world.t_ns, &rig_identity, P));
    rig_twist();
    for (int k = 0; k < 20; k++) {
        rig_twist();
        measure(position(4, 0.01));
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, after));
    TEST_ASSERT_GREATER_THAN_DOUBLE(0.009, after[21]);
    TEST_ASSERT_GREATER_THAN_DOUBLE(0.009, after[28]);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.5, after[14]); /* it does tell the height */
}

static void test_heights_alone_do_not_keep_a_dark_drive_from_being_lost(void) {
    rig_drive(10);
    rig.options.most_seen = rig.world.is.most_seen = 0;
    for (int k = 0; k < 30; k++) {
        rig_twists();
        measure(position(4, 0.05));
        rig_frame();
    }
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_LOST, rig.report.health);
}

static void test_rejected_readings_are_told_without_frames_too(void) {
    plr_health_state health;
    rig_drive(5);
    for (int k = 0; k < 10; k++) {
        rig_twist();
        plr_reading wild = position(7, 0.05);
        wild.value[0] += 30;
        measure(wild);
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_health(&rig.filter, rig.world.t_ns, &health));
    TEST_ASSERT_TRUE(health.reasons & PLR_REASON_READINGS_REJECTED);
}
