// SPDX-License-Identifier: MIT
/* Eyes as their caller knows them: pairs go in, observations come out; and what is wrong is said. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/pictures.h"

enum { W = 160, H = 120, STRIDE = 192, FRAME_NS = 50000000 };

#define DISPARITY 6.3

static plr_vision eyes;
static uint8_t left[STRIDE * H], right[STRIDE * H];
static texture scene;
static plr_frame frame;
static plr_time_ns now;
static rng chance;

static void begin(void) {
    plr_rig rig = rectified_rig(W, H);
    rig.tracks = 32;
    TEST_ASSERT_EQUAL(PLR_OK, plr_vision_init(&eyes, &rig));
}

void setUp(void) {
    chance = rng_seeded(483);
    scene = texture_of(2);
    now = 1000000000;
    begin();
}

static plr_picture_pair pair_of(const uint8_t *l, const uint8_t *r) {
    now += FRAME_NS;
    const plr_picture_pair pair = {{l, STRIDE, W, H, now}, {r, STRIDE, W, H, now}};
    return pair;
}

/* A wall that faces the camera, shown by `how` in the left picture. */
static void draw(const view *how) {
    view there = *how;
    there.at[0] += DISPARITY * how->A[0], there.at[1] += DISPARITY * how->A[2];
    render(left, W, H, STRIDE, &scene, how, &chance);
    render(right, W, H, STRIDE, &scene, &there, &chance);
}

static plr_status look(const plr_expected *expected) {
    const plr_picture_pair pair = pair_of(left, right);
    return plr_vision_track(&eyes, &pair, expected, &frame);
}

static void show(const view *how) {
    draw(how);
    TEST_ASSERT_EQUAL(PLR_OK, look(NULL));
}

static void show_at(double x, double y) {
    const view how = view_at(x, y);
    show(&how);
}

/* RMS of what is seen beside where the ids of `before` have gone, by (x, y) px and a disparity. */
static unsigned compare(const plr_observation *before, unsigned n, double x, double y,
                        double *rms) {
    unsigned both = 0;
    double sum2 = 0;
    for (unsigned i = 0; i < frame.count; i++) {
        const plr_observation *o = &frame.observations[i];
        for (unsigned j = 0; j < n; j++)
            if (before[j].id == o->id) {
                const double u = (double)o->uL_px - (double)before[j].uL_px - x;
                const double v = (double)o->vL_px - (double)before[j].vL_px - y;
                sum2 += u * u + v * v;
                both++;
            }
    }
    *rms = sqrt(sum2 / (both ? both : 1));
    return both;
}

/* --- what is seen --- */

static void test_corners_are_born_with_their_disparity(void) {
    show_at(0, 0);
    TEST_ASSERT_GREATER_OR_EQUAL(25, frame.count);
    TEST_ASSERT_EQUAL(eyes.report.born, frame.count);
    for (unsigned i = 0; i < frame.count; i++) {
        const plr_observation *o = &frame.observations[i];
        TEST_ASSERT_DOUBLE_WITHIN(0.2, DISPARITY, (double)(o->uL_px - o->uR_px));
        TEST_ASSERT_DOUBLE_WITHIN(0.2, (double)o->vL_px, (double)o->vR_px);
        TEST_ASSERT_EQUAL(o->id, eyes.sights[i].id);
        TEST_ASSERT_EQUAL(0, eyes.sights[i].age);
        TEST_ASSERT_TRUE(eyes.sights[i].sigma_px > 0 && eyes.sights[i].sigma_px < 1);
        TEST_ASSERT_TRUE(i == 0 || o->id > o[-1].id);
    }
}

/* A floor: the disparity grows with the row, by a quarter of a px in each. */
static void test_on_a_floor_the_disparity_is_that_of_the_point(void) {
    const double steep = 0.25;
    const view how = view_at(0, 0);
    view there = how; /* (u, v) of the left picture is at (u - steep v, v) of the right one */
    there.A[1] = steep;
    render(left, W, H, STRIDE, &scene, &how, &chance);
    render(right, W, H, STRIDE, &scene, &there, &chance);
    TEST_ASSERT_EQUAL(PLR_OK, look(NULL));
    TEST_ASSERT_GREATER_OR_EQUAL(15, frame.count);
    unsigned good = 0;
    for (unsigned i = 0; i < frame.count; i++) {
        const plr_observation *o = &frame.observations[i];
        good += fabs((double)(o->uL_px - o->uR_px) - steep * (double)o->vL_px) < 0.07;
    }
    TEST_ASSERT_GREATER_OR_EQUAL(3 * frame.count / 4, good);
}

