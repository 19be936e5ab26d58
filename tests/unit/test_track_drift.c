// SPDX-License-Identifier: MIT
/* Setting track-drift: how much less a landmark is known for what its track wanders. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "sensor/stereo.h"
#include "state/covariance.h"
#include "state/model.h"
#include "support/matrices.h"
#include "support/rig.h"
#include "support/specimens.h"

static const double DRIFT_PX = 0.5, FRAME_S = 0.1;

void setUp(void) {
    rig_set_up();
    rig.config.track_drift_px = DRIFT_PX;
    rig_begin();
}

static void blocks(double P[][9]) {
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++) {
        plr_real P_ll[9];
        plr_covariance_landmark(&rig.filter.belief, slot, P_ll);
        for (unsigned i = 0; i < 9; i++)
            P[slot][i] = (double)P_ll[i];
    }
}

/* A frame in which nothing is seen: the motion waits, and nothing else changes a landmark. */
static void dark_frame(void) {
    const plr_frame frame = {.t_ns = rig.world.t_ns};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, NULL));
}

/* What a variance of the pixels in u and in v, px^2, does to (mu, 1/r) of a point that stays as deep
 * as it is: by differences, in the axes of the chart. */
static void drift_of(unsigned slot, double variance, double C[9]) {
    const double f_px[2] = {rig.calibration.fx_px, rig.calibration.fy_px};
    double q[3], Jw[9], Ji[9];
    for (unsigned i = 0; i < 3; i++)
        q[i] = (double)rig.filter.belief.slots[slot].x[i];
    specimen_chart(rig.filter.belief.slots[slot].x, Jw, Ji);
    memset(C, 0, 9 * sizeof *C);
    for (unsigned axis = 0; axis < 2; axis++)
        for (unsigned i = 0; i < 3; i++)
            for (unsigned j = 0; j < 3; j++)
                C[3 * i + j] += variance * (q[2] / f_px[axis]) * (q[2] / f_px[axis]) *
                                Jw[3 * i + axis] * Jw[3 * j + axis];
}

/* P_ll of each landmark has grown by what its track wanders, of a variance in px^2. */
static void demand_growth(double before[][9], double variance) {
    static double after[PLR_MAX_LANDMARKS][9];
    blocks(after);
    TEST_ASSERT_TRUE(rig.filter.belief.count > 5);
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++) {
        double C[9];
        drift_of(slot, variance, C);
        for (unsigned i = 0; i < 9; i++)
            TEST_ASSERT_DOUBLE_WITHIN(8 * REAL_EPSILON * (fabs(after[slot][i]) + fabs(C[0])), C[i],
                                      after[slot][i] - before[slot][i]);
    }
}

static void test_points_wander_by_the_time_between_frames(void) {
    static double before[PLR_MAX_LANDMARKS][9];
    rig_drive(10);
    for (unsigned frames = 1; frames <= 3; frames++) {
        for (unsigned k = 0; k < frames; k++)
            rig_twists();
        blocks(before);
        dark_frame();
        demand_growth(before, DRIFT_PX * DRIFT_PX * FRAME_S * frames);
    }
}

/* After a pause the tracks are others, and nobody knows for how long they have been followed. */
static void test_a_pause_is_no_drift(void) {
    static double before[PLR_MAX_LANDMARKS][9];
    rig_drive(10);
    rig.world.t_ns += UINT64_C(3600000000000);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&rig.filter, rig.world.t_ns, NULL));
    blocks(before);
    dark_frame();
    demand_growth(before, 0);
}

/* A point aside stays as deep as it is, so its range changes with its bearing: held against the
 * pixels that a landmark predicts, whose disparity must not become less certain. */
static void test_the_disparity_does_not_wander(void) {
    static plr_measurement m;
    plr_real before[9], after[9];
    unsigned compared = 0;
    rig_drive(10);
    const plr_observation seen = {0};
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++) {
        if (!plr_stereo_measure(&rig.filter.belief, &rig.filter.camera, slot, &seen, &m))
            continue;
        plr_covariance_of_rows(&rig.filter.belief, &m.H, before);
        plr_model_of(&rig.filter.belief)->drift(&rig.filter.belief, &rig.filter.camera, PLR_R(10));
        plr_covariance_of_rows(&rig.filter.belief, &m.H, after);
        const double u = (double)(after[0] - before[0]), v = (double)(after[8] - before[8]);
        const double uLR = (double)(after[1] - before[1]), uR = (double)(after[4] - before[4]);
        TEST_ASSERT_DOUBLE_WITHIN(0.5, 100, u);
        TEST_ASSERT_DOUBLE_WITHIN(0.5, 100, v);
        TEST_ASSERT_DOUBLE_WITHIN(0.5, 0, u - 2 * uLR + uR);
        compared++;
    }
    TEST_ASSERT_TRUE(compared > 5);
}

static void test_landmarks_of_the_map_do_not_wander(void) {
    static double before[PLR_MAX_LANDMARKS][9];
    rig_drive(10);
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++)
        rig.filter.belief.slots[slot].known = 1;
    blocks(before);
    plr_model_of(&rig.filter.belief)->drift(&rig.filter.belief, &rig.filter.camera, PLR_R(0.5));
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
