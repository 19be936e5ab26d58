// SPDX-License-Identifier: MIT
/* Which landmarks a frame makes, evicts, drops and takes from a map. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/matrices.h"
#include "support/rig.h"
#include "support/specimens.h"

enum { MOST = 64 };

static plr_observation seen[MOST];
static plr_landmark handed[MOST];
static unsigned handed_over, asked;
static int answer;         /* of the sink */
static double known_sigma; /* of the source */

static int sink(void *context, const plr_landmark *landmark) {
    (void)context;
    handed[handed_over++ % MOST] = *landmark;
    return answer;
}

/* A map of every landmark with an even id. */
static bool source(void *context, uint32_t id, plr_landmark *landmark) {
    asked++;
    if (id % 2)
        return false;
    *landmark = scene_known(context, id, known_sigma);
    return true;
}

void setUp(void) {
    handed_over = asked = 0;
    answer = 0;
    known_sigma = 0.05;
    rig_set_up();
    rig.map = (plr_map){.context = &rig.world, .sink = sink};
    rig_begin();
}

static plr_frame look(void) {
    plr_frame frame = scene_look(&rig.world);
    memcpy(seen, frame.observations, frame.count * sizeof *seen);
    frame.observations = seen;
    return frame;
}

static plr_status update(const plr_frame *frame) {
    return plr_filter_update(&rig.filter, frame, &rig.report);
}

static bool holds(uint32_t id) {
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++)
        if (rig.filter.belief.slots[slot].id == id)
            return true;
    return false;
}

/* ---------------------------------------------------------------- worth a landmark */

/* Whether an observation of that disparity and row gap makes a landmark: fx b = 120 px m. */
static bool makes(double disparity_px, double row_gap_px) {
    seen[0] =
        (plr_observation){7, 400, 300, (float)(400 - disparity_px), (float)(300 + row_gap_px)};
    const plr_frame frame = {1000000000, PLR_NO_BUDGET, 1, seen};
    rig_begin();
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(1, rig.report.created + rig.report.poor);
    TEST_ASSERT_TRUE(specimen_gives_finite_numbers(&rig.filter));
    return rig.report.created == 1;
}

/* Noise may leave a far point no disparity, or a negative one. To take only those whose noise has the
 * right sign would bring all that is far nearer; so each makes a landmark, but for those that no noise
 * of 1 px a picture explains: beyond 3 sigma of a difference of two. */
static void test_noise_alone_does_not_keep_a_far_point_out(void) {
    rig.config.pixel_sigma_px = 1;
    TEST_ASSERT_TRUE(makes(10, 0));
    TEST_ASSERT_TRUE(makes(0, 0));
    TEST_ASSERT_TRUE(makes(-1, 0));
    TEST_ASSERT_TRUE(makes(-4.2, 0));
    TEST_ASSERT_FALSE(makes(-4.3, 0));
    TEST_ASSERT_FALSE(makes(-300, 0));
    rig.config.pixel_sigma_px = 0.1; /* the limit is one of noise */
    TEST_ASSERT_TRUE(makes(-0.42, 0));
    TEST_ASSERT_FALSE(makes(-0.43, 0));
}

static void
test_with_a_limit_of_depth_or_in_the_world_there_is_no_landmark_without_disparity(void) {
    rig.config.max_depth_m = 1e6;
    TEST_ASSERT_TRUE(makes(10, 0));
    TEST_ASSERT_FALSE(makes(0, 0));
    TEST_ASSERT_FALSE(makes(-1, 0));
    rig.config.max_depth_m = 0;
    rig.config.min_disparity_px = 0.5;
    TEST_ASSERT_FALSE(makes(0, 0));
    TEST_ASSERT_FALSE(makes(-1, 0));
    rig.config.min_disparity_px = 0;
    rig.config.model = PLR_MODEL_WORLD;
    TEST_ASSERT_TRUE(makes(10, 0));
    TEST_ASSERT_FALSE(makes(0, 0));
    TEST_ASSERT_FALSE(makes(-1, 0));
}

