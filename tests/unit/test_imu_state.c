// SPDX-License-Identifier: MIT
/* A filter with an IMU that is saved and restored is the same filter, to the bit; and after a power cut it goes on. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/imu_rig.h"
#include "support/rigid.h"
#include "support/state_bytes.h"

static plr_filter *const f = &imu_rig.filter;
static plr_filter restored;
static state_bytes state;
static plr_time_ns ahead_ns; /* of the filter's clock */

void setUp(void) {
    imu_rig_set_up();
    imu_rig.config.slots = 12;
    imu_rig.options.most_seen = 14;
    ahead_ns = 0;
}

/* Both filters get the same readings and frames, and make the same of each frame. */
static void fly_both(unsigned frames, bool same) {
    for (unsigned k = 1; k <= frames * IMU_RIG_EVERY; k++) {
        plr_report reports[2];
        const plr_imu imu = imu_rig_read();
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(&restored, imu_rig.flight.t_ns, &imu));
        if (k % IMU_RIG_EVERY > 0)
            continue;
        const plr_frame frame = imu_flight_look(&imu_rig.flight);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(f, &frame, &reports[0]));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&restored, &frame, &reports[1]));
        if (same)
            TEST_ASSERT_EQUAL_MEMORY(&reports[0], &reports[1], sizeof reports[0]);
    }
}

/* Saves now, and restores into another filter. */
static void restore_from_now(void) {
    state_bytes_save(&state, f);
    memset(&restored, 0, sizeof restored);
    TEST_ASSERT_EQUAL_INT(
        PLR_OK, plr_filter_init(&restored, &imu_rig.flight.calibration, &f->config, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &restored));
}

/* And both go on. */
static void save_restore_and_go_on(unsigned frames) {
    restore_from_now();
    TEST_ASSERT_TRUE(state_bytes_same_filter(f, &restored));
    fly_both(frames, true);
    TEST_ASSERT_TRUE(state_bytes_same_filter(f, &restored));
}

static void test_in_flight_it_goes_on_with_the_same_bits(void) {
    imu_rig_begin(IMU_RIG_GIVEN, 21);
    imu_rig_fly(15);
    imu_rig_readings(17);
    TEST_ASSERT_EQUAL_UINT8(1, f->motion.pending);
    save_restore_and_go_on(15);
    TEST_ASSERT_GREATER_THAN_UINT(10, f->belief.count);
}

/* What was averaged until then is not part of a state. */
static void test_before_its_start_it_averages_anew_and_starts_later(void) {
    plr_health_state health;
    imu_rig_begin(IMU_RIG_AT_REST, 22);
    imu_rig_fly(8);
    imu_rig_readings(7);
    restore_from_now();
    fly_both(4, false);
    TEST_ASSERT_TRUE(f->source.inertial.phase >= PLR_IMU_UNSETTLED);
    TEST_ASSERT_FALSE(restored.source.inertial.phase >= PLR_IMU_UNSETTLED);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_health(&restored, plr_filter_time(&restored), &health));
    TEST_ASSERT_TRUE(health.reasons & PLR_REASON_NOT_STARTED);
    fly_both(7, false);
    TEST_ASSERT_TRUE(restored.source.inertial.phase >= PLR_IMU_UNSETTLED);
}

static void test_between_a_start_in_motion_and_its_anchor_too(void) {
    imu_rig_begin(IMU_RIG_IN_MOTION, 23);
    imu_rig_fly(12);
    TEST_ASSERT_EQUAL_UINT8(PLR_IMU_UNSETTLED, f->source.inertial.phase);
    save_restore_and_go_on(15);
    TEST_ASSERT_EQUAL_UINT8(PLR_IMU_SETTLED, restored.source.inertial.phase);
}

static void test_what_it_knows_of_a_faulty_sensor_is_kept(void) {
    imu_rig.config.gyro_range_radps = 5;
    imu_rig_begin(IMU_RIG_GIVEN, 24);
    imu_rig_fly(3);
    plr_imu imu = imu_rig_read();
    for (int k = 0; k < 5; k++) { /* halfway to frozen */
        imu_flight_move(&imu_rig.flight);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(f, imu_rig.flight.t_ns, &imu));
    }
    imu.w_B_radps[0] = 6;
    TEST_ASSERT_EQUAL_INT(PLR_E_RANGE, plr_filter_inertial(f, imu_rig.flight.t_ns + 1, &imu));
    save_restore_and_go_on(3);
}

