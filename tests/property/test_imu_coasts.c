// SPDX-License-Identifier: MIT
/* An IMU carries the estimate where nothing is seen, where readings get lost, and together with what
 * measures velocity: errors stay within the covariance. Simulated flights, normalised squared errors
 * against chi-square. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/imu_rig.h"
#include "support/rigid.h"

/* In the short form fewer flights, and with them wider bounds. */
enum { RUNS = PELORUS_SHORT_FORM ? 1 : 16, SECOND = 10 /* frames */ };

static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_rig_set_up();
}

static void note(imu_rig_errors *sum) {
    const imu_rig_errors e = imu_rig_errors_now();
    imu_rig_add(sum, &e, 1.0 / RUNS);
}

/* ---------------------------------------------------------------- darkness */

static double sigma_m(void) {
    double P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(f, P));
    return sqrt(P[0] + P[7] + P[14]);
}

/* No frame for five seconds, then empty ones. The tracker has lost all points meanwhile. */
static void stay_in_the_dark(void) {
    imu_rig_readings(5 * SECOND * IMU_RIG_EVERY);
    for (unsigned k = 0; k < 5 * SECOND; k++) {
        imu_rig_readings(IMU_RIG_EVERY);
        const plr_frame empty = {imu_rig.flight.t_ns, PLR_NO_BUDGET, 0, NULL};
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(f, &empty, &imu_rig.report));
    }
    memset(imu_rig.flight.in_sight, 0, sizeof imu_rig.flight.in_sight);
}

static void test_ten_seconds_of_darkness_are_within_the_covariance_and_so_is_what_follows(void) {
    imu_rig_errors dark = {0}, after = {0};
    double sigmas = 0;
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        imu_rig_begin(IMU_RIG_GIVEN, seed);
        imu_rig_fly(5 * SECOND);
        stay_in_the_dark();
        note(&dark);
        sigmas += sigma_m() / RUNS;
        TEST_ASSERT_EQUAL_INT(PLR_HEALTH_LOST, imu_rig.report.health);
        imu_rig_fly(5 * SECOND);
        note(&after);
    }
    imu_rig_demand_consistent("in the dark", &dark, RUNS, false);
    imu_rig_demand_consistent("after it", &after, RUNS, false);
    TEST_ASSERT_TRUE(sigmas > 0.3 && sigmas < 6); /* it says that it does not know better */
}

/* ---------------------------------------------------------------- lost readings */

/* Each second a tenth of it is lost: the reading before it is held, the frame comes in its middle. */
static void fly_with_gaps(unsigned seconds) {
    for (unsigned k = 0; k < seconds * SECOND; k++) {
        const bool gap = k % SECOND == 5;
        for (unsigned i = 0; i < IMU_RIG_EVERY; i++) {
            const bool lost = (gap && i >= 20) || (k % SECOND == 6 && i < 20);
            if (lost)
                imu_rig_lose();
            else
                (void)imu_rig_read();
        }
        imu_rig_frame();
    }
}

static void test_readings_that_get_lost_are_made_up_for_in_the_covariance(void) {
    imu_rig_errors sum = {0};
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        imu_rig_begin(IMU_RIG_GIVEN, 100 + seed);
        fly_with_gaps(10);
        note(&sum);
        TEST_ASSERT_EQUAL_UINT32(0, f->totals.recoveries);
    }
    imu_rig_demand_consistent("with gaps", &sum, RUNS, true);
    TEST_ASSERT_TRUE(sqrt(sum.metres) < 0.1);
}

/* ---------------------------------------------------------------- a wheel */

/* The true velocity of a point of the body, in body axes, by differences. */
static void true_velocity_at(const double at_B[3], double v[3]) {
    static imu_flight ahead;
    double T[16], there[16], unused[3], a[3], b[3];
    imu_flight_truth(&imu_rig.flight, T, unused);
    ahead = imu_rig.flight;
    ahead.t_ns += 20000;
    imu_flight_truth(&ahead, there, unused);
    rigid_apply(a, T, at_B);
    rigid_apply(b, there, at_B);
    for (int i = 0; i < 3; i++) {
        v[i] = 0;
        for (int j = 0; j < 3; j++)
            v[i] += T[4 * j + i] * (b[j] - a[j]) / 20e-6;
    }
}

static void read_wheel(double sigma) {
    static const double at_B[3] = {0.4, -0.5, 0.2};
    double v[3];
    plr_reading wheel = {.t_ns = imu_rig.flight.t_ns, .sensor = PLR_SENSOR_WHEEL, .axes = 7};
    memcpy(wheel.at_B_m, at_B, sizeof at_B);
    true_velocity_at(at_B, v);
    for (int i = 0; i < 3; i++) {
        wheel.value[i] = v[i] + sigma * rng_normal(&imu_rig.flight.chance);
        wheel.sigma[i] = sigma;
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(f, &wheel, NULL));
}