static void test_each_limit_of_a_new_landmark_holds(void) {
    rig.config.min_disparity_px = 3;
    TEST_ASSERT_TRUE(makes(3, 0));
    TEST_ASSERT_FALSE(makes(2.9, 0));
    rig.config.min_disparity_px = 0;
    rig.config.max_depth_m = 20;
    TEST_ASSERT_TRUE(makes(6.01, 0));
    TEST_ASSERT_FALSE(makes(5.99, 0));
    rig.config.max_depth_m = 0;
    TEST_ASSERT_TRUE(makes(0.5, 0)); /* 240 m */
    rig.config.min_depth_m = 0.5;
    TEST_ASSERT_TRUE(makes(239, 0));
    TEST_ASSERT_FALSE(makes(241, 0));
    rig.config.max_range_m = 100;
    TEST_ASSERT_TRUE(makes(1.21, 0));
    TEST_ASSERT_TRUE(makes(1.19, 0)); /* it stands nearer, and the rest is kept beside it */
    rig.config.max_depth_m = 1000;
    TEST_ASSERT_FALSE(makes(1.19, 0));
    TEST_ASSERT_TRUE(makes(1.21, 0));
    rig.config.max_depth_m = 0;
    rig.config.max_row_gap_px = 1.5;
    TEST_ASSERT_TRUE(makes(10, 1.5));
    TEST_ASSERT_FALSE(makes(10, -1.6));
    rig.config.max_row_gap_px = 0; /* no limit */
    TEST_ASSERT_TRUE(makes(10, 50));
}

static void test_a_new_landmark_lies_where_its_pixels_say(void) {
    plr_landmark landmark;
    TEST_ASSERT_TRUE(makes(12, 0)); /* 10 m */
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&rig.filter, 0, &landmark));
    const plr_calibration *c = &rig.calibration;
    const double q[3] = {(400 - c->cx_px) / c->fx_px * 10, (300 - c->cy_px) / c->fy_px * 10, 10};
    for (int i = 0; i < 3; i++) {
        double expected = 0;
        for (int j = 0; j < 3; j++)
            expected += c->T_CB.R[3 * j + i] * (q[j] - c->T_CB.p[j]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, expected, landmark.p_W_m[i]);
    }
    TEST_ASSERT_EQUAL_UINT32(7, landmark.id);
    TEST_ASSERT_EQUAL_UINT32(1, landmark.times_seen);
    TEST_ASSERT_FALSE(landmark.known);
    /* depth: sigma = z^2 / (fx b) sqrt(2) s, forward in the body */
    const double sigma = 100 / 120.0 * sqrt(2) * rig.config.pixel_sigma_px;
    TEST_ASSERT_DOUBLE_WITHIN(0.1 * sigma, sigma, sqrt(landmark.P_W_m2[0]));
}

/* ---------------------------------------------------------------- room */

/* A frame of points 10 px of disparity apart in a row of the image, their ids descending from `first`. */
static void see_row(unsigned from, unsigned count, uint32_t first, float u_px, float v_px) {
    for (unsigned i = from; i < from + count; i++) {
        const float u = u_px + (float)(i - from);
        seen[i] = (plr_observation){first - (i - from), u, v_px, u - 10, v_px};
    }
}

static plr_frame frame_of(unsigned count) {
    rig.config.slots = 6;
    rig_begin();
    return (plr_frame){1000000000, PLR_NO_BUDGET, (uint16_t)count, seen};
}

static void test_new_ids_beyond_the_slots_are_taken_from_the_lowest(void) {
    const plr_frame frame = frame_of(10);
    see_row(0, 10, 1000, 400, 300);
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(6, rig.report.created);
    TEST_ASSERT_EQUAL_UINT(4, rig.report.no_room);
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_NO_ROOM);
    for (uint32_t id = 991; id <= 996; id++)
        TEST_ASSERT_TRUE(holds(id));
    TEST_ASSERT_EQUAL_UINT(0, handed_over); /* what this frame has seen is never evicted */
}

