// SPDX-License-Identifier: MIT
/*
 * Whole frames of the filter against the textbook filter (textbook/textbook.h) in double: state and
 * covariance after accumulated predicts, gate, blocks, retraction, eviction and new landmarks. Also in
 * several block sizes: all must agree with the one gain of the textbook, and its likelihood.
 * Each tolerance is the sum of two parts: one for the textbook's own rounding (it computes in metres and
 * kilometres), one for the filter's, in units of its epsilon. Both are several times what was measured.
 * `world` in float32 loses digits (docs/NUMERICS.md): few frames are compared, and fewer digits.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "support/matrices.h"
#include "support/twin_drive.h"

enum { FRAMES = 40, FRAGILE_FRAMES = 5 };

static unsigned most_seen; /* so many observations of each frame are used */
static plr_report report;

void setUp(void) {
    twin_drive_set_up();
    twins.options.most_seen = 24;
    most_seen = 24;
}

void tearDown(void) {
    twin_drive_end();
}

static bool is_fragile(void) {
    return PLR_REAL == 32 && twins.config.model == PLR_MODEL_WORLD;
}

static unsigned frames(void) {
    return is_fragile() ? FRAGILE_FRAMES : FRAMES;
}

/* Runs a test without and with biases. */
static void for_model(uint8_t model, void (*run)(void)) {
    for (uint8_t bias = 0; bias < 2; bias++) {
        setUp();
        twins.config.model = model;
        twins.config.bias = bias;
        run();
    }
}

static void for_each_model(void (*run)(void)) {
    for_model(PLR_MODEL_BODY, run);
    for_model(PLR_MODEL_WORLD, run);
}

/* The world itself, with errors of centimetres. */
static bool surveyed(void *context, uint32_t id, plr_landmark *landmark) {
    static const double P_W[9] = {0.04, 0.01, 0, 0.01, 0.03, -0.01, 0, -0.01, 0.05};
    (void)context;
    *landmark = (plr_landmark){.id = id};
    memcpy(landmark->P_W_m2, P_W, sizeof P_W);
    memcpy(landmark->p_W_m, scene_landmark(&twins.world, id), sizeof landmark->p_W_m);
    landmark->p_W_m[id % 3] += 0.01 * (id % 5);
    return true;
}

static void begin(void) {
    twin_drive_begin(twins.config.mode == PLR_MODE_LOCALIZATION ? surveyed : NULL);
}

/* Known landmarks enter the oracle before the frame, as the filter asks for them. */
static void adopt(const plr_frame *frame) {
    for (unsigned i = 0; i < frame->count; i++) {
        plr_landmark known;
        const uint32_t id = frame->observations[i].id;
        if (textbook_find(&twins.book, id) == twins.book.count && surveyed(NULL, id, &known))
            TEST_ASSERT_TRUE(textbook_insert_known(&twins.book, &known));
    }
}

/* In this frame, after many that rejected it. */
static bool restarted(const plr_slot *slot) {
    return slot->last_frame == twins.filter.belief.frame_number && slot->restarts > 0 &&
           slot->accepted + slot->rejected == 0;
}

/* What the filter has restarted is replaced in the oracle. */
static void restart(const plr_frame *frame) {
    for (unsigned slot = 0; slot < twins.filter.belief.count; slot++)
        for (unsigned i = 0; i < frame->count && restarted(&twins.filter.belief.slots[slot]); i++)
            if (frame->observations[i].id == twins.filter.belief.slots[slot].id)
                TEST_ASSERT_TRUE(textbook_create(
                    &twins.book, textbook_find(&twins.book, twins.filter.belief.slots[slot].id),
                    frame->t_ns, &frame->observations[i]));
}

