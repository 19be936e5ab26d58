// SPDX-License-Identifier: MIT
/* A session with eyes: pictures come in bands, and their observations go the way of a STEREO. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "pelorus/eyes.h"
#include "support/pictures.h"
#include "support/session_desk.h"

enum { W = 160, H = 120, BAND = 480, PIXELS = W * H, BANDS = PIXELS / BAND, PERIOD_NS = 50000000 };

#define DISPARITY 6.3
#define SPEED     1.0 /* m/s, along the wall */
#define T0        UINT64_C(1000000000)

static uint8_t memory[2][PIXELS], seen[2][PIXELS];
static plr_eyes eyes;
static plr_rig rig;
static texture scene;
static rng chance;

void setUp(void) {
    chance = rng_seeded(9);
    scene = texture_of(2);
    rig = rectified_rig(W, H);
    desk_clear(1);
    TEST_ASSERT_EQUAL(PLR_OK, plr_eyes_init(&eyes, memory[0], memory[1], PIXELS));
    options.eyes = &eyes;
    options.output |= PLR_OUTPUT_ECHO;
}

/* The camera's axes are the body's. */
static plr_message header(void) {
    plr_message m = drive_header();
    plr_calibration *c = &m.as.header.calibration;
    m.as.header.image_width_px = W;
    m.as.header.image_height_px = H;
    c->fx_px = rig.left.fx_px, c->fy_px = rig.left.fy_px;
    c->cx_px = rig.left.cx_px, c->cy_px = rig.left.cy_px;
    c->baseline_m = -rig.T_RL.p[0];
    for (int i = 0; i < 9; i++)
        c->T_CB.R[i] = i % 4 == 0;
    memset(c->T_CB.p, 0, sizeof c->T_CB.p);
    return m;
}

static void begin(void) {
    desk_begin();
    desk_send(header());
}

static plr_time_ns time_of(int k) {
    return T0 + (plr_time_ns)k * PERIOD_NS;
}

static void send_twist(int k, double v_x, double w_y) {
    const plr_message m = {.kind = PLR_KIND_TWIST,
                           .as.twist = {time_of(k), {{v_x, 0, 0}, {0, w_y, 0}}}};
    desk_send(m);
}

/* Pair k of a wall that faces the camera. */
static void draw(int k) {
    const double depth = rig.left.fx_px * -rig.T_RL.p[0] / DISPARITY;
    const double x = rig.left.fx_px * SPEED * 0.05 * k / depth;
    const view left = view_at(x, 0), right = view_at(x + DISPARITY, 0);
    render(seen[0], W, H, W, &scene, &left, &chance);
    render(seen[1], W, H, W, &scene, &right, &chance);
}

static void send_band(int side, int k, unsigned band) {
    const plr_message m = {
        .kind = PLR_KIND_IMAGE,
        .as.image = {time_of(k), (uint8_t)side, W, H, band * BAND, BAND, seen[side] + band * BAND}};
    desk_send(m);
}

static void send_picture(int side, int k) {
    for (unsigned band = 0; band < BANDS; band++)
        send_band(side, k, band);
}

static void send_pair(int k) {
    draw(k);
    send_picture(0, k);
    send_picture(1, k);
}

static void drive(int pairs) {
    for (int k = 0; k < pairs; k++) {
        send_twist(k, SPEED, 0);
        send_pair(k);
        desk_run();
    }
}

/* --- what goes well --- */

