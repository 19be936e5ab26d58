// SPDX-License-Identifier: MIT
/* Points so far that noise leaves them no disparity, or a negative one: they are born and corrected as
 * any other, through infinity and back, and their ranges come out without a bias. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/random.h"
#include "support/rig.h"

enum { POINTS = 40, FRAMES = 60 };

static plr_observation seen[POINTS];
static rng chance;

void setUp(void) {
    chance = rng_seeded(83);
    rig_set_up();
    rig.config.pixel_sigma_px = 1;
    rig.config.slots = POINTS;
    rig.config.gate_d2 = 0; /* each counts */
    rig.config.max_row_gap_px = 0;
}

/* A frame of points of that disparity, with noise of 1 px. */
static void look(plr_time_ns t_ns, double disparity_px) {
    for (unsigned i = 0; i < POINTS; i++) {
        const double u = 150 + 40 * (i % 8), v = 120 + 40 * (i / 8);
        seen[i] = (plr_observation){
            i + 1, (float)(u + rng_normal(&chance)), (float)(v + rng_normal(&chance)),
            (float)(u - disparity_px + rng_normal(&chance)), (float)(v + rng_normal(&chance))};
    }
    const plr_frame frame = {t_ns, PLR_NO_BUDGET, POINTS, seen};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
    TEST_ASSERT_EQUAL_UINT16(0, rig.report.poor);
}

/* What the filter holds a point's disparity for: fx b over its depth. */
static double disparity_of(unsigned slot) {
    const plr_slot *s = &rig.filter.belief.slots[slot];
    const double x = (double)s->x[0], y = (double)s->x[1], z = (double)s->x[2];
    const double range = sqrt(x * x + y * y + z * z);
    const double fx_b = (double)(rig.filter.camera.given.fx * rig.filter.camera.given.baseline);
    return fx_b * (1 / range + (double)s->beyond) * range / z;
}

static double mean_disparity(unsigned *negative) {
    double sum = 0;
    *negative = 0;
    for (unsigned slot = 0; slot < POINTS; slot++) {
        sum += disparity_of(slot);
        *negative += rig.filter.belief.slots[slot].beyond < 0;
    }
    return sum / POINTS;
}

static void test_points_are_born_with_the_disparity_that_was_seen(void) {
    rig_begin();
    look(1000000000, 0);
    unsigned negative;
    (void)mean_disparity(&negative);
    TEST_ASSERT_EQUAL_UINT(POINTS, rig.report.created);
    TEST_ASSERT_UINT_WITHIN(12, POINTS / 2, negative);
    for (unsigned slot = 0; slot < POINTS; slot++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, (double)seen[slot].uL_px - (double)seen[slot].uR_px,
                                  disparity_of(slot));
}

/* Seen so often that the noise of each is 1/5 px: the mean of all is right to 1/35. */
static void demand_no_bias(plr_mode mode, bool same_time, double disparity_px) {
    unsigned negative;
    rig.config.mode = (uint8_t)mode;
    rig_begin();
    plr_time_ns t_ns = 1000000000;
    for (int k = 0; k < FRAMES; k++) {
        if (!same_time)
            t_ns += 100000000;
        if (mode == PLR_MODE_MAPPING && (k == 0 || !same_time))
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(&rig.filter, t_ns, &rig_identity));
        look(t_ns, disparity_px);
    }
    const double sigma = sqrt(2.0 / FRAMES / POINTS);
    TEST_ASSERT_DOUBLE_WITHIN(4 * sigma, disparity_px, mean_disparity(&negative));
    if (disparity_px < 0.1)
        TEST_ASSERT_GREATER_THAN_UINT(POINTS / 5, negative);
}

static void test_ranges_have_no_bias_where_poses_are_given(void) {
    demand_no_bias(PLR_MODE_MAPPING, false, 0);
    demand_no_bias(PLR_MODE_MAPPING, false, 0.5);
}

static void test_ranges_have_no_bias_in_frames_of_one_time(void) {
    demand_no_bias(PLR_MODE_MAPPING, true, 0);
    demand_no_bias(PLR_MODE_SLAM, true, 0);
}
