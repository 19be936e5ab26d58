// SPDX-License-Identifier: MIT
/*
 * A point that moves a little in each frame passed every gate, was pulled along by its landmark and pulled
 * the pose and the biases with it: with 30 % of the points going along with the body at 0.8 of its speed,
 * NEES/6 was 3.4 and the filter GOOD beyond 5 sigma in 40 % of the frames after it. And a landmark born from an
 * outlier was rejected until its track ended.
 */
#include <string.h>
#include <unity.h>

#include "filter/gate.h"
#include "filter/tracks.h"
#include "state/slots.h"
#include "support/rig.h"

enum { OUTLIER_ID = 7777, FRAMES_TO_CATCH = 60, FRAMES_TO_BEGIN_ANEW = 12 };

static plr_observation seen[SCENE_MAX_SEEN + 1];
static double p_W[3]; /* of a point of our own */

void setUp(void) {
    rig_set_up();
    rig.options.most_seen = 20;
}

/* What the camera sees of p_W, without noise, `off_px` aside. */
static plr_observation look_at_point(double off_px) {
    const plr_calibration *c = &rig.calibration;
    double x_B[3], q[3];
    for (int i = 0; i < 3; i++) {
        x_B[i] = 0;
        for (int j = 0; j < 3; j++)
            x_B[i] += rig.world.T_WB[4 * j + i] * (p_W[j] - rig.world.T_WB[4 * j + 3]);
    }
    for (int i = 0; i < 3; i++) {
        q[i] = c->T_CB.p[i];
        for (int j = 0; j < 3; j++)
            q[i] += c->T_CB.R[3 * i + j] * x_B[j];
    }
    const double u = c->cx_px + c->fx_px * q[0] / q[2] + off_px;
    const double v = c->cy_px + c->fy_px * q[1] / q[2];
    const plr_observation o = {
        OUTLIER_ID, (float)u, (float)v, (float)(u - c->fx_px * c->baseline_m / q[2]), (float)v, 0};
    return o;
}

/* Puts the point ahead of the body, in its axes. */
static void put_point(double ahead_m, double left_m) {
    for (int i = 0; i < 3; i++)
        p_W[i] = rig.world.T_WB[4 * i + 3] + ahead_m * rig.world.T_WB[4 * i] +
                 left_m * rig.world.T_WB[4 * i + 1];
}

/* Ten readings, and a frame in which the point stands among the others. */
static void go(double off_px, double point_mps) {
    rig_twists();
    for (int i = 0; i < 3; i++)
        p_W[i] += 0.1 * point_mps * rig.world.T_WB[4 * i];
    plr_frame frame = scene_look(&rig.world);
    memcpy(seen, frame.observations, frame.count * sizeof *seen);
    seen[frame.count++] = look_at_point(off_px);
    frame.observations = seen;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
}

static const plr_slot *point(void) {
    const uint16_t slot = plr_slots_find(&rig.filter.belief, OUTLIER_ID);
    TEST_ASSERT_NOT_EQUAL_UINT16(PLR_NO_SLOT, slot);
    return &rig.filter.belief.slots[slot];
}

/* Each by itself passes the gate: |e|^2 is 3 in the mean, and 5 here. */
static void test_innovations_that_lean_within_the_gate_are_found_out(void) {
    rng chance = rng_seeded(5);
    plr_slot slot = {0};
    int frames = 0;
    for (; frames < 60 && !slot.moving; frames++) {
        plr_real e[3];
        for (int r = 0; r < 3; r++)
            e[r] = (plr_real)(rng_normal(&chance) + (r == 0 ? 1.4 : 0));
        plr_track_add(&slot, 0, e);
    }
    TEST_ASSERT_LESS_THAN_INT(60, frames);
}

static void test_white_innovations_are_not(void) {
    rng chance = rng_seeded(6);
    plr_slot slot = {0};
    for (int k = 0; k < 200000; k++) {
        plr_real e[3];
        for (int r = 0; r < 3; r++)
            e[r] = (plr_real)rng_normal(&chance);
        plr_track_add(&slot, 0, e);
    }
    TEST_ASSERT_EQUAL_UINT8(0, slot.moving);
}