/* One frame in both. What the filter evicts leaves the oracle too. */
static void look(void) {
    plr_frame frame = scene_look(&twins.world);
    if (frame.count > most_seen)
        frame.count = (uint16_t)most_seen;
    twins.evictions = 0;
    if (twins.config.mode == PLR_MODE_LOCALIZATION)
        adopt(&frame);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&twins.filter, &frame, &report));
    const bool was_pending =
        twins.book.pending; /* a frame that does nothing is not rounded either */
    const textbook_report expected = textbook_update(&twins.book, frame.t_ns, &frame);
    if (expected.used > 0 || (was_pending && !twins.book.pending))
        twin_make_up_for_rounding(&twins.book, &frame, REAL_EPSILON);
    twin_drive_evict();
    restart(&frame);
    const bool adopts = twins.config.mode == PLR_MODE_LOCALIZATION;
    const unsigned created = adopts ? report.created : twin_drive_create(&frame);
    TEST_ASSERT_EQUAL_UINT(expected.matched, report.matched);
    TEST_ASSERT_EQUAL_UINT(expected.gated, report.gated);
    TEST_ASSERT_EQUAL_UINT(expected.used, report.used);
    TEST_ASSERT_EQUAL_UINT(created, report.created);
    const double share = 1e-6 + 4e4 * REAL_EPSILON, log_det = expected.log_det; /* of floats */
    TEST_ASSERT_DOUBLE_WITHIN(share * (1 + expected.nis), expected.nis, (double)report.nis);
    TEST_ASSERT_DOUBLE_WITHIN(share * (1 + expected.d2), expected.d2, (double)report.innovation_d2);
    TEST_ASSERT_DOUBLE_WITHIN(share * (1 + fabs(log_det)), log_det,
                              (double)report.innovation_log_det);
}

static void compare(unsigned frame) {
    const double own = REAL_EPSILON * (is_fragile() ? 50 : 1);
    char at[48];
    snprintf(at, sizeof at, "model %d, bias %d, frame %u", twins.config.model, twins.config.bias,
             frame);
    twin_demand_same(&twins.book, &twins.filter, 1e-11, own, at);
}

static void run_frame(unsigned frame) {
    twin_drive_to_the_next_frame();
    look();
    compare(frame);
}

static void run_frames(void) {
    begin();
    for (unsigned frame = 0; frame < frames(); frame++)
        run_frame(frame);
}

/* ---------------------------------------------------------------- tests */

static void test_frames_agree_with_the_textbook_filter(void) {
    for_each_model(run_frames);
    TEST_ASSERT_GREATER_THAN_UINT(8, report.used);
}

static void run_outliers(void) {
    twins.options.outliers = 0.1;
    run_frames();
    TEST_ASSERT_GREATER_THAN_UINT(0, twins.filter.totals.gated);
}

static void test_the_gate_rejects_what_the_textbook_rejects(void) {
    for_each_model(run_outliers);
}

static void run_small_ring(void) {
    twins.config.slots = 9;
    run_frames();
    if (!is_fragile())
        TEST_ASSERT_GREATER_THAN_UINT(5, twins.filter.totals.evicted);
}

static void test_eviction_removes_rows_and_columns(void) {
    for_each_model(run_small_ring);
}

/* ---------------------------------------------------------------- the motion's noise */

static void set_sigmas(const double velocity[3], const double gyro[3]) {
    memcpy(twins.config.velocity_sigma, velocity, sizeof twins.config.velocity_sigma);
    memcpy(twins.config.gyro_sigma, gyro, sizeof twins.config.gyro_sigma);
}

/* Twists that are off by dozens of pixels a frame, beside sharp ones. */
static void make_uncertain(void) {
    static const double velocity[3] = {0.5, 0.5, 0.5}, gyro[3] = {0.5, 0.5, 0.5};
    twins.options.velocity_sigma_mps = twins.options.gyro_sigma_radps = 0.5;
    twins.options.pixel_sigma_px = twins.config.pixel_sigma_px = 0.3;
    set_sigmas(velocity, gyro);
}

static void run_uncertain(void) {
    make_uncertain();
    run_frames();
}

static void test_uncertain_twists_beside_sharp_pixels_agree(void) {
    for_model(PLR_MODEL_BODY, run_uncertain);
    TEST_ASSERT_GREATER_THAN_UINT(8, report.used);
}

/* No match, one, two, and so on: directions of the motion that no observation tells enter P. */
static void run_few_matches(void) {
    make_uncertain();
    begin();
    for (unsigned frame = 0; frame < frames(); frame++) {
        most_seen = frame < 2 ? 24 : frame % 3;
        run_frame(frame);
    }
}

static void test_no_match_one_and_two_by_turns_agree(void) {
    for_model(PLR_MODEL_BODY, run_few_matches);
}

/* Along some axes the twists are exact, or along all: the motion's covariance is singular. */
static void run_exact_axes(void) {
    static const double some[3] = {0.1, 0, 0}, turn[3] = {0, 0, 0.02}, none[3] = {0};
    set_sigmas(some, turn);
    run_frames();
    set_sigmas(none, none);
    twins.options.velocity_sigma_mps = twins.options.gyro_sigma_radps = 0;
    run_frames();
}

static void test_exact_axes_agree(void) {
    for_model(PLR_MODEL_BODY, run_exact_axes);
}