/* Twelve points, six in a corner, one alone in another: six slots are shared by D'Hondt's method, 4 : 2 : 0,
 * and so are those that become free. */
static void test_parts_of_the_image_have_their_share_of_the_slots(void) {
    plr_frame frame = frame_of(19);
    see_row(0, 12, 120, 400, 300);
    see_row(12, 6, 905, 40, 20);
    see_row(18, 1, 50, (float)(2 * rig.world.calibration.cx_px - 10), 20);
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(6, rig.report.created);
    for (uint32_t id = 109; id <= 112; id++)
        TEST_ASSERT_TRUE(holds(id));
    TEST_ASSERT_TRUE(holds(900) && holds(901));
    frame.t_ns += 100000000; /* 109 and 110 are gone, and six more are in the corner */
    frame.count = 22;
    see_row(0, 10, 120, 400, 300);
    see_row(10, 12, 911, 40, 20);
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(2, rig.report.created);
    TEST_ASSERT_TRUE(holds(113) && holds(902));
}

static void test_a_full_ring_hands_the_oldest_to_the_sink(void) {
    rig.config.slots = 10;
    rig_begin();
    for (unsigned k = 0; k < 60 && handed_over == 0; k++) {
        (void)plr_filter_trace(&rig.filter);
        rig_remember();
        rig_drive(1);
    }
    TEST_ASSERT_GREATER_THAN_UINT(0, handed_over);
    TEST_ASSERT_EQUAL_UINT(handed_over, rig.report.evicted);
    TEST_ASSERT_EQUAL_UINT(10, rig.filter.belief.count);
    /* none that stayed was unseen for longer than the one that left */
    const plr_time_ns left = handed[0].last_seen_ns;
    TEST_ASSERT_FALSE(holds(handed[0].id));
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++)
        TEST_ASSERT_TRUE(rig.filter.belief.slots[slot].last_seen_ns >= left);
    /* and it left with its place in the world, which `body` keeps by the camera */
    const double *truth = scene_landmark(&rig.world, handed[0].id);
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(5 * sqrt(handed[0].P_W_m2[4 * i]) + 0.01, truth[i],
                                  handed[0].p_W_m[i]);
}

static void test_a_sink_that_fails_keeps_the_landmark_and_is_reported(void) {
    unsigned failures = 0;
    rig.config.slots = 10;
    rig_begin();
    answer = 1;
    for (unsigned k = 0; k < 40; k++) {
        handed_over = 0;
        rig_drive(1);
        TEST_ASSERT_EQUAL_UINT(0, rig.report.evicted);
        TEST_ASSERT_EQUAL(handed_over > 0, (rig.report.reasons & PLR_REASON_SINK_FAILED) != 0);
        failures += handed_over;
        for (unsigned i = 0; i < handed_over && i < MOST; i++)
            TEST_ASSERT_TRUE(holds(handed[i].id));
    }
    TEST_ASSERT_GREATER_THAN_UINT(0, failures);
}

static void test_an_id_that_returns_is_a_new_landmark(void) {
    rig.config.slots = 1;
    rig_begin();
    seen[0] = (plr_observation){1, 400, 300, 390, 300};
    plr_frame frame = {1000000000, PLR_NO_BUDGET, 1, seen};
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    seen[0].id = 2;
    frame.t_ns += 1000000;
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(1, rig.report.evicted);
    seen[0].id = 1;
    frame.t_ns += 1000000;
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(0, rig.report.matched);
    TEST_ASSERT_EQUAL_UINT(1, rig.report.created);
    TEST_ASSERT_EQUAL_UINT32(1, rig.filter.belief.slots[0].times_seen);
}

/* ---------------------------------------------------------------- the locked gate */

/* Frames in which eight of ten landmarks stand far from where they were. */
static void lock_gate(unsigned frames, uint16_t budget) {
    for (unsigned k = 0; k < frames; k++) {
        rig.world.t_ns += 10000000;
        plr_frame frame = look();
        frame.count = 10;
        frame.budget = budget;
        for (unsigned i = 2; i < 10; i++)
            seen[i].uL_px -= 60;
        TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    }
}

