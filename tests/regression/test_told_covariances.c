// SPDX-License-Identifier: MIT
/*
 * The covariances that a filter tells were not always what plr_filter_set_pose asks for, "symmetric and
 * positive": that of an IMU's velocity was symmetric but for rounding, and where float32 has left a P
 * that is not quite positive, so was what was told of it. Nor are numbers told that are not finite.
 */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "filter/filter_internal.h"
#include "math/packed.h"
#include "support/imu_rig.h"
#include "support/reseal.h"
#include "support/rig.h"

void setUp(void) {
    rig_set_up();
    imu_rig_set_up();
}

static void demand_symmetric(const double P[36]) {
    for (unsigned i = 0; i < 6; i++)
        for (unsigned j = 0; j < i; j++)
            TEST_ASSERT_TRUE(P[6 * i + j] == P[6 * j + i]);
}

static void test_what_a_filter_with_an_imu_tells_is_symmetric_to_the_bit(void) {
    imu_rig_begin(IMU_RIG_GIVEN, 1);
    for (unsigned k = 0; k < 20; k++) {
        double P[36], b[6];
        imu_rig_fly(1);
        imu_rig_readings(7);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(&imu_rig.filter, P));
        demand_symmetric(P);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&imu_rig.filter, P));
        demand_symmetric(P);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&imu_rig.filter, b, P));
        demand_symmetric(P);
    }
}

/* Makes two of the pose's numbers correlated by this much, and no others. */
static void correlate(double correlation) {
    plr_real *P = rig.filter.belief.P;
    const double x = (double)P[plr_packed_at(0, 0)], yaw = (double)P[plr_packed_at(5, 5)];
    for (unsigned i = 0; i < 6; i++)
        for (unsigned j = 0; j < i; j++)
            P[plr_packed_at(i, j)] = 0;
    P[plr_packed_at(5, 0)] = (plr_real)(correlation * sqrt(x * yaw));
    reseal(&rig.filter);
}

static void test_what_is_told_of_a_pose_is_taken_back(void) {
    static const double beyond[] = {0.5, 1.000001, 1.002, 1.5, 20};
    rig_begin();
    rig_drive(10);
    for (unsigned i = 0; i < sizeof beyond / sizeof *beyond; i++) {
        double P[36];
        correlate(beyond[i]);
        const plr_pose pose = pose_of(&rig.filter);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
        TEST_ASSERT_TRUE(plr_is_covariance(P, 6));
        plr_filter other = rig.filter;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&other, other.belief.t_ns, &pose, P));
    }
}

static void test_variances_are_enlarged_by_no_more_than_it_takes(void) {
    double P[36];
    rig_begin();
    rig_drive(10);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    const double before = P[0];
    correlate(1.0001);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    TEST_ASSERT_TRUE(P[0] > before && P[0] < 1.01 * before);
    for (unsigned i = 1; i < 6; i++)
        TEST_ASSERT_TRUE(P[7 * i] > 0);
}

static void test_a_covariance_that_is_not_finite_is_not_told(void) {
    double P[36] = {7};
    rig_begin();
    rig_drive(3);
    rig.filter.belief.P[plr_packed_at(1, 1)] = (plr_real)INFINITY;
    reseal(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_E_DIVERGED, plr_filter_pose_covariance(&rig.filter, P));
    TEST_ASSERT_TRUE(P[0] == 7);
    TEST_ASSERT_TRUE(plr_filter_trace(&rig.filter) == 0);
}

static int count_finite(void *context, const plr_landmark *landmark) {
    unsigned *count = context;
    for (unsigned i = 0; i < 9; i++)
        TEST_ASSERT_TRUE(isfinite(landmark->p_W_m[i % 3]) && isfinite(landmark->P_W_m2[i]));
    (*count)++;
    return 0;
}

static void test_a_landmark_that_is_not_finite_is_not_handed_to_the_map(void) {
    unsigned handed = 0;
    plr_landmark landmark = {.id = 7};
    rig.map.sink = count_finite;
    rig.map.context = &handed;
    rig_begin();
    rig_drive(3);
    const unsigned active = plr_filter_landmark_count(&rig.filter);
    rig.filter.belief.slots[1].x[0] = (plr_real)INFINITY;
    reseal(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_E_DIVERGED, plr_filter_landmark(&rig.filter, 1, &landmark));
    TEST_ASSERT_EQUAL_UINT(7, landmark.id);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_flush_map(&rig.filter));
    TEST_ASSERT_EQUAL_UINT(active - 1, handed);
    TEST_ASSERT_EQUAL_UINT(0, plr_filter_landmark_count(&rig.filter));
}