static void run_step_noise(void) {
    twins.config.noise = PLR_NOISE_STEP;
    const double way[3] = {2e-3, 1e-3, 3e-3}, turn[3] = {5e-4, 2e-4, 8e-4};
    memcpy(twins.config.velocity_sigma, way, sizeof way);
    memcpy(twins.config.gyro_sigma, turn, sizeof turn);
    if (twins.config.model == PLR_MODEL_WORLD)
        twins.config.landmark_sigma_m = 1.4;
    run_frames();
}

static void test_noise_of_a_step_and_constant_landmarks_agree(void) {
    for_each_model(run_step_noise);
}

/* The course's new landmark: it does not share the pose's error. */
static void test_a_prior_independent_of_the_pose_agrees(void) {
    twins.config.model = PLR_MODEL_WORLD;
    twins.config.landmark_sigma_m = 1.4;
    twins.config.landmark_prior = PLR_PRIOR_INDEPENDENT;
    run_frames();
    TEST_ASSERT_GREATER_THAN_UINT(8, report.used);
}

/* A frame that lies 4 ms behind a twist: the reading is held in two parts, 4
 * and 6 ms, of which the noise is charged once in all. */
static void run_frames_between_twists(void) {
    enum { PART_NS = 4000000 };
    begin();
    for (unsigned frame = 0; frame < frames(); frame++) {
        plr_twist reading;
        for (unsigned k = 0; k < TWIN_TWISTS; k++) {
            reading = scene_read(&twins.world);
            TEST_ASSERT_EQUAL_INT(PLR_OK,
                                  plr_filter_predict(&twins.filter, twins.world.t_ns, &reading));
            const bool last = k + 1 == TWIN_TWISTS;
            scene_move(&twins.world, last ? PART_NS : TWIN_STEP_NS);
            textbook_hold(&twins.book, &reading, last ? PART_NS * 1e-9 : TWIN_STEP_NS * 1e-9,
                          TWIN_STEP_NS * 1e-9);
        }
        look();
        compare(frame);
        scene_move(&twins.world, TWIN_STEP_NS - PART_NS);
        textbook_hold(&twins.book, &reading, (TWIN_STEP_NS - PART_NS) * 1e-9, TWIN_STEP_NS * 1e-9);
    }
}

static void test_frames_between_twists_agree(void) {
    for_each_model(run_frames_between_twists);
}

/* Pose covariance while motion is accumulated: the filter computes it on the
 * side. */
static void run_pose_covariance(void) {
    begin();
    for (unsigned frame = 0; frame < FRAGILE_FRAMES; frame++) {
        for (unsigned k = 0; k < TWIN_TWISTS; k++) {
            double P_xi[36], expected[36];
            twin_drive_step(TWIN_STEP_NS);
            /* the filter has not yet held the last reading: ask after the next one */
            const plr_twist ahead = scene_read(&twins.world);
            plr_filter copy = twins.filter;
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&copy, twins.world.t_ns, &ahead));
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&copy, P_xi));
            textbook_pose_covariance(&twins.book, expected);
            for (unsigned i = 0; i < 36; i++)
                TEST_ASSERT_DOUBLE_WITHIN((1e-9 + 1e4 * REAL_EPSILON) *
                                              sqrt(expected[7 * (i / 6)] * expected[7 * (i % 6)]),
                                          expected[i], P_xi[i]);
        }
        look();
    }
}

static void test_pose_covariance_between_frames_agrees(void) {
    for_each_model(run_pose_covariance);
}

/* World positions and covariances of landmarks, through pose and cross terms. */
static void run_landmarks(void) {
    run_frames();
    for (unsigned slot = 0; slot < twins.filter.belief.count; slot++) {
        plr_landmark landmark;
        plr_landmark due;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&twins.filter, slot, &landmark));
        textbook_landmark_of(&twins.book, textbook_find(&twins.book, landmark.id), &due);
        const double *P = due.P_W_m2, trace = P[0] + P[4] + P[8],
                     rounding = is_fragile() ? 0.05 : 1e-3;
        const double relative = PLR_REAL == 64 ? 1e-8 : rounding;
        TEST_ASSERT_DOUBLE_WITHIN(30 * relative, 0,
                                  largest_difference(due.p_W_m, landmark.p_W_m, 3));
        TEST_ASSERT_DOUBLE_WITHIN(relative * trace, 0, largest_difference(P, landmark.P_W_m2, 9));
    }
}

static void test_landmarks_in_the_world_agree(void) {
    for_each_model(run_landmarks);
}