static void test_how_many_readings_were_refused_in_succession_is_kept(void) {
    imu_rig_begin(IMU_RIG_GIVEN, 25);
    imu_rig_fly(3);
    const plr_imu imu = imu_rig_read();
    for (unsigned k = 0; k < 900; k++) { /* 2.25 s, more than max-gap */
        if (k == 700)                    /* less */
            restore_from_now();
        TEST_ASSERT_EQUAL_INT(PLR_E_TIME, plr_filter_inertial(f, 1, &imu));
        if (k >= 700)
            TEST_ASSERT_EQUAL_INT(PLR_E_TIME, plr_filter_inertial(&restored, 1, &imu));
    }
    TEST_ASSERT_TRUE(state_bytes_same_filter(f, &restored));
    TEST_ASSERT_EQUAL_UINT32(900, restored.source.unused);
}

/* ---------------------------------------------------------------- after a power cut */

/* The filter alone, on another clock than the flight's. */
static void fly_on(unsigned frames) {
    for (unsigned k = 1; k <= frames * IMU_RIG_EVERY; k++) {
        imu_flight_move(&imu_rig.flight);
        const plr_imu imu = imu_flight_read(&imu_rig.flight);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(f, imu_rig.flight.t_ns + ahead_ns, &imu));
        if (k % IMU_RIG_EVERY > 0)
            continue;
        plr_frame frame = imu_flight_look(&imu_rig.flight);
        frame.t_ns += ahead_ns;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(f, &frame, &imu_rig.report));
    }
}

/* No readings for so long; then the filter is told how far the body may have moved. */
static void cut_power(unsigned readings, double sigma_m, double sigma_rad) {
    double P_moved[36] = {0};
    for (int i = 0; i < 6; i++)
        P_moved[7 * i] = i < 3 ? sigma_m * sigma_m : sigma_rad * sigma_rad;
    for (unsigned k = 0; k < readings; k++)
        imu_flight_move(&imu_rig.flight);
    memset(imu_rig.flight.in_sight, 0, sizeof imu_rig.flight.in_sight);
    ahead_ns = UINT64_C(3600000000000);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(f, imu_rig.flight.t_ns + ahead_ns, P_moved));
}

static void test_after_a_power_cut_at_rest_it_flies_on(void) {
    imu_rig.options.rest_s = 30;
    imu_rig_begin(IMU_RIG_GIVEN, 25);
    imu_rig_fly(20);
    imu_rig_readings(9);
    cut_power(10000, 1e-3, 1e-3);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_save(f, NULL, NULL));
    fly_on(60);
    const imu_rig_errors e = imu_rig_errors_now();
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, imu_rig.report.health);
    TEST_ASSERT_EQUAL_UINT32(0, f->totals.recoveries);
    TEST_ASSERT_TRUE(e.metres < 0.05);
    TEST_ASSERT_TRUE(e.mps < 0.05);
    TEST_ASSERT_TRUE(e.velocity < 20);
    TEST_ASSERT_TRUE(e.position < 20);
}

/* A body that was flying has another velocity and another pose: the pictures find the former, and the
 * latter is as uncertain as was said. */
static void test_after_a_power_cut_in_flight_velocity_and_tilt_are_found_again(void) {
    imu_rig_begin(IMU_RIG_GIVEN, 26);
    imu_rig_fly(20);
    cut_power(120, 1, 0.15);
    fly_on(60);
    const imu_rig_errors e = imu_rig_errors_now();
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, imu_rig.report.health);
    TEST_ASSERT_EQUAL_UINT32(0, f->totals.recoveries);
    TEST_ASSERT_TRUE(e.mps < 0.1);
    TEST_ASSERT_TRUE(e.velocity < 20);
    TEST_ASSERT_TRUE(e.position < 40);
}