/* The patch of the birth is followed: after ten pairs a point has not drifted. */
static void test_tracks_do_not_drift(void) {
    static plr_observation born[PLR_VISION_TRACKS];
    show_at(0, 0);
    const unsigned n = frame.count;
    memcpy(born, frame.observations, n * sizeof born[0]);
    double rms = 0;
    for (int k = 1; k <= 10; k++) {
        show_at(1.37 * k, -0.53 * k);
        const unsigned both = compare(born, n, -1.37 * k, 0.53 * k, &rms);
        TEST_ASSERT_LESS_THAN_DOUBLE(0.08, rms);
        TEST_ASSERT_GREATER_OR_EQUAL(n / 2, both);
    }
}

/* How many of the first pair's points are found again where they went: x px to the left. */
static unsigned found_beside(double x, const plr_expected *expected) {
    static plr_observation born[PLR_VISION_TRACKS];
    begin();
    show_at(0, 0);
    const unsigned n = frame.count;
    memcpy(born, frame.observations, n * sizeof born[0]);
    const view how = view_at(x, 0);
    draw(&how);
    TEST_ASSERT_EQUAL(PLR_OK, look(expected));
    double rms;
    const unsigned both = compare(born, n, -x, 0, &rms);
    return rms < 0.5 ? both : 0;
}

static void test_an_expected_motion_is_followed_where_nothing_else_would_find_it(void) {
    plr_expected turn, way;
    memset(&turn, 0, sizeof turn);
    const double by = 0.2; /* some 32 px in a picture of 160 */
    turn.motion.R[0] = turn.motion.R[8] = cos(by);
    turn.motion.R[2] = -sin(by), turn.motion.R[6] = sin(by);
    turn.motion.R[4] = 1;
    memset(&way, 0, sizeof way);
    way.motion.R[0] = way.motion.R[4] = way.motion.R[8] = 1;
    way.motion.p[0] = -W * tan(by) * 0.1 / DISPARITY;
    TEST_ASSERT_GREATER_OR_EQUAL(8, found_beside(W * tan(by), &turn));
    TEST_ASSERT_GREATER_OR_EQUAL(8, found_beside(W * tan(by), &way));
    TEST_ASSERT_LESS_THAN(4, found_beside(W * tan(by), NULL));
}

/* The wall from x px further on, by a camera that goes to the right at v m/s and reads row after row; it went
 * there from the last pair at another velocity. Returns by how many px a row is later than the one above. */
static double look_rolling(double x, double moved_px, double v_mps) {
    const double depth = 0.1 * W / DISPARITY, row_px = v_mps * (double)eyes.row_time * W / depth;
    plr_expected e;
    memset(&e, 0, sizeof e);
    e.motion.R[0] = e.motion.R[4] = e.motion.R[8] = 1;
    e.motion.p[0] = -moved_px * depth / W;
    e.velocity_known = true, e.v_C_mps[0] = v_mps;
    view how = view_at(x - row_px * (H - 1) / 2, 0);
    how.A[1] = row_px;
    draw(&how);
    TEST_ASSERT_EQUAL(PLR_OK, look(&e));
    return row_px;
}

static void test_rows_of_a_rolling_shutter_are_moved_by_the_velocity_at_the_pair(void) {
    static plr_observation born[PLR_VISION_TRACKS];
    plr_rig rig = rectified_rig(W, H);
    rig.tracks = 32, rig.row_time_s = 2e-4;
    TEST_ASSERT_EQUAL(PLR_OK, plr_vision_init(&eyes, &rig));
    const double row_px = look_rolling(0, 0, 2); /* 3 px from the first row to the last */
    const unsigned n = frame.count;
    TEST_ASSERT_GREATER_OR_EQUAL(20, n);
    for (unsigned i = 0; i < n; i++) {
        const plr_observation *o = &frame.observations[i];
        unsigned j = 0;
        while (eyes.tracks[j].id != o->id)
            j++;
        const double by = row_px * ((double)o->vL_px - (H - 1) / 2.0);
        TEST_ASSERT_DOUBLE_WITHIN(0.01, by, (double)(o->uL_px - (float)eyes.tracks[j].at[0]));
        born[i] = *o;
    }
    double rms;
    (void)look_rolling(3, 3,
                       -2); /* it has turned back: the mean since the last pair tells nothing */
    TEST_ASSERT_GREATER_OR_EQUAL(15, compare(born, n, -3, 0, &rms));
    TEST_ASSERT_LESS_THAN_DOUBLE(0.15, rms);
}

