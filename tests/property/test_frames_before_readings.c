// SPDX-License-Identifier: MIT
/* A frame that stands 1 ns to 1 ms before a twist or a reading, as rounded stamps lie, is worth what one at
 * the same time is: what the odometry says of its errors afterwards, and what they are. */
#include <math.h>
#include <stdio.h>
#include <unity.h>

#include "support/axes.h"
#include "support/exact_camera.h"
#include "support/imu_rig.h"
#include "support/scene.h"

static const plr_time_ns leads_ns[] = {0, 1, 416, 1000, 1000000};
enum { LEADS = sizeof leads_ns / sizeof leads_ns[0], TIMINGS = PLR_TWIST_MID + 1 };

static plr_filter *const f = &imu_rig.filter;

void setUp(void) {
    imu_rig_set_up();
}

static void demand_alike(const char *what, const double found[LEADS]) {
    for (unsigned i = 1; i < LEADS; i++)
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.05 * found[0], found[0], found[i], what);
}

/* ---------------------------------------------------------------- an IMU */

enum { SECOND = 10 /* frames */ };

static void frame_at(plr_time_ns lead_ns, bool dark) {
    imu_rig.flight.t_ns -= lead_ns;
    plr_frame frame = imu_flight_look(&imu_rig.flight);
    frame.count = dark ? 0 : frame.count;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(f, &frame, &imu_rig.report));
    imu_rig.flight.t_ns += lead_ns;
}

/* Frames before the reading that each of them belongs to, or with it. */
static void fly(unsigned frames, plr_time_ns lead_ns, bool dark) {
    for (unsigned k = 1; k <= frames * IMU_RIG_EVERY; k++) {
        const bool looks = k % IMU_RIG_EVERY == 0;
        imu_flight_move(&imu_rig.flight);
        const plr_imu imu = imu_flight_read(&imu_rig.flight);
        if (looks && lead_ns > 0)
            frame_at(lead_ns, dark);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(f, imu_rig.flight.t_ns, &imu));
        if (looks && lead_ns == 0)
            frame_at(0, dark);
    }
}

static void read_wheel(void) {
    double T[16], v[3];
    plr_reading wheel = {.t_ns = imu_rig.flight.t_ns, .sensor = PLR_SENSOR_WHEEL, .axes = 7};
    imu_flight_truth(&imu_rig.flight, T, v);
    for (int i = 0; i < 3; i++) {
        wheel.value[i] = v[i] + 0.02 * rng_normal(&imu_rig.flight.chance);
        wheel.sigma[i] = 0.02;
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(f, &wheel, NULL));
}

/* The sigma of v after a second in the dark, of readings that scatter as a motor shakes them. */
static double dark_sigma_mps(uint8_t timing, plr_time_ns lead_ns, bool wheel) {
    double P[36];
    imu_rig.options.accel_noise = 0.05; /* 1 m/s^2 a reading */
    imu_rig.config.accel_noise = 0.05;
    imu_rig.config.imu_timing = timing;
    imu_rig_begin(IMU_RIG_GIVEN, 1);
    for (unsigned k = 0; k < 4 * SECOND; k++) {
        fly(1, lead_ns, k >= 3 * SECOND);
        if (wheel && k < 3 * SECOND)
            read_wheel();
    }
    TEST_ASSERT_EQUAL_UINT32(0, f->totals.recoveries);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(f, P));
    return sqrt(P[0] + P[7] + P[14]);
}

static void test_an_imus_velocity_is_as_sure_in_the_dark_wherever_frames_stand(void) {
    for (uint8_t timing = 0; timing < TIMINGS; timing++)
        for (unsigned wheel = 0; wheel < 2; wheel++) {
            double sigma[LEADS];
            for (unsigned i = 0; i < LEADS; i++)
                sigma[i] = dark_sigma_mps(timing, leads_ns[i], wheel);
            demand_alike(wheel ? "IMU and wheel" : "IMU", sigma);
            TEST_ASSERT_TRUE(sigma[0] < 0.3);
        }
}

