// SPDX-License-Identifier: MIT
/*
 * The model `world` against the course report's own filter (textbook/): full state, all landmarks, four
 * rows an observation, one gain a frame, on OpenBLAS. As long as no landmark has to leave, the two are
 * the same filter. float32 loses digits from frame to frame (docs/NUMERICS.md), and is held to the
 * first frames.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "math/packed.h"
#include "support/matrices.h"
#include "support/rig.h"
#include "support/rigid.h"
#include "textbook/textbook.h"

enum { FRAMES = 40, FRAGILE_FRAMES = 5, MOST = 64, FRAGILE = PLR_REAL == 32 };

static textbook book;

void setUp(void) {
    rig_set_up();
    rig.config.model = PLR_MODEL_WORLD;
    rig.config.slots = MOST;
    rig.config.start_sigma = 0.01;
    rig.options.most_seen = 24;
}

void tearDown(void) {
    textbook_free(&book);
}

static void begin(void) {
    rig_begin();
    textbook_free(&book);
    TEST_ASSERT_TRUE(textbook_init(&book, &rig.calibration, &rig.config, MOST, 64));
}

static void twist(void) {
    const plr_twist reading = scene_read(&rig.world);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, rig.world.t_ns, &reading));
    scene_move(&rig.world, RIG_STEP_NS);
    textbook_hold(&book, &reading, RIG_STEP_NS * 1e-9, RIG_STEP_NS * 1e-9);
}

/* The filter makes new landmarks in the order of their ids. */
static void create(const plr_frame *frame) {
    for (unsigned i = 0; i < frame->count; i++)
        if (textbook_find(&book, frame->observations[i].id) == book.count)
            (void)textbook_create(&book, book.count, frame->t_ns, &frame->observations[i]);
}

static void look(void) {
    const plr_frame frame = scene_look(&rig.world);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
    const textbook_report expected = textbook_update(&book, frame.t_ns, &frame);
    create(&frame);
    TEST_ASSERT_EQUAL_UINT(expected.matched, rig.report.matched);
    TEST_ASSERT_EQUAL_UINT(expected.gated, rig.report.gated);
    TEST_ASSERT_EQUAL_UINT(expected.used, rig.report.used);
    TEST_ASSERT_DOUBLE_WITHIN((1e-6 + 4e4 * REAL_EPSILON) * (1 + expected.nis), expected.nis,
                              (double)rig.report.nis); /* a float in both precisions */
}

/* Row of the textbook's P for row i of the filter's. */
static unsigned row_of(unsigned i) {
    const unsigned head = textbook_row(&book, 0);
    if (i < head)
        return i;
    const unsigned landmark = textbook_find(&book, rig.filter.belief.slots[(i - head) / 3].id);
    TEST_ASSERT_NOT_EQUAL_UINT(book.count, landmark);
    return textbook_row(&book, landmark) + (i - head) % 3;
}

static void compare(unsigned frame) {
    const double own = REAL_EPSILON * (FRAGILE ? 50 : 1);
    const unsigned n = textbook_dim(&book);
    double T[16], worst = 0;
    plr_pose expected;
    char at[32];
    snprintf(at, sizeof at, "frame %u", frame);
    TEST_ASSERT_EQUAL_UINT(book.count, rig.filter.belief.count);
    const plr_pose pose = pose_of(&rig.filter);
    memcpy(T, book.T_WB, sizeof T);
    rigid_to_pose(&expected, T);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-10 + 500 * own, 0,
                                      largest_difference(expected.p, pose.p, 3), at);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-10 + 50 * own, 0,
                                      largest_difference(expected.R, pose.R, 9), at);
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++) {
            const unsigned k = row_of(i), l = row_of(j);
            const double gap =
                fabs((double)rig.filter.belief.P[plr_packed_at(i, j)] -
                     textbook_covariance(&book, k, l)) /
                sqrt(textbook_covariance(&book, k, k) * textbook_covariance(&book, l, l));
            worst = gap > worst ? gap : worst;
        }
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-7 + 8e4 * own, 0, worst, at);
}