static void test_exposure_steps_lose_no_track(void) {
    view how = view_at(0, 0);
    how.gain = 24, how.offset = 90;
    show(&how);
    const unsigned n = frame.count;
    for (int k = 1; k <= 6; k++) {
        how.at[0] = k;
        how.gain = k % 2 ? 36 : 24, how.offset = k % 2 ? 135 : 90;
        show(&how);
        TEST_ASSERT_GREATER_OR_EQUAL(n - 4, eyes.report.observed + eyes.report.born);
        TEST_ASSERT_LESS_OR_EQUAL(3, eyes.report.ended);
    }
}

static void test_a_stride_beyond_the_width_changes_no_bit(void) {
    static uint8_t tight[2][W * H];
    static plr_observation wide[PLR_VISION_TRACKS];
    memset(left, 255, sizeof left), memset(right, 0, sizeof right);
    show_at(3, 4);
    const unsigned n = frame.count;
    memcpy(wide, frame.observations, n * sizeof wide[0]);
    for (int v = 0; v < H; v++) {
        memcpy(&tight[0][v * W], left + v * STRIDE, W);
        memcpy(&tight[1][v * W], right + v * STRIDE, W);
    }
    begin();
    const plr_picture_pair pair = {{tight[0], W, W, H, now}, {tight[1], W, W, H, now}};
    TEST_ASSERT_EQUAL(PLR_OK, plr_vision_track(&eyes, &pair, NULL, &frame));
    TEST_ASSERT_EQUAL(n, frame.count);
    TEST_ASSERT_EQUAL_MEMORY(wide, frame.observations, n * sizeof wide[0]);
}

/* Two cameras that are turned against each other and bend: observations are those of the virtual one. */
static void test_a_pair_that_is_not_rectified_works_as_it_is(void) {
    plr_rig rig = rectified_rig(W, H);
    const double a = 0.03;
    rig.T_RL.R[0] = rig.T_RL.R[4] = cos(a), rig.T_RL.R[1] = -sin(a), rig.T_RL.R[3] = sin(a);
    TEST_ASSERT_EQUAL(PLR_OK, plr_vision_init(&eyes, &rig));
    view how = view_at(0, 0), there = how;
    /* right pixel c + d shows x_L = R^T (x_R - p): the wall turned about the middle, shifted */
    const double cx = (W - 1) / 2.0, cy = (H - 1) / 2.0, c = cos(a), s = sin(a);
    there.A[0] = c, there.A[1] = s, there.A[2] = -s, there.A[3] = c;
    there.at[0] = cx - c * cx - s * cy + c * DISPARITY;
    there.at[1] = cy + s * cx - c * cy - s * DISPARITY;
    render(left, W, H, STRIDE, &scene, &how, &chance);
    render(right, W, H, STRIDE, &scene, &there, &chance);
    TEST_ASSERT_EQUAL(PLR_OK, look(NULL));
    TEST_ASSERT_GREATER_OR_EQUAL(20, frame.count);
    for (unsigned i = 0; i < frame.count; i++) {
        const plr_observation *o = &frame.observations[i];
        TEST_ASSERT_DOUBLE_WITHIN(0.25, DISPARITY, (double)(o->uL_px - o->uR_px));
        TEST_ASSERT_DOUBLE_WITHIN(0.25, (double)o->vL_px, (double)o->vR_px);
    }
}

/* --- what cannot be seen --- */