/* ---------------------------------------------------------------- twists */

enum { SEEDS = PELORUS_SHORT_FORM ? 20 : 200, TWISTS = 100, TWISTS_PER_FRAME = 10 };
static const plr_time_ns START_NS = 1000000000, TWIST_NS = 10000000;
static const double V_MPS = 1.5, W_RADPS = 0.2, V_SIGMA = 0.05, W_SIGMA = 0.01;

static void begin_in_the_dark(uint8_t timing) {
    static const plr_pose level = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    plr_calibration calibration;
    plr_config config;
    plr_config_default(&config);
    exact_camera(&config);
    each_axis(config.velocity_sigma, V_SIGMA);
    each_axis(config.gyro_sigma, W_SIGMA);
    config.bias = 0;
    config.twist_timing = timing;
    scene_calibration(&calibration);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(f, &calibration, &config, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(f, START_NS, &level, NULL));
}

static void take_empty_frame(plr_time_ns t_ns) {
    const plr_frame frame = {t_ns, PLR_NO_BUDGET, 0, NULL};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(f, &frame, &imu_rig.report));
}

static void take_twist(plr_time_ns t_ns, bool wheel, rng *chance) {
    plr_twist twist = {{V_MPS, 0, 0}, {0, 0, W_RADPS}};
    plr_reading turns = {.t_ns = t_ns, .sensor = PLR_SENSOR_WHEEL, .axes = 1};
    for (int i = 0; i < 3; i++) {
        twist.v_B_mps[i] += V_SIGMA * rng_normal(chance);
        twist.w_B_radps[i] += W_SIGMA * rng_normal(chance);
    }
    turns.value[0] = V_MPS + V_SIGMA * rng_normal(chance);
    turns.sigma[0] = V_SIGMA;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(f, t_ns, &twist));
    if (wheel) {
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(f, &turns, NULL));
    }
}

/* The squared error of the way along a circle, in the filter's own variance of its length. */
static double way_error2(void) {
    const double t_s = 1e-9 * (double)(plr_filter_time(f) - START_NS), turned = W_RADPS * t_s;
    const double radius = V_MPS / W_RADPS;
    double P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(f, P));
    const plr_pose pose = pose_of(f);
    const double off[2] = {radius * sin(turned) - pose.p[0],
                           radius * (1 - cos(turned)) - pose.p[1]};
    const double along = cos(turned) * off[0] + sin(turned) * off[1];
    return along * along / P[0];
}

static double way_nees(uint8_t timing, plr_time_ns lead_ns, bool wheel) {
    double sum = 0;
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        rng chance = rng_seeded(seed);
        begin_in_the_dark(timing);
        for (plr_time_ns k = 0; k <= TWISTS; k++) {
            const plr_time_ns t_ns = START_NS + k * TWIST_NS;
            const bool looks = k > 0 && k % TWISTS_PER_FRAME == 0;
            if (looks && lead_ns > 0)
                take_empty_frame(t_ns - lead_ns);
            take_twist(t_ns, wheel, &chance);
            if (looks && lead_ns == 0)
                take_empty_frame(t_ns);
        }
        sum += way_error2() / SEEDS;
    }
    return sum;
}

static void test_the_way_by_twists_is_as_honest_wherever_frames_stand(void) {
    for (uint8_t timing = 0; timing < TIMINGS; timing++)
        for (unsigned wheel = 0; wheel < 2; wheel++) {
            double nees[LEADS];
            for (unsigned i = 0; i < LEADS; i++) {
                nees[i] = way_nees(timing, leads_ns[i], wheel);
                printf("timing %u, wheel %u, %u ns: NEES %.3f\n", timing, wheel,
                       (unsigned)leads_ns[i], nees[i]);
            }
            TEST_ASSERT_TRUE(nees[0] > 0.7 && nees[0] < 1.4);
            demand_alike(wheel ? "twists and wheel" : "twists", nees);
        }
}