static void run(void) {
    begin();
    for (unsigned frame = 0; frame < (FRAGILE ? FRAGILE_FRAMES : FRAMES); frame++) {
        for (unsigned k = 0; k < RIG_TWISTS; k++)
            twist();
        look();
        compare(frame);
    }
}

/* ---------------------------------------------------------------- tests */

static void test_world_is_the_textbooks_filter(void) {
    run();
    TEST_ASSERT_GREATER_THAN_UINT(8, rig.report.used);
    setUp();
    rig.config.bias = 1;
    run();
}

static void test_it_is_so_with_the_courses_hyperparameters(void) {
    plr_config_course(&rig.config);
    rig.config.slots = MOST;
    run();
    TEST_ASSERT_GREATER_THAN_UINT(3, rig.report.used);
    rig.config.landmark_prior = PLR_PRIOR_CORRELATED;
    run();
}

static void test_both_gates_reject_the_same(void) {
    rig.options.outliers = 0.1;
    run();
    TEST_ASSERT_GREATER_THAN_UINT(0, rig.filter.totals.gated);
    setUp();
    rig.options.outliers = 0.1;
    rig.config.gate_residual_px = 12;
    run();
    TEST_ASSERT_GREATER_THAN_UINT(0, rig.filter.totals.gated);
}

/* Replaced in its place, a landmark leaves nothing of the old one behind: the state is that of a
 * textbook which never had it. */
static void test_a_landmark_replaced_in_its_place_is_a_new_one(void) {
    begin();
    for (unsigned k = 0; k < RIG_TWISTS; k++)
        twist();
    look();
    for (unsigned k = 0; k < RIG_TWISTS; k++)
        twist();
    const plr_frame frame = scene_look(&rig.world);
    const plr_observation *seen = &frame.observations[0];
    const unsigned at = textbook_find(&book, seen->id), row = textbook_row(&book, at);
    TEST_ASSERT_NOT_EQUAL_UINT(book.count, at);
    TEST_ASSERT_TRUE(textbook_create(&book, book.count, frame.t_ns, seen)); /* the same, anew */
    TEST_ASSERT_TRUE(textbook_create(&book, at, frame.t_ns, seen));
    const unsigned fresh = textbook_row(&book, book.count - 1);
    for (unsigned i = 0; i < row; i++)
        for (unsigned c = 0; c < 3; c++)
            TEST_ASSERT_DOUBLE_WITHIN(1e-12, textbook_covariance(&book, fresh + c, i),
                                      textbook_covariance(&book, row + c, i));
    for (unsigned c = 0; c < 3; c++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, textbook_covariance(&book, fresh + c, fresh + c),
                                  textbook_covariance(&book, row + c, row + c));
}

static void test_a_known_landmark_tells_the_pose(void) {
    plr_landmark known = {
        .id = 7, .p_W_m = {6, 0.4, 0.2}, .P_W_m2 = {1e-4, 0, 0, 0, 1e-4, 0, 0, 0, 1e-4}};
    begin();
    TEST_ASSERT_TRUE(textbook_insert_known(&book, &known));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_insert_known(&rig.filter, &known));
    for (unsigned k = 0; k < RIG_TWISTS; k++)
        twist();
    look();
    compare(0);
    plr_landmark back;
    textbook_landmark_of(&book, 0, &back);
    TEST_ASSERT_TRUE(back.known);
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(known.p_W_m, back.p_W_m, 3);
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(known.P_W_m2, back.P_W_m2, 9);
}

static void test_it_takes_no_landmark_more_than_it_has_room_for(void) {
    begin();
    const plr_landmark known = {.p_W_m = {6, 0.4, 0.2}, .P_W_m2 = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (unsigned i = 0; i < MOST; i++)
        TEST_ASSERT_TRUE(textbook_insert_known(&book, &known));
    TEST_ASSERT_FALSE(textbook_insert_known(&book, &known));
    const plr_frame frame = scene_look(&rig.world);
    TEST_ASSERT_FALSE(textbook_create(&book, book.count, frame.t_ns, &frame.observations[0]));
    TEST_ASSERT_EQUAL_UINT(MOST, book.count);
}