/* Known landmarks enter through the pose; the state holds both kinds. */
static void run_known(void) {
    begin();
    for (unsigned frame = 0; frame < frames(); frame++) {
        twin_drive_to_the_next_frame();
        look();
        if (frame % 4 == 0) {
            plr_landmark known = {.id = 100 + 7 * frame,
                                  .P_W_m2 = {0.04, 0.01, 0, 0.01, 0.03, -0.01, 0, -0.01, 0.05}};
            for (int i = 0; i < 3; i++)
                known.p_W_m[i] = scene_landmark(&twins.world, known.id)[i];
            const plr_status status = plr_filter_insert_known(&twins.filter, &known);
            if (status == PLR_OK)
                TEST_ASSERT_TRUE(textbook_insert_known(&twins.book, &known));
            else
                TEST_ASSERT_TRUE(status == PLR_E_EXISTS ||
                                 (status == PLR_E_FULL && twins.book.count == twins.config.slots));
        }
        compare(frame);
    }
}

static void test_known_landmarks_enter_as_in_the_textbook(void) {
    for_each_model(run_known);
}

/* The same while a motion is pending: P is then of the pose before it. */
static void run_known_between_frames(void) {
    begin();
    for (unsigned frame = 0; frame < frames(); frame++) {
        for (unsigned k = 0; k < TWIN_TWISTS; k++) {
            twin_drive_step(TWIN_STEP_NS);
            if (frame % 4 != 1 || k != 6)
                continue;
            /* the oracle holds each reading at once, the filter when the next one comes */
            const plr_twist ahead = scene_read(&twins.world);
            TEST_ASSERT_EQUAL_INT(PLR_OK,
                                  plr_filter_predict(&twins.filter, twins.world.t_ns, &ahead));
            plr_landmark known;
            TEST_ASSERT_TRUE(surveyed(NULL, 103 + 7 * frame, &known));
            if (plr_filter_insert_known(&twins.filter, &known) == PLR_OK)
                TEST_ASSERT_TRUE(textbook_insert_known(&twins.book, &known));
            scene_move(&twins.world, TWIN_STEP_NS);
            textbook_hold(&twins.book, &ahead, TWIN_STEP_NS * 1e-9, TWIN_STEP_NS * 1e-9);
        }
        look();
        compare(frame);
    }
}

static void test_known_landmarks_enter_between_frames_as_in_the_textbook(void) {
    for_each_model(run_known_between_frames);
}

static void run_localization(void) {
    twins.config.mode = PLR_MODE_LOCALIZATION;
    twins.config.start_sigma = 0.015; /* beyond it the filter first looks where it is */
    run_frames();
}

static void test_localization_agrees(void) {
    for_each_model(run_localization);
    TEST_ASSERT_GREATER_THAN_UINT(8, report.used);
}

static void run_mapping(void) {
    twins.config.mode = PLR_MODE_MAPPING;
    begin();
    for (unsigned frame = 0; frame < frames(); frame++) {
        plr_pose T_WB;
        for (unsigned k = 0; k < TWIN_TWISTS; k++)
            scene_move(&twins.world, TWIN_STEP_NS);
        scene_pose(&twins.world, &T_WB);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(&twins.filter, twins.world.t_ns, &T_WB));
        textbook_move_to(&twins.book, &T_WB);
        look();
        compare(frame);
    }
    double P_xi[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&twins.filter, P_xi));
    TEST_ASSERT_DOUBLE_WITHIN(0, 0, largest(P_xi, 36));
}

static void test_mapping_agrees_and_keeps_the_given_pose_exact(void) {
    setUp();
    twins.config.bias = 0; /* given poses tell nothing of the twists */
    for (twins.config.model = 0; twins.config.model < 2; twins.config.model++)
        run_mapping();
}

/* A pose from outside in the middle of a run: the map is gone, the biases stay. */
static void run_new_pose(void) {
    double P_xi[36] = {0};
    plr_pose T_WB;
    run_frames();
    for (int i = 0; i < 6; i++)
        P_xi[7 * i] = i < 3 ? 0.01 : 1e-4;
    P_xi[1] = P_xi[6] = 0.004;
    scene_pose(&twins.world, &T_WB);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_set_pose(&twins.filter, twins.world.t_ns, &T_WB, P_xi));
    textbook_set_pose(&twins.book, &T_WB, P_xi);
    for (unsigned frame = 0; frame < FRAGILE_FRAMES; frame++) {
        look();
        compare(frame);
        twin_drive_to_the_next_frame();
    }
}

static void test_a_pose_from_outside_drops_the_map_and_keeps_the_bias(void) {
    for_each_model(run_new_pose);
}