static void begin_with_ten_landmarks(void) {
    rig.options.pixel_sigma_px = 0;
    rig.config.max_row_gap_px = 0;
    rig.config.min_disparity_px = 0;
    rig_begin();
    plr_frame frame = look();
    frame.count = 10;
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(10, rig.report.created);
}

static void test_a_locked_gate_drops_what_it_rejects_and_keeps_the_pose(void) {
    begin_with_ten_landmarks();
    lock_gate(9, PLR_NO_BUDGET);
    TEST_ASSERT_EQUAL_UINT(8, rig.report.gated);
    TEST_ASSERT_EQUAL_UINT(10, rig.filter.belief.count);
    TEST_ASSERT_FALSE(rig.report.reasons & PLR_REASON_GATE_LOCKED);
    lock_gate(1, PLR_NO_BUDGET);
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_GATE_LOCKED);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_LOST, rig.report.health);
    TEST_ASSERT_EQUAL_UINT32(1, rig.filter.totals.locks);
    TEST_ASSERT_EQUAL_UINT(0, handed_over); /* they were wrong: the map does not want them */
    TEST_ASSERT_TRUE(holds(seen[0].id) && holds(seen[1].id));
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++) {
        const bool kept = rig.filter.belief.slots[slot].id == seen[0].id ||
                          rig.filter.belief.slots[slot].id == seen[1].id;
        TEST_ASSERT_EQUAL_UINT32(kept ? 11 : 1, rig.filter.belief.slots[slot].times_seen);
    }
    TEST_ASSERT_EQUAL_UINT(rig.report.created + 2,
                           rig.filter.belief.count); /* anew, where they can be */
    double P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    TEST_ASSERT_GREATER_THAN_DOUBLE(0, P[0]);
}

static void test_a_locked_gate_keeps_what_the_budget_left_out(void) {
    begin_with_ten_landmarks();
    lock_gate(10, 1);
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_GATE_LOCKED);
    TEST_ASSERT_EQUAL_UINT(1, rig.report.left_out);
    TEST_ASSERT_TRUE(holds(seen[0].id) && holds(seen[1].id));
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++)
        if (rig.filter.belief.slots[slot].id == seen[0].id ||
            rig.filter.belief.slots[slot].id == seen[1].id)
            TEST_ASSERT_EQUAL_UINT32(11, rig.filter.belief.slots[slot].times_seen);
}

static void test_an_open_gate_is_reported_as_inert_after_a_thousand_matches(void) {
    rig.config.gate_d2 = 1e6;
    rig.options.landmarks = 400;
    rig_begin();
    bool inert = false;
    while (rig.filter.totals.matched < 1000) {
        TEST_ASSERT_FALSE(inert);
        rig_drive(1);
        inert = rig.report.reasons & PLR_REASON_GATE_INERT;
    }
    TEST_ASSERT_TRUE(inert);
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, rig.report.health); /* nothing is worse for it */
}

/* ---------------------------------------------------------------- known landmarks */

static void begin_with_map(plr_mode mode, bool known_map) {
    rig.config.mode = (uint8_t)mode;
    rig.config.known_map = known_map;
    rig.map.source = source;
    rig_begin();
}

static unsigned even_ids(const plr_frame *frame) {
    unsigned count = 0;
    for (unsigned i = 0; i < frame->count; i++)
        count += frame->observations[i].id % 2 == 0;
    return count;
}

static void test_localization_takes_its_landmarks_from_the_map_alone(void) {
    begin_with_map(PLR_MODE_LOCALIZATION, false);
    plr_frame frame = look();
    const unsigned even = even_ids(&frame);
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(even, rig.report.created);
    TEST_ASSERT_EQUAL_UINT(even, rig.report.matched); /* and used at once */
    TEST_ASSERT_EQUAL_UINT(frame.count - even, rig.report.poor);
    TEST_ASSERT_EQUAL_UINT(0, rig.report.no_room);
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++) {
        plr_landmark landmark;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_landmark(&rig.filter, slot, &landmark));
        TEST_ASSERT_TRUE(landmark.known);
        TEST_ASSERT_EQUAL_UINT32(1, landmark.times_seen);
        TEST_ASSERT_EQUAL_UINT32(0, landmark.id % 2);
    }
    asked = 0;
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(frame.count - even, asked); /* those in the state are not asked for */
}