static void test_pictures_become_a_pose(void) {
    begin();
    drive(20);
    TEST_ASSERT_EQUAL_UINT32(20, eyes.totals.pairs);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
    TEST_ASSERT_GREATER_THAN(15, session.last.used);
    plr_pose pose;
    TEST_ASSERT_EQUAL(PLR_OK, plr_filter_pose(&session.filter, &pose));
    TEST_ASSERT_DOUBLE_WITHIN(0.03, SPEED * 0.05 * 19, pose.p[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0, pose.p[2]);
}

/* With the motion that the session expected, the tracker alone shows the same, bit by bit. */
static void test_observations_are_those_of_the_tracker_alone(void) {
    static plr_vision alone;
    plr_frame frame;
    rig.tracks =
        PLR_VISION_TRACKS < PLR_MAX_OBSERVATIONS ? PLR_VISION_TRACKS : PLR_MAX_OBSERVATIONS;
    rig.fx_px = rig.left.fx_px, rig.fy_px = rig.left.fy_px;
    rig.cx_px = rig.left.cx_px, rig.cy_px = rig.left.cy_px;
    TEST_ASSERT_EQUAL(PLR_OK, plr_vision_init(&alone, &rig));
    begin();
    for (int k = 0; k < 6; k++) {
        send_twist(k, SPEED, 0);
        send_pair(k);
        desk_run();
        const plr_picture_pair pair = {{seen[0], W, W, H, time_of(k)},
                                       {seen[1], W, W, H, time_of(k)}};
        TEST_ASSERT_EQUAL(PLR_OK, plr_vision_track(&alone, &pair, &eyes.expected, &frame));
        plr_message logged = {0};
        faulty_port_answers_again(&port);
        for (int i = 0; i <= k; i++)
            logged = desk_answer(PLR_KIND_STEREO);
        TEST_ASSERT_GREATER_THAN(20, frame.count);
        TEST_ASSERT_EQUAL_UINT16(frame.count, logged.as.stereo.count);
        TEST_ASSERT_EQUAL_MEMORY(frame.observations, logged.as.stereo.observations,
                                 frame.count * sizeof *frame.observations);
    }
}

/* What was answered, without what the log alone has. */
static unsigned poses_of(plr_pose_message *poses, unsigned most) {
    plr_message answer;
    unsigned n = 0;
    faulty_port_answers_again(&port);
    while (n < most && faulty_port_answer_of(&port, PLR_KIND_POSE, &answer))
        poses[n++] = answer.as.pose;
    return n;
}

static void test_a_log_replays_without_pictures_to_the_same_bits(void) {
    static plr_pose_message first[40], again[40];
    static uint8_t log[FAULTY_PORT_BYTES];
    begin();
    drive(12);
    plr_session_finish(&session);
    const unsigned n = poses_of(first, 40);
    TEST_ASSERT_EQUAL_UINT(12, n);
    const size_t bytes = port.answer_count;
    memcpy(log, port.answers, bytes);
    TEST_ASSERT_LESS_THAN(12 * 2 * PIXELS / 8, bytes);
    desk_clear(1);
    options.eyes = NULL;
    desk_begin();
    faulty_port_send_bytes(&port, log, bytes);
    desk_run();
    TEST_ASSERT_EQUAL_UINT(n, poses_of(again, 40));
    for (unsigned i = 0; i < n; i++) {
        TEST_ASSERT_EQUAL_MEMORY(&first[i].T_WB, &again[i].T_WB, sizeof first[i].T_WB);
        TEST_ASSERT_EQUAL_MEMORY(first[i].P_xi, again[i].P_xi, sizeof first[i].P_xi);
    }
}

static void test_bands_of_the_two_sides_may_alternate(void) {
    begin();
    send_twist(0, SPEED, 0);
    draw(0);
    for (unsigned band = 0; band < BANDS; band++) {
        send_band(1, 0, band);
        send_band(0, 0, band);
    }
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(1, eyes.totals.pairs);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
}

static void test_a_pair_of_the_programs_own_camera_does_the_same(void) {
    static plr_observation by_message[PLR_MAX_OBSERVATIONS];
    plr_picture_pair pair = {{seen[0], W, W, H, time_of(0)}, {seen[1], W, W, H, time_of(0)}};
    begin();
    TEST_ASSERT_EQUAL(PLR_E_NOT_READY, plr_session_look(&session, &pair));
    send_twist(0, SPEED, 0);
    send_pair(0);
    desk_run();
    const unsigned n = eyes.vision.report.born;
    memcpy(by_message, eyes.vision.observations, n * sizeof *by_message);
    desk_clear(1);
    TEST_ASSERT_EQUAL(PLR_OK, plr_eyes_init(&eyes, NULL, NULL, 0));
    options.eyes = &eyes;
    begin();
    send_twist(0, SPEED, 0);
    desk_run();
    TEST_ASSERT_EQUAL(PLR_OK, plr_session_look(&session, &pair));
    TEST_ASSERT_EQUAL_UINT(n, eyes.vision.report.born);
    TEST_ASSERT_EQUAL_MEMORY(by_message, eyes.vision.observations, n * sizeof *by_message);
    TEST_ASSERT_EQUAL(PLR_E_TIME, plr_session_look(&session, &pair));
    TEST_ASSERT_EQUAL_UINT32(1, eyes.totals.refused);
}

/* 0.4 rad/s about y and 1 m/s along x for 50 ms. */
static void test_the_expected_motion_is_that_of_the_steps_since_the_last_pair(void) {
    desk_use_setting("bias", 0); /* the wall does not turn, and would teach one */
    begin();
    for (int k = 0; k < 3; k++) {
        send_twist(k, SPEED, 0.4);
        send_pair(k);
        desk_run();
    }
    const plr_pose *T = &eyes.expected.motion;
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, cos(0.02), T->R[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, -sin(0.02), T->R[2]); /* what was ahead goes to the left */
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, -0.05, T->p[0]);
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, 0, T->p[2]);
    TEST_ASSERT_TRUE(eyes.expected.velocity_known);
    TEST_ASSERT_DOUBLE_WITHIN(1e-2, SPEED, eyes.expected.v_C_mps[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.4, eyes.expected.w_C_radps[1]);
}

