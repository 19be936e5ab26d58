// SPDX-License-Identifier: MIT
/* Setting track-drift: how much less a landmark is known for what its track wanders. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "state/covariance.h"
#include "state/slots.h"
#include "support/matrices.h"
#include "support/rig.h"

static const double DRIFT_PX = 0.5, FRAME_S = 0.1;

void setUp(void) {
    rig_set_up();
    rig.config.track_drift_px = DRIFT_PX;
    rig_begin();
}

static void blocks(double P[][9]) {
    for (unsigned slot = 0; slot < rig.filter.count; slot++) {
        plr_real P_ll[9];
        plr_covariance_landmark(&rig.filter, slot, P_ll);
        for (unsigned i = 0; i < 9; i++)
            P[slot][i] = (double)P_ll[i];
    }
}

/* A frame in which nothing is seen: the motion waits, and nothing else changes a landmark. */
static void dark_frame(void) {
    const plr_frame frame = {.t_ns = rig.world.t_ns};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, NULL));
}

/* P_ll of each landmark has grown by `variance` in its two bearings. */
static void demand_growth(double before[][9], double variance) {
    static double after[PLR_MAX_LANDMARKS][9];
    blocks(after);
    TEST_ASSERT_TRUE(rig.filter.count > 5);
    for (unsigned slot = 0; slot < rig.filter.count; slot++)
        for (unsigned i = 0; i < 9; i++)
            TEST_ASSERT_DOUBLE_WITHIN(4 * REAL_EPSILON * (fabs(after[slot][i]) + variance),
                                      i == 0 || i == 4 ? variance : 0,
                                      after[slot][i] - before[slot][i]);
}

static void test_bearings_wander_by_the_time_between_frames(void) {
    static double before[PLR_MAX_LANDMARKS][9];
    const double bearing = DRIFT_PX / rig.calibration.fx_px;
    rig_drive(10);
    for (unsigned frames = 1; frames <= 3; frames++) {
        for (unsigned k = 0; k < frames; k++)
            rig_twists();
        blocks(before);
        dark_frame();
        demand_growth(before, bearing * bearing * FRAME_S * frames);
    }
}

static void test_the_first_frame_has_nothing_to_wander_from(void) {
    rig_frame();
    static double before[PLR_MAX_LANDMARKS][9];
    blocks(before);
    demand_growth(before, 0);
    rig.config.track_drift_px = 0;
    static plr_filter drifting;
    drifting = rig.filter;
    rig_begin();
    rig_frame();
    TEST_ASSERT_EQUAL_UINT(drifting.count, rig.filter.count);
    TEST_ASSERT_EQUAL_MEMORY(drifting.P, rig.filter.P, sizeof drifting.P);
}

static void test_landmarks_of_the_map_do_not_wander(void) {
    static double before[PLR_MAX_LANDMARKS][9];
    rig_drive(10);
    for (unsigned slot = 0; slot < rig.filter.count; slot++)
        rig.filter.slots[slot].known = 1;
    blocks(before);
    plr_covariance_add_drift(&rig.filter, PLR_R(0.5));
    demand_growth(before, 0);
}

static void test_a_drifting_track_leaves_less_certainty(void) {
    double sigma_m[2];
    for (unsigned told = 0; told < 2; told++) {
        rig.config.track_drift_px = 5 * told;
        rig_begin();
        rig_drive(60);
        sigma_m[told] = rig_sigma_m();
    }
    TEST_ASSERT_GREATER_THAN_DOUBLE(1.1 * sigma_m[0], sigma_m[1]);
}
