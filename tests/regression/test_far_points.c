// SPDX-License-Identifier: MIT
/*
 * Points at 50 to 400 m, biases estimated: the forward bias ended 10 of its sigmas off, the pose up to 28. Far
 * bearings that noise had corrected were taken for a camera that went sideways, by tenths of a metre in a
 * frame, and the covariance was carried along with it: the next pixels spoke of a parallax that there never
 * was. (The other half, inverse ranges that are mostly noise, is the campaign's: `far` and `far-all`.)
 */
#include <math.h>
#include <unity.h>

#include "state/covariance.h"
#include "support/random.h"
#include "support/rig.h"

enum { POINTS = 20, FRAMES = 40, DRIVES = 10 };

static rng chance;

void setUp(void) {
    chance = rng_seeded(89);
    rig_set_up();
    rig.config.bias = 1;
    rig.config.slots = POINTS;
    rig.config.gate_d2 = 0;
    rig.config.max_row_gap_px = 0;
}

/* A robot that stands, in front of points of half a pixel of disparity. */
static void stand(void) {
    static const plr_twist none = {{0, 0, 0}, {0, 0, 0}};
    plr_observation seen[POINTS];
    plr_time_ns t_ns = 1000000000;
    rig_begin();
    for (int k = 0; k < FRAMES; k++) {
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, t_ns, &none));
        t_ns += 100000000;
        for (unsigned i = 0; i < POINTS; i++) {
            const double u = 150 + 60 * (i % 5), v = 120 + 60 * (i / 5), sigma = 2;
            seen[i] = (plr_observation){i + 1, (float)(u + sigma * rng_normal(&chance)),
                                        (float)(v + sigma * rng_normal(&chance)),
                                        (float)(u - 0.5 + sigma * rng_normal(&chance)),
                                        (float)(v + sigma * rng_normal(&chance))};
        }
        const plr_frame frame = {t_ns, PLR_NO_BUDGET, POINTS, seen};
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
    }
}

/* Without a parallax a range is known as well as its disparities, and no better. */
static void test_a_robot_that_stands_knows_far_ranges_no_better_than_their_disparities(void) {
    const double fx_b = rig.calibration.fx_px * rig.calibration.baseline_m;
    const double bound = 2 * sqrt(2.0 / FRAMES) / fx_b;
    rig.config.pixel_sigma_px = 2;
    for (int drive = 0; drive < DRIVES; drive++) {
        stand();
        for (unsigned slot = 0; slot < rig.filter.belief.count; slot++) {
            const double sigma = sqrt((double)plr_covariance_of_range(&rig.filter.belief, slot));
            const plr_real *q = rig.filter.belief.slots[slot].x;
            const double range = sqrt((double)(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]));
            const double due = bound * (double)q[2] / range; /* disparities say depths */
            TEST_ASSERT_GREATER_THAN_DOUBLE(0.97 * due, sigma);
            TEST_ASSERT_LESS_THAN_DOUBLE(1.05 * due, sigma);
        }
    }
}