/* In mapping a frame has the time of its TRUTH, and so has the motion that eyes expect. */
static void test_in_mapping_eyes_have_no_camera_offset(void) {
    desk_use_setting("camera-offset", 0.02);
    begin();
    drive(1);
    TEST_ASSERT_EQUAL_DOUBLE(0.02, eyes.camera_offset_s);
    setUp();
    desk_use_setting("camera-offset", 0.02);
    desk_use_setting("mode", PLR_MODE_MAPPING);
    begin();
    drive(1);
    TEST_ASSERT_EQUAL_DOUBLE(0, eyes.camera_offset_s);
}

/* --- what goes wrong --- */

static void one_good_pair(int k) {
    send_twist(k, SPEED, 0);
    send_pair(k);
    desk_run();
}

static void test_a_missing_band_costs_one_picture_and_is_said_once(void) {
    begin();
    one_good_pair(0);
    for (int k = 1; k < 3; k++) {
        send_twist(k, SPEED, 0);
        draw(k);
        for (unsigned band = 0; band < BANDS; band++)
            if (band != 7)
                send_band(0, k, band);
        send_picture(1, k);
        desk_run();
    }
    one_good_pair(3);
    TEST_ASSERT_EQUAL_UINT32(2, eyes.totals.broken);
    TEST_ASSERT_EQUAL_UINT32(2, eyes.totals.pairs);
    TEST_ASSERT_EQUAL_INT(PLR_E_CORRUPT, refused_status);
    TEST_ASSERT_EQUAL_UINT(1, desk_texts_with("bands of a picture are missing"));
}

static void test_bands_out_of_order_are_refused(void) {
    begin();
    send_twist(0, SPEED, 0);
    draw(0);
    send_band(0, 0, 0);
    send_band(0, 0, 2);
    send_band(0, 0, 1);
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(1, eyes.totals.broken);
    TEST_ASSERT_EQUAL_UINT32(1, session.totals.refused);
    one_good_pair(1);
    TEST_ASSERT_EQUAL_UINT32(1, eyes.totals.pairs);
}

static void test_a_picture_of_another_size_is_refused_with_the_remedy(void) {
    begin();
    one_good_pair(0);
    plr_message m = {.kind = PLR_KIND_IMAGE,
                     .as.image = {time_of(1), 0, 2 * W, H, 0, BAND, seen[0]}};
    desk_send(m);
    m.as.image.first_px = BAND;
    desk_send(m);
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, refused_status);
    TEST_ASSERT_EQUAL_UINT32(1, eyes.totals.broken);
    TEST_ASSERT_EQUAL_UINT(1, desk_texts_with("calibrate at this size"));
}