static void test_black_white_and_flat_pictures_are_said_and_hold_the_tracks(void) {
    static const struct {
        int grey;
        uint8_t fault;
    } bad[3] = {{1, PLR_PICTURE_DARK}, {255, PLR_PICTURE_BRIGHT}, {120, PLR_PICTURE_FLAT}};
    for (int i = 0; i < 3; i++) {
        show_at(i, 0);
        const unsigned alive = eyes.track_count;
        memset(left, bad[i].grey, sizeof left), memset(right, bad[i].grey, sizeof right);
        TEST_ASSERT_EQUAL(PLR_OK, look(NULL));
        TEST_ASSERT_EQUAL(bad[i].fault, eyes.report.left);
        TEST_ASSERT_EQUAL(bad[i].fault, eyes.report.right);
        TEST_ASSERT_EQUAL(0, frame.count);
        show_at(i + 0.5, 0);
        TEST_ASSERT_GREATER_OR_EQUAL(alive - 4, eyes.report.observed);
        TEST_ASSERT_EQUAL(0, eyes.report.left | eyes.report.right);
    }
}

static void test_a_covered_lens_gives_no_observation_and_ends_the_tracks_in_time(void) {
    show_at(0, 0);
    unsigned ended = 0;
    const unsigned alive = eyes.track_count;
    for (int k = 0; k <= PLR_VISION_MISSES; k++) {
        show_at(0.3 * k, 0.1);
        memset(right, 20, sizeof right);
        TEST_ASSERT_EQUAL(PLR_OK, look(NULL));
        TEST_ASSERT_EQUAL(PLR_PICTURE_FLAT, eyes.report.right);
        TEST_ASSERT_EQUAL(0, frame.count);
        TEST_ASSERT_EQUAL(0, eyes.report.born);
    }
    begin();
    show_at(0, 0);
    for (int k = 0; k <= PLR_VISION_MISSES; k++) {
        const view how = view_at(0.3 * k, 0.1);
        draw(&how);
        memset(right, 20 + k, sizeof right);
        TEST_ASSERT_EQUAL(PLR_OK, look(NULL));
        for (unsigned i = 0; i < eyes.report.ended; i++)
            ended += eyes.ended[i].why == PLR_TRACK_NO_RIGHT;
    }
    TEST_ASSERT_GREATER_OR_EQUAL(alive - 4, ended);
    TEST_ASSERT_EQUAL(0, eyes.track_count);
}

/* The right picture's last third stands a px lower, as where a match has gone wrong: half a px is allowed. */
static void test_tracks_whose_rows_stray_end_and_births_are_none(void) {
    static uint8_t lower[STRIDE * H];
    show_at(0, 0);
    unsigned astray = 0, ended = 0;
    for (unsigned i = 0; i < eyes.track_count; i++)
        astray += (double)eyes.tracks[i].right[0] > 2.0 * W / 3 + 6;
    TEST_ASSERT_GREATER_OR_EQUAL(4, astray);
    for (int k = 0; k <= PLR_VISION_MISSES; k++) {
        const view how = view_at(0.1 * (k + 1), 0);
        draw(&how);
        memcpy(lower, right, sizeof lower);
        for (unsigned v = 1; v < H; v++)
            memcpy(right + v * STRIDE + 2 * W / 3, lower + (v - 1) * STRIDE + 2 * W / 3, W / 3);
        TEST_ASSERT_EQUAL(PLR_OK, look(NULL));
        TEST_ASSERT_EQUAL(frame.count, eyes.report.observed + eyes.report.born);
        for (unsigned i = 0; i < frame.count; i++)
            TEST_ASSERT_FLOAT_WITHIN(0.6F, frame.observations[i].vL_px,
                                     frame.observations[i].vR_px);
        for (unsigned i = 0; i < eyes.report.ended; i++) {
            ended += eyes.ended[i].why == PLR_TRACK_NO_RIGHT;
            TEST_ASSERT_EQUAL(k + 1, eyes.ended[i].age);
        }
    }
    TEST_ASSERT_GREATER_OR_EQUAL(astray, ended);
    for (unsigned i = 0; i < eyes.track_count; i++)
        TEST_ASSERT_TRUE((double)eyes.tracks[i].right[0] < 2.0 * W / 3 + 6);
}

