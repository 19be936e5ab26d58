// SPDX-License-Identifier: MIT
/*
 * While twists are contradicted a frame may not teach their biases (docs/MATH.md 17). The filter gives the
 * biases back what a whole update took; the textbook (textbook/consider.h) takes a gain whose rows of the
 * biases are zero, and Joseph's form of P, dense and in double. State and the whole of P must agree, the
 * covariances with the biases above all, from frame to frame, with frames that teach them in between; and P
 * must stay positive.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "supervise/supervise.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/reseal.h"
#include "support/twin_drive.h"

enum { FRAMES = 60, MOST_SEEN = 20, LARGEST = 204 };

static double H[4 * MOST_SEEN * LARGEST], P[LARGEST * LARGEST];

void setUp(void) {
    twin_drive_set_up();
    twins.config.bias = 1;
    twins.config.bias_velocity_walk = 1e-6;
    twins.config.bias_gyro_walk = 1e-8;
    twins.options.bias[0] = 0.05;
    twins.options.bias[5] = -0.004;
}

void tearDown(void) {
    twin_drive_end();
}

/* The biases kept or not, as by a contradiction, by nothing that would change the twists' weight. */
static void contradict(bool so) {
    plr_supervise_pose_set(&twins.filter.supervisor);
    memset(H, 0, sizeof H);
    twins.filter.supervisor.doubted_frames = so;
    reseal(&twins.filter);
    twins.book.considered = so ? H : NULL;
}

/* One frame in both. What the filter evicts leaves the oracle too. */
static void look(bool contradicted) {
    plr_report report;
    plr_frame frame = scene_look(&twins.world);
    if (frame.count > MOST_SEEN)
        frame.count = MOST_SEEN;
    contradict(contradicted);
    twins.evictions = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&twins.filter, &frame, &report));
    const textbook_report expected = textbook_update(&twins.book, frame.t_ns, &frame);
    if (expected.used > 0)
        twin_make_up_for_rounding(&twins.book, &frame, REAL_EPSILON);
    twin_drive_evict();
    (void)twin_drive_create(&frame);
    TEST_ASSERT_EQUAL_UINT(expected.used, report.used);
    TEST_ASSERT_EQUAL_UINT(expected.gated, report.gated);
}

static void compare(unsigned frame) {
    char at[32];
    snprintf(at, sizeof at, "frame %u", frame);
    twin_demand_same(&twins.book, &twins.filter, 1e-10, REAL_EPSILON, at);
    unpack_symmetric(P, twins.filter.belief.P, textbook_dim(&twins.book));
    TEST_ASSERT_TRUE_MESSAGE(oracle_cholesky(textbook_dim(&twins.book), P), at);
}

/* The share of frames that are contradicted: all, none, or runs of them, for the filter to go on from. */
static void run(unsigned of_every, unsigned contradicted) {
    twin_drive_begin(NULL);
    for (unsigned frame = 0; frame < FRAMES; frame++) {
        twin_drive_to_the_next_frame();
        look(frame % of_every < contradicted);
        compare(frame);
    }
}

static void test_a_contradicted_frame_is_schmidts_update(void) {
    run(1, 1);
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, (double)twins.filter.belief.bias[0]);
}

static void test_frames_that_teach_the_biases_in_between_agree_too(void) {
    run(3, 1);
    run(20, 10);
    TEST_ASSERT_GREATER_THAN_DOUBLE(0, fabs((double)twins.filter.belief.bias[0]));
}

/* Twists that are off by dozens of pixels a frame: the gain is nearly all of the motion's. */
static void test_uncertain_twists_agree(void) {
    for (int i = 0; i < 3; i++)
        twins.config.velocity_sigma[i] = twins.config.gyro_sigma[i] = 0.5;
    twins.options.velocity_sigma_mps = twins.options.gyro_sigma_radps = 0.5;
    twins.options.pixel_sigma_px = twins.config.pixel_sigma_px = 0.3;
    run(4, 3);
}
