// SPDX-License-Identifier: MIT
/* MAVLink's ODOMETRY fields: what the emulated boards' test (tests/target/test_mavlink.py) does not
 * reach, since a simulated drive neither turns over nor stands on its nose. */
#include <math.h>
#include <string.h>

#include <unity.h>

/* Part of the firmware, not of the library: it is tested where it stands. */
#include "mavlink/odometry.c"

static plr_pose_message level(void) {
    plr_pose_message pose;
    memset(&pose, 0, sizeof pose);
    pose.T_WB.R[0] = pose.T_WB.R[4] = pose.T_WB.R[8] = 1.0;
    for (unsigned i = 0, k = 0; i < 6; k += ++i + 1)
        pose.P_xi[k] = pose.P_u[k] = 1.0 + i;
    return pose;
}

/* Rodrigues' formula; the axis is a unit vector. */
static void rotation(double R[9], const double axis[3], double angle) {
    const double c = cos(angle), s = sin(angle), t = 1.0 - c;
    const double x = axis[0], y = axis[1], z = axis[2];
    const double full[9] = {t * x * x + c,     t * x * y - s * z, t * x * z + s * y,
                            t * x * y + s * z, t * y * y + c,     t * y * z - s * x,
                            t * x * z - s * y, t * y * z + s * x, t * z * z + c};
    memcpy(R, full, sizeof full);
}

static void check_quaternion(const double R[9], const float q[4]) {
    const double w = (double)q[0], x = (double)q[1], y = (double)q[2], z = (double)q[3];
    const double back[9] = {
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
        2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    for (unsigned i = 0; i < 9; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, R[i], back[i]);
    TEST_ASSERT_TRUE(q[0] >= 0.0F);
}

static void test_quaternion_gives_the_rotation_back_for_every_largest_component(void) {
    static const double axes[4][3] = {
        {0.6, 0.64, 0.48}, {0.96, 0.28, 0.0}, {0.28, 0.96, 0.0}, {0.0, 0.28, 0.96}};
    for (unsigned i = 0; i < 4; i++)
        for (double angle = 0.1; angle < 6.28; angle += 0.3) {
            plr_pose_message pose = level();
            plr_odometry o;
            rotation(pose.T_WB.R, axes[i], angle);
            TEST_ASSERT_EQUAL(PLR_OK,
                              plr_odometry_from_pose(&o, &pose, PLR_AXES_FRD, PLR_HEALTH_GOOD));
            check_quaternion(pose.T_WB.R, o.q);
        }
}

static void test_level_body_has_its_own_covariance_as_that_of_roll_pitch_and_yaw(void) {
    const plr_pose_message pose = level();
    plr_odometry o;
    TEST_ASSERT_EQUAL(PLR_OK, plr_odometry_from_pose(&o, &pose, PLR_AXES_FLU, PLR_HEALTH_GOOD));
    static const unsigned diagonal[6] = {0, 6, 11, 15, 18, 20};
    for (unsigned i = 0; i < 6; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1.0 + i, (double)o.pose_covariance[diagonal[i]]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1.0 + i, (double)o.velocity_covariance[diagonal[i]]);
    }
}

/* With an IMU velocity is estimated, and its errors belong together: signs go on both sides. */
static void test_velocity_comes_with_its_covariance_in_the_axes_of_the_autopilot(void) {
    plr_pose_message pose = level();
    plr_odometry o;
    for (unsigned i = 0; i < 21; i++)
        pose.P_u[i] = 0.01 * (i + 1);
    for (unsigned i = 0; i < 3; i++) {
        pose.velocity.v_B_mps[i] = 1.0 + i;
        pose.velocity.w_B_radps[i] = 0.1 + i;
    }
    TEST_ASSERT_EQUAL(PLR_OK, plr_odometry_from_pose(&o, &pose, PLR_AXES_FLU, PLR_HEALTH_GOOD));
    static const double sign[6] = {1, -1, -1, 1, -1, -1};
    for (unsigned i = 0; i < 3; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, sign[i] * (1.0 + i), (double)o.v[i]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, sign[i] * (0.1 + i), (double)o.w[i]);
    }
    for (unsigned i = 0, k = 0; i < 6; i++)
        for (unsigned j = i; j < 6; j++, k++)
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, sign[i] * sign[j] * pose.P_u[j * (j + 1) / 2 + i],
                                      (double)o.velocity_covariance[k]);
}