static void test_a_repeated_pair_repeats_its_observations(void) {
    static plr_observation before[PLR_VISION_TRACKS];
    show_at(0, 0);
    const unsigned n = frame.count;
    memcpy(before, frame.observations, n * sizeof before[0]);
    TEST_ASSERT_EQUAL(PLR_OK, look(NULL));
    TEST_ASSERT_EQUAL(PLR_PICTURE_REPEATED, eyes.report.left);
    TEST_ASSERT_EQUAL(PLR_PICTURE_REPEATED, eyes.report.right);
    TEST_ASSERT_EQUAL(n, frame.count);
    TEST_ASSERT_EQUAL_MEMORY(before, frame.observations, n * sizeof before[0]);
}

static void test_a_pair_of_which_one_half_repeats_shows_nothing(void) {
    static uint8_t kept[STRIDE * H];
    show_at(0, 0);
    memcpy(kept, right, sizeof kept);
    const view how = view_at(1, 0);
    draw(&how);
    const plr_picture_pair pair = pair_of(left, kept);
    TEST_ASSERT_EQUAL(PLR_OK, plr_vision_track(&eyes, &pair, NULL, &frame));
    TEST_ASSERT_EQUAL(PLR_PICTURE_REPEATED, eyes.report.right);
    TEST_ASSERT_EQUAL(0, eyes.report.left);
    TEST_ASSERT_EQUAL(0, frame.count);
    show_at(2, 0);
    TEST_ASSERT_GREATER_OR_EQUAL(20, eyes.report.observed);
}

static void test_exchanged_sides_are_said(void) {
    for (int k = 0; k < 6; k++) {
        const view how = view_at(20.0 * k, 0);
        draw(&how);
        const plr_picture_pair pair = pair_of(right, left);
        TEST_ASSERT_EQUAL(PLR_OK, plr_vision_track(&eyes, &pair, NULL, &frame));
        TEST_ASSERT_LESS_OR_EQUAL(16, frame.count); /* of 32: chance finds some */
    }
    TEST_ASSERT_TRUE(eyes.report.swapped);
    begin();
    show_at(0, 0);
    TEST_ASSERT_FALSE(eyes.report.swapped);
}

/* The camera nods, and the right half is taken 4 ms late: rows tell it. */
static void test_halves_that_are_milliseconds_apart_are_told(void) {
    const double late_s = 0.004, step_s = 0.05;
    for (int k = 0; k < 40; k++) {
        const double amplitude = 12, rate = 5;
        const double t = k * step_s, at = amplitude * sin(rate * t);
        const double gap = amplitude * sin(rate * (t + late_s));
        const double pitch = atan(at / W) - atan(amplitude * sin(rate * (t - step_s)) / W);
        const view how = view_at(0, at), there = view_at(DISPARITY, gap);
        render(left, W, H, STRIDE, &scene, &how, &chance);
        render(right, W, H, STRIDE, &scene, &there, &chance);
        plr_expected e;
        memset(&e, 0, sizeof e);
        e.motion.R[0] = 1, e.motion.R[4] = e.motion.R[8] = cos(pitch);
        e.motion.R[5] = -sin(pitch), e.motion.R[7] = sin(pitch);
        TEST_ASSERT_EQUAL(PLR_OK, look(&e));
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.0015, late_s, (double)eyes.report.halves_apart_s);
    TEST_ASSERT_TRUE(eyes.report.halves_sigma_s > 0 && eyes.report.halves_sigma_s < 0.001F);
}

/* --- what is refused --- */

