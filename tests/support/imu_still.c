// SPDX-License-Identifier: MIT
#include "support/imu_still.h"

#include <math.h>
#include <unity.h>

static plr_filter *const f = &imu_rig.filter;
rng imu_still_chance;

void imu_still_set_up(void) {
    imu_rig_set_up();
    imu_still_chance = rng_seeded(401);
}

/* A new filter whose clock has not begun. */
void imu_still_begin(void) {
    plr_calibration calibration;
    imu_flight_start(&imu_rig.flight, &imu_rig.options);
    calibration = imu_rig.flight.calibration;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(f, &calibration, &imu_rig.config, NULL));
}

/* A filter in a pose with this roll, which is given. */
void imu_still_begin_at(double roll) {
    plr_pose pose = {{1, 0, 0, 0, cos(roll), -sin(roll), 0, sin(roll), cos(roll)}, {1, 2, 3}};
    imu_still_begin();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(f, 1000000000, &pose, NULL));
}

/* Readings at 400 Hz that a body at rest gives, with noise: of this specific force and rate. */
plr_status imu_still_feed(unsigned count, const double a[3], const double w[3]) {
    const double root = sqrt(IMU_STILL_SECOND);
    plr_time_ns t_ns = plr_filter_time(f) ? plr_filter_time(f) : 1000000000;
    plr_status status = PLR_OK;
    for (unsigned k = 0; k < count && status == PLR_OK; k++) {
        plr_imu imu;
        for (int i = 0; i < 3; i++) {
            imu.a_B_mps2[i] =
                a[i] + imu_rig.options.accel_noise * root * rng_normal(&imu_still_chance);
            imu.w_B_radps[i] =
                w[i] + imu_rig.options.gyro_noise * root * rng_normal(&imu_still_chance);
        }
        t_ns += 2500000;
        status = plr_filter_inertial(f, t_ns, &imu);
    }
    return status;
}

void imu_still_feed_up(unsigned count, double x, double y, double z) {
    static const double none[3] = {0};
    const double a[3] = {x, y, z};
    TEST_ASSERT_EQUAL_INT(PLR_OK, imu_still_feed(count, a, none));
}

uint32_t imu_still_reasons(void) {
    plr_health_state health;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_health(f, plr_filter_time(f), &health));
    return health.reasons;
}

void imu_still_demand_waiting(plr_imu_fault fault) {
    plr_health_state health;
    TEST_ASSERT_FALSE(f->source.inertial.phase >= PLR_IMU_UNSETTLED);
    TEST_ASSERT_EQUAL_INT(fault, plr_filter_imu_fault(f));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_health(f, plr_filter_time(f), &health));
    TEST_ASSERT_TRUE(health.reasons & PLR_REASON_NOT_STARTED);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_LOST, health.health);
    const bool says = fault != PLR_IMU_FAULT_NONE && fault != PLR_IMU_FAULT_MOVES;
    TEST_ASSERT_EQUAL_INT(says, (health.reasons & PLR_REASON_IMU_FAULT) != 0);
}

void imu_still_demand_started(void) {
    TEST_ASSERT_TRUE(f->source.inertial.phase >= PLR_IMU_UNSETTLED);
    TEST_ASSERT_FALSE(imu_still_reasons() & PLR_REASON_NOT_STARTED);
}

static plr_observation points[5];

plr_report imu_still_look(double shift_px) {
    plr_report report;
    for (unsigned i = 0; i < 5; i++) {
        const float u = (float)(100 + 90 * i + shift_px);
        points[i] = (plr_observation){i + 1, u, 200, u - 12, 200, 0};
    }
    const plr_frame frame = {plr_filter_time(f), PLR_NO_BUDGET, 5, points};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(f, &frame, &report));
    return report;
}