static void test_a_half_without_the_other_is_left_out(void) {
    begin();
    one_good_pair(0);
    draw(1);
    send_picture(0, 1);
    one_good_pair(2);
    TEST_ASSERT_EQUAL_UINT32(1, eyes.totals.unpaired);
    TEST_ASSERT_EQUAL_UINT32(2, eyes.totals.pairs);
    TEST_ASSERT_EQUAL_UINT(1, desk_texts_with("without its other half"));
}

static void test_halves_of_different_pairs_are_no_pair(void) {
    begin();
    one_good_pair(0);
    draw(1);
    send_picture(0, 1);
    send_picture(1, 2);
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(1, eyes.totals.unpaired);
    TEST_ASSERT_EQUAL_UINT32(1, eyes.totals.pairs);
}

static void test_exchanged_sides_are_said(void) {
    begin();
    for (int k = 0; k < 6; k++) {
        send_twist(k, SPEED, 0);
        draw(k);
        for (unsigned band = 0; band < BANDS; band++)
            for (int side = 0; side < 2; side++) {
                plr_message m = {.kind = PLR_KIND_IMAGE,
                                 .as.image = {time_of(k), (uint8_t)(1 - side), W, H, band * BAND,
                                              BAND, seen[side] + band * BAND}};
                desk_send(m);
            }
        desk_run();
    }
    TEST_ASSERT_EQUAL_UINT(1, desk_texts_with("are exchanged"));
}

static void test_a_dark_picture_is_said_once(void) {
    begin();
    one_good_pair(0);
    for (int k = 1; k < 3; k++) {
        memset(seen, 0, sizeof seen);
        send_picture(0, k);
        send_picture(1, k);
    }
    desk_run();
    TEST_ASSERT_EQUAL_UINT32(2, eyes.totals.faults);
    TEST_ASSERT_EQUAL_UINT(1, desk_texts_with("the left picture is dark"));
    TEST_ASSERT_EQUAL_UINT(1, desk_texts_with("the right picture is dark"));
}

static void test_a_rig_that_contradicts_the_header_is_refused(void) {
    begin();
    rig.T_RL.p[0] *= 1.1;
    const plr_message m = {.kind = PLR_KIND_RIG, .as.rig = rig};
    desk_send(m);
    one_good_pair(0);
    TEST_ASSERT_EQUAL_INT(PLR_E_CALIBRATION, refused_status);
    TEST_ASSERT_EQUAL_UINT32(1, session.totals.refused);
    TEST_ASSERT_EQUAL_UINT32(0, eyes.totals.pairs);
    TEST_ASSERT_EQUAL_UINT(1, desk_texts_with("the cameras of the pictures make no sense"));
}

static void test_a_rig_of_the_pictures_is_used_and_the_same_again_ignored(void) {
    begin();
    const plr_message m = {.kind = PLR_KIND_RIG, .as.rig = rig};
    desk_send(m);
    one_good_pair(0);
    desk_send(m);
    one_good_pair(1);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
    rig.tracks = 7;
    const plr_message other = {.kind = PLR_KIND_RIG, .as.rig = rig};
    desk_send(other);
    desk_run();
    TEST_ASSERT_EQUAL_INT(PLR_E_MODE, refused_status);
}

static void test_a_session_without_eyes_refuses_pictures_once(void) {
    options.eyes = NULL;
    begin();
    drive(3);
    TEST_ASSERT_EQUAL_UINT32(1, session.totals.refused);
    TEST_ASSERT_EQUAL_INT(PLR_E_MODE, refused_status);
    TEST_ASSERT_EQUAL_INT(PLR_KIND_IMAGE, refused_kind);
    plr_picture_pair pair = {{seen[0], W, W, H, 1}, {seen[1], W, W, H, 1}};
    TEST_ASSERT_EQUAL(PLR_E_MODE, plr_session_look(&session, &pair));
}

static void test_too_little_memory_for_pictures_is_said(void) {
    TEST_ASSERT_EQUAL(PLR_OK, plr_eyes_init(&eyes, memory[0], memory[1], PIXELS - 1));
    begin();
    one_good_pair(0);
    TEST_ASSERT_EQUAL_INT(PLR_E_FULL, refused_status);
    TEST_ASSERT_EQUAL(PLR_E_ARGUMENT, plr_eyes_init(&eyes, NULL, memory[1], PIXELS));
}