static void test_impossible_rigs_are_refused(void) {
    plr_rig rig = rectified_rig(W, H);
    TEST_ASSERT_EQUAL(PLR_E_ARGUMENT, plr_vision_init(NULL, &rig));
    TEST_ASSERT_EQUAL(PLR_E_ARGUMENT, plr_vision_init(&eyes, NULL));
    rig.left.width_px = 47;
    TEST_ASSERT_EQUAL(PLR_E_ARGUMENT, plr_vision_init(&eyes, &rig));
    rig = rectified_rig(W, H), rig.right.height_px = H - 1;
    TEST_ASSERT_EQUAL(PLR_E_ARGUMENT, plr_vision_init(&eyes, &rig));
    rig = rectified_rig(4096, 4096);
    TEST_ASSERT_EQUAL(PLR_E_RANGE, plr_vision_init(&eyes, &rig));
    rig = rectified_rig(W, H), rig.left.k[0] = (double)NAN;
    TEST_ASSERT_EQUAL(PLR_E_NOT_FINITE, plr_vision_init(&eyes, &rig));
    rig = rectified_rig(W, H), rig.T_RL.p[0] = 0.1;
    TEST_ASSERT_EQUAL(PLR_E_CALIBRATION, plr_vision_init(&eyes, &rig));
    rig = rectified_rig(W, H), rig.T_RL.R[0] = 2;
    TEST_ASSERT_EQUAL(PLR_E_CALIBRATION, plr_vision_init(&eyes, &rig));
    rig = rectified_rig(W, H), rig.left.fx_px = 0;
    TEST_ASSERT_EQUAL(PLR_E_CALIBRATION, plr_vision_init(&eyes, &rig));
    TEST_ASSERT_EQUAL(PLR_E_NOT_READY, look(NULL));
    TEST_ASSERT_EQUAL(PLR_E_NOT_READY, plr_vision_forget(&eyes));
    const plr_vision_sizes other = {sizeof eyes - 4, PLR_REAL, PLR_VISION_PIXELS, PLR_VISION_TRACKS,
                                    PLR_VISION_LEVELS};
    rig = rectified_rig(W, H);
    TEST_ASSERT_EQUAL(PLR_E_SIZE, plr_vision_init_sized(&eyes, &rig, &other));
}

static void demand_refused(plr_status status, const plr_picture_pair *pair, const plr_expected *e) {
    static plr_vision before;
    memcpy(&before, &eyes, sizeof before);
    TEST_ASSERT_EQUAL(status, plr_vision_track(&eyes, pair, e, &frame));
    TEST_ASSERT_EQUAL_MEMORY(&before, &eyes, sizeof before);
}

static void test_what_cannot_be_used_is_refused_and_changes_nothing(void) {
    show_at(0, 0);
    const plr_picture_pair good = pair_of(left, right);
    plr_picture_pair pair = good;
    demand_refused(PLR_E_ARGUMENT, NULL, NULL);
    pair.right.pixels = NULL;
    demand_refused(PLR_E_ARGUMENT, &pair, NULL);
    pair = good, pair.left.stride = W - 1;
    demand_refused(PLR_E_ARGUMENT, &pair, NULL);
    pair = good, pair.left.width_px = W / 2; /* a calibration of another resolution */
    demand_refused(PLR_E_ARGUMENT, &pair, NULL);
    pair = good, pair.left.t_ns = pair.right.t_ns = eyes.t_ns;
    demand_refused(PLR_E_TIME, &pair, NULL);
    pair = good, pair.right.t_ns += 300000000;
    demand_refused(PLR_E_TIME, &pair, NULL);
    plr_expected e;
    memset(&e, 0, sizeof e);
    demand_refused(PLR_E_RANGE, &good, &e);
    e.motion.R[0] = e.motion.R[4] = e.motion.R[8] = 1, e.motion.p[2] = (double)INFINITY;
    demand_refused(PLR_E_NOT_FINITE, &good, &e);
    e.motion.p[2] = 1000;
    demand_refused(PLR_E_RANGE, &good, &e);
    e.motion.p[2] = 0, e.velocity_known = true, e.v_C_mps[1] = 1001;
    demand_refused(PLR_E_RANGE, &good, &e);
    e.v_C_mps[1] = 0, e.w_C_radps[2] = (double)NAN;
    demand_refused(PLR_E_NOT_FINITE, &good, &e);
    e.velocity_known = false, e.depth_count = 3;
    demand_refused(PLR_E_ARGUMENT, &good, &e);
}

static void test_the_virtual_camera_stands_on_the_body_where_the_left_one_does(void) {
    plr_pose T_LB;
    plr_calibration c;
    memset(&T_LB, 0, sizeof T_LB);
    T_LB.R[2] = T_LB.R[3] = T_LB.R[7] = 1, T_LB.p[1] = 0.5;
    TEST_ASSERT_EQUAL(PLR_OK, plr_vision_calibration(&eyes, &T_LB, &c));
    TEST_ASSERT_EQUAL_DOUBLE(W, c.fx_px);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.1, c.baseline_m);
    TEST_ASSERT_EQUAL_MEMORY(T_LB.R, c.T_CB.R, sizeof c.T_CB.R);
    TEST_ASSERT_EQUAL_DOUBLE(0.5, c.T_CB.p[1]);
}