static imu_rig_errors fly_with_wheels(bool wheels) {
    imu_rig_errors sum = {0};
    imu_rig.options.most_seen = 12;
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        imu_rig_begin(IMU_RIG_GIVEN, 200 + seed);
        for (unsigned k = 0; k < 15 * SECOND; k++) {
            imu_rig_fly(1);
            if (wheels)
                read_wheel(0.02);
        }
        note(&sum);
    }
    return sum;
}

static void test_a_wheel_makes_velocity_and_place_better_and_is_believed_as_it_should(void) {
    const imu_rig_errors without = fly_with_wheels(false), with = fly_with_wheels(true);
    imu_rig_demand_consistent("without wheels", &without, RUNS, false);
    imu_rig_demand_consistent("with wheels", &with, RUNS, false);
    TEST_ASSERT_TRUE(with.mps < 0.7 * without.mps);
    TEST_ASSERT_TRUE(with.metres < without.metres);
}

/* In the dark, wheels hold what the accelerometer lets go. */
static void test_wheels_hold_the_velocity_in_the_dark(void) {
    imu_rig_errors sum = {0};
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        imu_rig_begin(IMU_RIG_GIVEN, 300 + seed);
        imu_rig_fly(3 * SECOND);
        for (unsigned k = 0; k < 10 * SECOND; k++) {
            imu_rig_readings(IMU_RIG_EVERY);
            read_wheel(0.02);
        }
        note(&sum);
    }
    imu_rig_demand_consistent("wheels in the dark", &sum, RUNS, false);
    TEST_ASSERT_TRUE(sqrt(sum.mps) < 0.03);
    TEST_ASSERT_TRUE(sqrt(sum.metres) < 0.3);
}

/* ---------------------------------------------------------------- standstill */

static void stand(unsigned frames, bool measured) {
    for (unsigned k = 0; k < frames; k++) {
        imu_rig_readings(IMU_RIG_EVERY);
        const plr_reading still = {.t_ns = imu_rig.flight.t_ns,
                                   .sensor = PLR_SENSOR_STANDSTILL,
                                   .axes = 3,
                                   .sigma = {1e-3, 1e-4, 0}};
        if (measured) {
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(f, &still, NULL));
        }
    }
    TEST_ASSERT_TRUE(f->totals.readings_gated <= frames / 10); /* 2 % by chance */
}

/* A body that stands in the dark: its velocity and the gyro's bias are measured, and the way that it has
 * not gone. */
static void test_a_standstill_holds_velocity_and_measures_the_gyros_bias(void) {
    imu_rig_errors sums[2];
    memset(sums, 0, sizeof sums);
    imu_rig.options.rest_s = 60;
    for (int measured = 0; measured < 2; measured++)
        for (uint64_t seed = 1; seed <= RUNS; seed++) {
            imu_rig_begin(IMU_RIG_GIVEN, 400 + seed);
            stand(8 * SECOND, measured);
            note(&sums[measured]);
        }
    imu_rig_demand_consistent("standing", &sums[0], RUNS, false);
    imu_rig_demand_consistent("standstill measured", &sums[1], RUNS,
                              true); /* it stands better than it is told */
    TEST_ASSERT_TRUE(sums[1].mps < 0.01 * sums[0].mps);
    TEST_ASSERT_TRUE(sums[1].metres < 0.01 * sums[0].metres);
    TEST_ASSERT_TRUE(sums[1].rad < 0.1 * sums[0].rad);
}

/* A body that has turned until just now: what the gyro showed before is not taken for its bias. */
static void test_a_turn_that_ends_in_a_standstill_leaves_the_gyros_bias_alone(void) {
    static const plr_pose level = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    static const double none[3] = {0}, exact[3] = {1e-6, 1e-6, 1e-6};
    rng chance = rng_seeded(77);
    for (int speed = 0; speed < 4; speed++) {
        const double turn = 0.01 * pow(10, 0.7 * speed), root = 20;
        double b[6], P[36];
        imu_rig_begin(IMU_RIG_AT_REST, 1);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(f, 1000000000, &level, NULL));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(f, none, exact));
        for (unsigned k = 1; k <= 1600; k++) {
            plr_imu imu = {{0, 0, 9.81}, {0, 0, k <= 800 ? turn : 0}};
            for (int i = 0; i < 3; i++) {
                imu.a_B_mps2[i] += imu_rig.options.accel_noise * root * rng_normal(&chance);
                imu.w_B_radps[i] += imu_rig.options.gyro_noise * root * rng_normal(&chance);
            }
            const plr_time_ns t_ns = 1000000000 + UINT64_C(2500000) * k;
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(f, t_ns, &imu));
            const plr_reading still = {
                .t_ns = t_ns, .sensor = PLR_SENSOR_STANDSTILL, .axes = 3, .sigma = {1e-3, 1e-4, 0}};
            if (k > 800 && k % 40 == 0) {
                TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(f, &still, NULL));
            }
        }
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(f, b, P));
        for (int i = 3; i < 6; i++) {
            TEST_ASSERT_TRUE(sqrt(P[7 * i]) < 1.5e-3);
            TEST_ASSERT_DOUBLE_WITHIN(4 * sqrt(P[7 * i]), 0, b[i]);
        }
    }
}