static void test_a_map_holds_the_pose_where_it_is(void) {
    begin_with_map(PLR_MODE_LOCALIZATION, false);
    rig_drive(100);
    double P[36];
    const plr_pose pose = pose_of(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(0.2, rig.world.T_WB[4 * i + 3], pose.p[i]);
    TEST_ASSERT_TRUE(P[0] + P[7] + P[14] < 0.05 * 0.05); /* bounded by the map's own */
}

static void test_slam_asks_the_map_only_if_told_to(void) {
    begin_with_map(PLR_MODE_SLAM, false);
    rig_drive(3);
    TEST_ASSERT_EQUAL_UINT(0, asked);
    begin_with_map(PLR_MODE_SLAM, true);
    plr_frame frame = look();
    for (unsigned i = 0; i < frame.count; i++)
        seen[i].vR_px = seen[i].vL_px; /* so that none is poor */
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(frame.count, rig.report.created); /* both kinds, side by side */
    TEST_ASSERT_EQUAL_UINT(even_ids(&frame), rig.report.matched);
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++)
        TEST_ASSERT_EQUAL_UINT8(rig.filter.belief.slots[slot].id % 2 == 0,
                                rig.filter.belief.slots[slot].known);
}

/* Each observation stands in one count: a new id either found a slot, or had no room, or is unknown. */
static void test_counts_add_up_where_the_map_is_larger_than_the_ring(void) {
    rig.config.slots = 4;
    begin_with_map(PLR_MODE_LOCALIZATION, false);
    plr_frame frame = look();
    const unsigned even = even_ids(&frame);
    TEST_ASSERT_GREATER_THAN_UINT(4, even);
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(4, rig.report.matched);
    TEST_ASSERT_EQUAL_UINT(even - 4, rig.report.no_room);
    TEST_ASSERT_EQUAL_UINT(frame.count - even, rig.report.poor);

    begin_with_map(PLR_MODE_SLAM, true);
    for (unsigned i = 0; i < frame.count; i++)
        seen[i].vR_px = seen[i].vL_px;
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(4, rig.report.matched);
    TEST_ASSERT_EQUAL_UINT(frame.count - 4, rig.report.no_room);
    TEST_ASSERT_EQUAL_UINT(0, rig.report.poor);
}

/* True is easily mistaken for "no error". */
static bool source_of_nothing(void *context, uint32_t id, plr_landmark *landmark) {
    (void)context;
    (void)id;
    (void)landmark;
    return true;
}

static void test_a_source_that_says_yes_and_gives_nothing_gives_no_landmark(void) {
    rig.config.mode = PLR_MODE_LOCALIZATION;
    rig.map.source = source_of_nothing;
    rig_begin();
    const plr_frame frame = look();
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(0, rig.filter.belief.count);
}

static void test_a_map_entry_that_is_none_is_not_taken(void) {
    known_sigma = (double)NAN;
    begin_with_map(PLR_MODE_LOCALIZATION, false);
    plr_frame frame = look();
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(0, rig.filter.belief.count);
    TEST_ASSERT_EQUAL_UINT(frame.count, rig.report.poor);

    begin_with_map(PLR_MODE_SLAM, true); /* where the pixels do instead */
    for (unsigned i = 0; i < frame.count; i++)
        seen[i].vR_px = seen[i].vL_px;
    TEST_ASSERT_EQUAL_INT(PLR_OK, update(&frame));
    TEST_ASSERT_EQUAL_UINT(frame.count, rig.report.created);
    TEST_ASSERT_EQUAL_UINT(0, rig.report.poor);
}
