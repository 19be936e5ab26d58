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

#include "support/matrices.h"
#include "support/oracle.h"
#include "support/reseal.h"
#include "support/scene.h"
#include "support/twin.h"

enum { STEP_NS = 10000000, TWISTS = 10, FRAMES = 60, MOST = 64, MOST_SEEN = 20, LARGEST = 204 };

static plr_filter filter;
static textbook book;
static scene world;
static scene_options options;
static plr_config config;
static uint32_t evicted[PLR_MAX_LANDMARKS];
static unsigned evictions;
static double H[4 * MOST_SEEN * LARGEST], P[LARGEST * LARGEST];

static int record_eviction(void *context, const plr_landmark *landmark) {
    (void)context;
    evicted[evictions++] = landmark->id;
    return 0;
}

void setUp(void) {
    plr_config_default(&config);
    config.slots = PLR_MAX_LANDMARKS < MOST ? PLR_MAX_LANDMARKS : MOST;
    config.start_sigma = 0.01;
    config.bias = 1;
    config.bias_velocity_walk = 1e-6;
    config.bias_gyro_walk = 1e-8;
    scene_options_default(&options);
    options.bias[0] = 0.05;
    options.bias[5] = -0.004;
}

void tearDown(void) {
    textbook_free(&book);
}

static void begin(void) {
    const plr_map map = {.sink = record_eviction};
    textbook_free(&book); /* of a drive before */
    scene_start(&world, &options);
    TEST_ASSERT_TRUE(textbook_init(&book, &world.calibration, &config, MOST, PLR_MAX_OBSERVATIONS));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &world.calibration, &config, &map));
}

/* The twists contradicted or not, by nothing that would change their weight. */
static void contradict(bool so) {
    memset(&filter.consistency, 0, sizeof filter.consistency);
    memset(H, 0, sizeof H);
    filter.consistency.contradicted = so;
    reseal(&filter);
    book.considered = so ? H : NULL;
}

/* One frame in both. What the filter evicts leaves the oracle too. */
static void look(bool contradicted) {
    plr_report report;
    plr_frame frame = scene_look(&world);
    if (frame.count > MOST_SEEN)
        frame.count = MOST_SEEN;
    contradict(contradicted);
    evictions = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&filter, &frame, &report));
    const textbook_report expected = textbook_update(&book, frame.t_ns, &frame);
    if (expected.used > 0)
        twin_make_up_for_rounding(&book, &frame, REAL_EPSILON);
    for (unsigned i = 0; i < evictions; i++)
        textbook_remove(&book, textbook_find(&book, evicted[i]));
    for (unsigned i = 0; i < frame.count && book.count < config.slots; i++)
        if (textbook_find(&book, frame.observations[i].id) == book.count)
            (void)textbook_create(&book, book.count, frame.t_ns, &frame.observations[i]);
    TEST_ASSERT_EQUAL_UINT(expected.used, report.used);
    TEST_ASSERT_EQUAL_UINT(expected.gated, report.gated);
}

static void drive_to_the_next_frame(void) {
    for (unsigned k = 0; k < TWISTS; k++) {
        const plr_twist reading = scene_read(&world);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, world.t_ns, &reading));
        scene_move(&world, STEP_NS);
        textbook_hold(&book, &reading, STEP_NS * 1e-9, STEP_NS * 1e-9);
    }
}

static void compare(unsigned frame) {
    twin_gap gap;
    char at[32];
    snprintf(at, sizeof at, "frame %u", frame);
    TEST_ASSERT_TRUE_MESSAGE(twin_compare(&book, &filter, &gap), at);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-10 + 500 * REAL_EPSILON, 0, gap.position_m, at);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-10 + 50 * REAL_EPSILON, 0, gap.rotation_rad, at);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-10 + 100 * REAL_EPSILON, 0, gap.bias, at);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(5e-9 + 4000 * REAL_EPSILON, 0, gap.landmark, at);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-8 + 8e4 * REAL_EPSILON, 0, gap.covariance, at);
    unpack_symmetric(P, filter.P, textbook_dim(&book));
    TEST_ASSERT_TRUE_MESSAGE(oracle_cholesky(textbook_dim(&book), P), at);
}

/* The share of frames that are contradicted: all, none, or runs of them, for the filter to go on from. */
static void run(unsigned of_every, unsigned contradicted) {
    begin();
    for (unsigned frame = 0; frame < FRAMES; frame++) {
        drive_to_the_next_frame();
        look(frame % of_every < contradicted);
        compare(frame);
    }
}

static void test_a_contradicted_frame_is_schmidts_update(void) {
    run(1, 1);
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, (double)filter.bias[0]);
}

static void test_frames_that_teach_the_biases_in_between_agree_too(void) {
    run(3, 1);
    run(20, 10);
    TEST_ASSERT_GREATER_THAN_DOUBLE(0, fabs((double)filter.bias[0]));
}

/* Twists that are off by dozens of pixels a frame: the gain is nearly all of the motion's. */
static void test_uncertain_twists_agree(void) {
    for (int i = 0; i < 3; i++)
        config.velocity_sigma[i] = config.gyro_sigma[i] = 0.5;
    options.velocity_sigma_mps = options.gyro_sigma_radps = 0.5;
    options.pixel_sigma_px = config.pixel_sigma_px = 0.3;
    run(4, 3);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_a_contradicted_frame_is_schmidts_update);
    RUN_TEST(test_frames_that_teach_the_biases_in_between_agree_too);
    RUN_TEST(test_uncertain_twists_agree);
    return UNITY_END();
}
