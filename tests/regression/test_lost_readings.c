// SPDX-License-Identifier: MIT
/*
 * What twists do not say. A second without twists and frames in a turn: the last reading was held with its
 * own noise alone, and the pose was 0.37 rad off at a sigma of 0.01, GOOD. And readings of timing end, or
 * mid, with a frame between two of them: the frame was reached with the old reading, the rest of the
 * interval went by the new one, and their difference over the first part was lost for good.
 */
#include <math.h>
#include <unity.h>

#include "pelorus/pelorus.h"
#include "support/axes.h"
#include "support/pose_of.h"
#include "support/scene.h"

enum { MS = 1000000, FIRST_MS = 5000 }; /* until then readings come as usual */

static const double SPEED_MPS = 1, RATE_RADPS = 1, PERIOD_S = 5;

static plr_filter filter;
static plr_config config;
static bool together;

void setUp(void) {
    together = false;
    plr_config_default(&config);
    config.bias = 0;
    config.mode = PLR_MODE_DEAD_RECKONING;
    each_axis(config.velocity_sigma, 0.05);
    each_axis(config.gyro_sigma, 0.01);
}

static void begin(void) {
    const plr_calibration camera = scene_bare_camera(500, 320, 240, 0.2);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &camera, &config, NULL));
}

/* The rate swings; `heading` is its integral. */
static double heading(double t_s) {
    const double w = 2 * acos(-1.0) / PERIOD_S;
    return RATE_RADPS / w * (1 - cos(w * t_s));
}

/* The mean reading from one time to another. */
static void read_mean(plr_time_ns at_ms, double from_ms, double to_ms) {
    const double turn = heading(to_ms * 1e-3) - heading(from_ms * 1e-3);
    const plr_twist twist = {{SPEED_MPS, 0, 0}, {0, 0, turn / ((to_ms - from_ms) * 1e-3)}};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, at_ms * MS, &twist));
}

static double heading_found(void) {
    const plr_pose at = pose_of(&filter);
    return atan2(at.R[3], at.R[0]);
}

static double heading_sigma(void) {
    double P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&filter, P));
    return sqrt(P[35]);
}

/* Readings of timing start, one each 20 ms, but for `lost_ms`. */
static void drive_with_a_gap(unsigned lost_ms) {
    begin();
    for (unsigned ms = 0; ms <= FIRST_MS; ms += 20)
        read_mean(ms, ms, ms + 20);
    for (unsigned ms = FIRST_MS + lost_ms; ms <= FIRST_MS + lost_ms + 200; ms += 20)
        read_mean(ms, ms, ms + 20);
}

static void test_what_changes_while_readings_are_lost_is_in_the_covariance(void) {
    for (unsigned lost_ms = 500; lost_ms <= 1900; lost_ms += 200) {
        drive_with_a_gap(lost_ms);
        const double off = heading((FIRST_MS + lost_ms + 200) * 1e-3) - heading_found();
        TEST_ASSERT_GREATER_THAN_DOUBLE(0.1, fabs(off)); /* there is something to be covered */
        TEST_ASSERT_LESS_THAN_DOUBLE(3, fabs(off) / heading_sigma());
        TEST_ASSERT_GREATER_THAN_DOUBLE(0.3, fabs(off) / heading_sigma());
    }
}

static void test_a_reading_or_two_that_are_lost_cost_little(void) {
    drive_with_a_gap(20);
    const double usual = heading_sigma();
    drive_with_a_gap(60);
    TEST_ASSERT_LESS_THAN_DOUBLE(2 * usual, heading_sigma());
}

/* A robot that keeps its velocity: what the readings scatter by is their noise. */
static void test_where_nothing_changes_a_gap_adds_what_a_held_reading_adds(void) {
    begin();
    for (unsigned ms = 0; ms <= FIRST_MS + 1000; ms += ms == FIRST_MS ? 1000 : 20) {
        const double noise = 0.01 * ((ms / 20) % 2 ? 1 : -1);
        const plr_twist twist = {{SPEED_MPS, 0, 0}, {0, 0, noise}};
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, (plr_time_ns)ms * MS, &twist));
    }
    TEST_ASSERT_LESS_THAN_DOUBLE(0.02, heading_sigma());
}

/* Frames that see nothing, 30 a second, between 20 readings a second. */
static void drive_with_frames_between(plr_twist_timing timing) {
    config.mode = PLR_MODE_SLAM;
    config.twist_timing = (uint8_t)timing;
    begin();
    unsigned frames = 0;
    /* for a quarter of the period: the rate grows all along */
    for (unsigned ms = 0; ms <= 1250; ms += 50) {
        for (; frames * 1000 < ms * 30; frames++) {
            const plr_frame dark = {frames * 1000ULL * MS / 30, PLR_NO_BUDGET, 0, NULL};
            if (dark.t_ns > (ms - 50ULL) * MS)
                TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &dark, NULL));
        }
        const double early = timing == PLR_TWIST_END ? 50 : timing == PLR_TWIST_MID ? 25 : 0;
        read_mean(ms, ms - early, ms - early + 50);
        if (ms == 0 && together) {
            const plr_twist again = {{SPEED_MPS, 0, 0}, {0, 0, 0}};
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, MS / 2, &again));
        }
    }
}

/* Two readings half a millisecond apart: the next four intervals look like lost readings, and no more. */
static void test_nor_does_it_long_after_two_readings_that_came_together(void) {
    together = true;
    drive_with_frames_between(PLR_TWIST_END);
    TEST_ASSERT_DOUBLE_WITHIN(9e-3, heading(1.25), heading_found());
}

static void test_a_frame_between_two_readings_loses_no_motion(void) {
    const plr_twist_timing timings[] = {PLR_TWIST_START, PLR_TWIST_END, PLR_TWIST_MID};
    for (unsigned i = 0; i < 3; i++) {
        drive_with_frames_between(timings[i]);
        TEST_ASSERT_DOUBLE_WITHIN(4e-3, heading(1.25), heading_found());
    }
}