static void test_covariance_is_unknown_where_euler_angles_have_no_meaning(void) {
    static const double y[3] = {0.0, 1.0, 0.0};
    plr_pose_message pose = level();
    plr_odometry o;
    rotation(pose.T_WB.R, y, acos(-1.0) / 2 - 0.01);
    TEST_ASSERT_EQUAL(PLR_OK, plr_odometry_from_pose(&o, &pose, PLR_AXES_FRD, PLR_HEALTH_GOOD));
    TEST_ASSERT_TRUE(isnan(o.pose_covariance[0]));
    TEST_ASSERT_FALSE(isnan(o.velocity_covariance[0]));
    rotation(pose.T_WB.R, y, acos(-1.0) / 2 - 0.1);
    TEST_ASSERT_EQUAL(PLR_OK, plr_odometry_from_pose(&o, &pose, PLR_AXES_FRD, PLR_HEALTH_GOOD));
    TEST_ASSERT_FALSE(isnan(o.pose_covariance[0]));
}

static void test_covariances_are_unknown_once_the_filter_has_diverged(void) {
    plr_pose_message pose = level();
    plr_odometry o;
    for (unsigned i = 0, k = 0; i < 6; k += ++i + 1)
        pose.P_xi[k] = pose.P_u[k] = PLR_WIRE_UNKNOWN_VARIANCE;
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_odometry_from_pose(&o, &pose, PLR_AXES_FRD, PLR_HEALTH_DIVERGED));
    for (unsigned i = 0; i < 21; i++) {
        TEST_ASSERT_FLOAT_IS_NAN(o.pose_covariance[i]);
        TEST_ASSERT_FLOAT_IS_NAN(o.velocity_covariance[i]);
    }
    TEST_ASSERT_EQUAL_INT8(-1, o.quality);
}

static void test_health_becomes_quality(void) {
    static const int8_t expected[] = {[PLR_HEALTH_GOOD] = 100,
                                      [PLR_HEALTH_DEGRADED] = 50,
                                      [PLR_HEALTH_LOST] = 1,
                                      [PLR_HEALTH_DIVERGED] = -1};
    const plr_pose_message pose = level();
    for (int health = PLR_HEALTH_GOOD; health <= PLR_HEALTH_DIVERGED; health++) {
        plr_odometry o;
        TEST_ASSERT_EQUAL(PLR_OK,
                          plr_odometry_from_pose(&o, &pose, PLR_AXES_FRD, (plr_health)health));
        TEST_ASSERT_EQUAL(expected[health], o.quality);
    }
}

static void test_reset_count_wraps_as_a_byte(void) {
    plr_pose_message pose = level();
    plr_odometry o;
    pose.reset_count = 258;
    TEST_ASSERT_EQUAL(PLR_OK, plr_odometry_from_pose(&o, &pose, PLR_AXES_FRD, PLR_HEALTH_GOOD));
    TEST_ASSERT_EQUAL(2, o.reset_counter);
}

static void test_unknown_axes_and_null_pointers_are_refused(void) {
    const plr_pose_message pose = level();
    plr_odometry o;
    TEST_ASSERT_EQUAL(PLR_E_ARGUMENT,
                      plr_odometry_from_pose(&o, &pose, PLR_AXES_OTHER, PLR_HEALTH_GOOD));
    TEST_ASSERT_EQUAL(PLR_E_ARGUMENT,
                      plr_odometry_from_pose(NULL, &pose, PLR_AXES_FRD, PLR_HEALTH_GOOD));
    TEST_ASSERT_EQUAL(PLR_E_ARGUMENT,
                      plr_odometry_from_pose(&o, NULL, PLR_AXES_FRD, PLR_HEALTH_GOOD));
}