static void test_a_point_that_goes_ahead_of_the_body_is_found_out(void) {
    rig.options.pixel_sigma_px = rig.config.pixel_sigma_px = 3;
    rig.options.speed_mps = 1;
    rig_begin();
    rig_drive(10);
    put_point(8, 1.5);
    for (int k = 0; k < FRAMES_TO_CATCH && !(k && point()->moving); k++)
        go(0, 0.5 * rig.options.speed_mps);
    TEST_ASSERT_EQUAL_UINT8(1, point()->moving);
    const uint32_t gated = point()->times_gated;
    for (int k = 0; k < 10; k++)
        go(0, 0.5 * rig.options.speed_mps);
    TEST_ASSERT_EQUAL_UINT32(gated + 10, point()->times_gated); /* and stays out */
}

static void test_a_point_that_stands_is_not(void) {
    rig_begin();
    rig_drive(10);
    put_point(12, 3);
    for (int k = 0; k < 40; k++)
        go(0, 0);
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(1, point()->times_gated);
}

static void test_a_landmark_born_from_an_outlier_begins_anew(void) {
    rig_begin();
    rig_drive(10);
    put_point(12, 3);
    go(80, 0);
    for (int k = 0; k < FRAMES_TO_BEGIN_ANEW; k++)
        go(0, 0);
    const uint32_t gated = point()->times_gated;
    TEST_ASSERT_GREATER_OR_EQUAL_UINT32(4, gated); /* one frame is not enough to say who is wrong */
    for (int k = 0; k < 10; k++)
        go(0, 0);
    TEST_ASSERT_EQUAL_UINT32(gated, point()->times_gated);
}

static void test_a_track_of_outliers_is_given_ever_fewer_chances(void) {
    rig_begin();
    rig_drive(10);
    put_point(25, 3);
    for (int k = 0; k < 100; k++)
        go(k % 2 ? 120 : -120, 0);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT32(80, point()->times_gated);
    TEST_ASSERT_LESS_OR_EQUAL_UINT8(3, point()->restarts); /* after 8 frames, 16, 32 */
}

/* A point that stands, and whose track then is off by so many pixels: for how many frames it is rejected. */
static unsigned frames_rejected(double off_px) {
    unsigned frames = 0;
    rig_begin();
    rig_drive(10);
    put_point(30, 2);
    for (int k = 0; k < 20; k++)
        go(0, 0);
    do {
        go(off_px, 0);
        frames++;
    } while (frames < 60 && point()->rejected > 0);
    return frames;
}

/* With one track in 100 that went over to another point in a frame, and stayed there, a fifth of all matches
 * was rejected and the filter GOOD in two frames of three. */
static void test_a_good_track_that_goes_over_to_another_point_begins_anew_soon(void) {
    const unsigned frames = frames_rejected(60);
    TEST_ASSERT_GREATER_THAN_UINT(7, frames);
    TEST_ASSERT_LESS_THAN_UINT(12, frames);
}

/* A point that begins to move is off by little at first, and will go on. */
static void test_a_good_track_that_is_little_off_does_not(void) {
    plr_slot moved = {.accepted = 20}, lost = {.accepted = 20};
    plr_track_count(&lost, PLR_GATE_FAR);
    plr_track_count(&moved, PLR_GATE_REJECTED);
    for (int k = 1; k < 8; k++) {
        TEST_ASSERT_FALSE(plr_track_may_restart(&lost, 0));
        plr_track_count(&lost, PLR_GATE_REJECTED);
        plr_track_count(&moved, PLR_GATE_REJECTED);
    }
    TEST_ASSERT_TRUE(plr_track_may_restart(&lost, 0));
    TEST_ASSERT_FALSE(plr_track_may_restart(&moved, 0));
}

static void test_far_off_is_ten_sigmas(void) {
    TEST_ASSERT_EQUAL_INT(PLR_GATE_REJECTED, plr_gate_rejection(0, PLR_R(99)));
    TEST_ASSERT_EQUAL_INT(PLR_GATE_FAR, plr_gate_rejection(0, PLR_R(101)));
}
