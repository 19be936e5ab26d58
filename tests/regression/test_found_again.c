// SPDX-License-Identifier: MIT
/*
 * A robot that is not where it believes to be in a known map: the known landmarks were rejected, dropped,
 * and taken up again at the same wrong pose, for ever.
 */
#include <math.h>
#include <unity.h>

#include "support/pose_of.h"
#include "support/random.h"
#include "support/rig.h"
#include "support/rigid.h"

#define MAP_SIGMA_M 0.03

enum { WRONG_IN_TEN = 2 };

enum { SEEDS = PELORUS_SHORT_FORM ? 4 : 20 };

static unsigned found; /* frames that said RELOCATED */

static bool true_map(void *context, uint32_t id, plr_landmark *landmark) {
    *landmark = scene_known(context, id, MAP_SIGMA_M);
    return true;
}

/* Two in ten landmarks have been carried elsewhere, each by itself. */
static bool map_of_yesterday(void *context, uint32_t id, plr_landmark *landmark) {
    *landmark = scene_known(context, id, MAP_SIGMA_M);
    if (id % 10 < WRONG_IN_TEN)
        for (unsigned i = 0; i < 3; i++)
            landmark->p_W_m[i] += (double)((id * (2 * i + 3)) % 7) - 3.5;
    return true;
}

/* The ids belong to another drive's tracks. */
static bool map_of_other_ids(void *context, uint32_t id, plr_landmark *landmark) {
    const scene *world = context;
    *landmark = scene_known(world, 100 + (id * 7919U) % world->is.landmarks, MAP_SIGMA_M);
    landmark->id = id;
    return true;
}

void setUp(void) {
    rig_set_up();
    rig.map = (plr_map){.context = &rig.world, .source = true_map};
    found = 0;
}

/* With part of the map rejected in each frame health may say so. */
static void demand_good(void) {
    if (rig.map.source == true_map)
        TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, rig.report.health);
}

static void begin(plr_mode mode) {
    rig.config.known_map = mode == PLR_MODE_SLAM;
    rig_begin_with(mode, true);
    rig_drive(30);
    demand_good();
}

static void drive(unsigned frames, double told) {
    for (unsigned k = 0; k < frames; k++) {
        rig_drive_told(1, told);
        found += (rig.report.reasons & PLR_REASON_RELOCATED) != 0;
        TEST_ASSERT_EQUAL_INT(PLR_OK, rig.report.status);
    }
}

/* The pose that is set is off by xi, m and rad, and believed to sigma. */
static void set_pose_off_by(const double xi[6], double sigma) {
    double M[16], D[16], P[36] = {0};
    plr_pose wrong;
    rigid_exp(D, xi);
    square_multiply(4, rig.world.T_WB, D, M);
    rigid_to_pose(&wrong, M);
    for (int i = 0; i < 36; i += 7)
        P[i] = sigma * sigma;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&rig.filter, rig.world.t_ns, &wrong, P));
}

static void put_down(const double xi[6]) {
    set_pose_off_by(xi, 0.01);
}

/* Beyond the pose's covariance less than once in 100,000, and near. */
static void demand_found(void) {
    double e[6];
    TEST_ASSERT_GREATER_THAN_UINT(0, found);
    TEST_ASSERT_LESS_THAN_DOUBLE(32, rig_squared_error(e));
    TEST_ASSERT_LESS_THAN_DOUBLE(0.15, rig_sigma_m());
    for (unsigned i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(0.15, 0, e[i]);
}

static void put_down_and_drive(const double xi[6]) {
    begin(PLR_MODE_LOCALIZATION);
    put_down(xi);
    const uint32_t widened = rig.filter.totals.widened;
    drive(12, 1);
    demand_found();
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_POSE_MAY_BE_WRONG); /* for some frames yet */
    TEST_ASSERT_TRUE(rig.filter.totals.widened > widened);
    drive(100, 1);
    demand_found();
    demand_good();
    TEST_ASSERT_EQUAL_UINT(1, found);
}

static void test_a_robot_that_was_carried_finds_its_place(void) {
    const double moved[6] = {3, -2, 0.2, 0.05, -0.04, 0.5};
    put_down_and_drive(moved);
}

static void test_also_if_it_was_turned_round(void) {
    const double turned[6] = {1, 2, 0, 0, 0, 3};
    put_down_and_drive(turned);
}

static void test_also_if_part_of_the_map_is_of_yesterday(void) {
    const double moved[6] = {-2, 1, 0.1, 0.02, 0.03, -0.4};
    rig.map.source = map_of_yesterday;
    put_down_and_drive(moved);
}

static void check_double_speed(plr_mode mode) {
    begin(mode);
    drive(40, 2.5);
    drive(100, 1); /* until nothing is covered any more */
    demand_found();
    demand_good();
}

static void test_wheels_that_spun_in_localization(void) {
    check_double_speed(PLR_MODE_LOCALIZATION);
}

/* New landmarks agree with the wrong pose, so a part of the frame is used: the known ones decide. */
static void test_in_slam_the_known_landmarks_decide(void) {
    const double moved[6] = {1.5, -1, 0.1, 0.02, 0.03, 0.3};
    begin(PLR_MODE_SLAM);
    put_down(moved);
    drive(12, 1);
    demand_found();
}

static void test_ids_of_another_drive_move_nothing(void) {
    rig.map.source = map_of_other_ids;
    rig_begin_with(PLR_MODE_LOCALIZATION, true);
    drive(100, 1);
    TEST_ASSERT_EQUAL_UINT(0, found);
    TEST_ASSERT_TRUE(rig.report.health != PLR_HEALTH_GOOD);
    const plr_pose pose = pose_of(&rig.filter);
    for (int i = 0; i < 3; i++) /* dead reckoning */
        TEST_ASSERT_DOUBLE_WITHIN(2, rig.world.T_WB[4 * i + 3], pose.p[i]);
}

static void test_a_true_drive_is_never_found_anew(void) {
    begin(PLR_MODE_LOCALIZATION);
    drive(200, 1);
    TEST_ASSERT_EQUAL_UINT(0, found);
    TEST_ASSERT_EQUAL_UINT32(0, rig.filter.totals.widened);
}

/* The pose is known to `sigma` m and a part of that in rad, and that is true. Landmarks that came in there
 * were linearised beside their place: in the first frame the pose was off by 5 to 21 sigma. */
static void check_rough_start(double sigma) {
    double sum = 0, e[6];
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        rng chance = rng_seeded(seed);
        double xi[6];
        rng_normals(&chance, sigma, xi, 6);
        for (unsigned k = 3; k < 6; k++)
            xi[k] *= 0.5;
        rig.options.seed = seed;
        rig_begin_with(PLR_MODE_LOCALIZATION, true);
        set_pose_off_by(xi, sigma);
        rig_frame();
        TEST_ASSERT_EQUAL_UINT(0, rig.report.reasons &
                                      (PLR_REASON_MAP_DISAGREES | PLR_REASON_RELOCATED));
        sum += rig_squared_error(e);
        rig_drive(5);
        TEST_ASSERT_LESS_THAN_DOUBLE(32, rig_squared_error(e));
    }
    TEST_ASSERT_LESS_THAN_DOUBLE(6 + 4 * sqrt(12.0 / SEEDS), sum / SEEDS);
    TEST_ASSERT_EQUAL_UINT32(0, rig.filter.totals.widened);
}

static void test_a_start_that_is_as_uncertain_as_it_says(void) {
    check_rough_start(0.1);
    check_rough_start(0.2);
    check_rough_start(0.5); /* more than float32 can join with what the frame says */
}

/* Too few to tell the pose by themselves: they and what is known of it do. */
static void test_also_where_three_or_one_are_in_sight(void) {
    rig.options.most_seen = 3;
    check_rough_start(0.1);
    check_rough_start(0.3);
    rig.options.most_seen = 1;
    check_rough_start(0.2);
}

/* Within five sigmas along each axis. */
static void demand_covered(void) {
    double e[6], P[36];
    (void)rig_squared_error(e);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    for (unsigned k = 0; k < 6; k++)
        TEST_ASSERT_LESS_THAN_DOUBLE(5 * sqrt(P[7 * k]), fabs(e[k]));
}

/* Off by twelve sigmas: near enough for the gate, which takes landmarks one by one. */
static void test_a_start_that_was_believed_too_well_is_told_and_covered(void) {
    const double xi[6] = {0.09, -0.07, 0.05, 0, 0, 0};
    rig.options.range_m = 10;
    rig.options.landmarks = SCENE_MAX_LANDMARKS;
    rig_begin_with(PLR_MODE_LOCALIZATION, true);
    set_pose_off_by(xi, 0.01);
    rig_frame();
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_MAP_DISAGREES);
    for (unsigned k = 0; k < 12; k++) {
        TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_POSE_MAY_BE_WRONG);
        demand_covered();
        rig_drive(1);
    }
    rig_drive(60);
    demand_covered();
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, rig.report.health);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.05, rig_sigma_m());
}

/* Off by eleven sigmas, at a pose that is uncertain by so much that it is found anew. */
static void test_a_rough_start_that_was_believed_too_well_is_told_and_covered(void) {
    const double xi[6] = {0.8, -0.6, 0.4, 0.1, 0.1, -0.3};
    double P[36];
    rig_begin_with(PLR_MODE_LOCALIZATION, true);
    set_pose_off_by(xi, 0.1);
    rig_frame();
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_MAP_DISAGREES);
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_POSE_MAY_BE_WRONG);
    TEST_ASSERT_GREATER_THAN_UINT32(0, rig.filter.totals.widened);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    TEST_ASSERT_GREATER_THAN_DOUBLE(0.5,
                                    sqrt(P[0] + P[7] + P[14])); /* the pose that was set, too */
    demand_covered();
    rig_drive(100);
    demand_covered();
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, rig.report.health);
}

/* A camera that sends the same picture while the body drives on: the picture agrees with itself, and would
 * put the pose back to where it was taken. */
static void test_a_frozen_picture_finds_no_pose(void) {
    rig.config.velocity_sigma[0] = rig.config.velocity_sigma[1] = rig.config.velocity_sigma[2] =
        0.5;
    rig.config.gyro_sigma[0] = rig.config.gyro_sigma[1] = rig.config.gyro_sigma[2] = 0.2;
    rig_begin_with(PLR_MODE_LOCALIZATION, true);
    rig_drive(20);
    plr_observation seen[SCENE_MAX_SEEN];
    plr_frame frame = scene_look(&rig.world);
    for (unsigned i = 0; i < frame.count; i++)
        seen[i] = frame.observations[i];
    frame.observations = seen;
    for (unsigned k = 0; k < 60; k++) {
        double e[6];
        rig_twists();
        frame.t_ns = rig.world.t_ns;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
        if (k < 5)
            continue; /* of pixels that may be noiseless */
        TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_FROZEN_IMAGE);
        TEST_ASSERT_EQUAL_UINT(0, rig.report.used);
        TEST_ASSERT_LESS_THAN_DOUBLE(40, rig_squared_error(e));
    }
}

/* Nearly half a turn, at a pose that is believed to some degrees: the sine of the turn is small. */
static void test_a_rough_start_that_was_turned_round_is_told(void) {
    const double xi[6] = {0.4, 0.2, 0, 0, 0, 2.9};
    uint32_t reasons = 0;
    rig_begin_with(PLR_MODE_LOCALIZATION, true);
    set_pose_off_by(xi, 0.2);
    rig_frame();
    reasons |= rig.report.reasons;
    for (unsigned k = 0; k < 12; k++) {
        rig_drive(1);
        reasons |= rig.report.reasons;
    }
    TEST_ASSERT_TRUE(reasons & (PLR_REASON_MAP_DISAGREES | PLR_REASON_RELOCATED));
    demand_covered();
    rig_drive(60);
    demand_covered();
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_GOOD, rig.report.health);
}

/* In slam a landmark of the map that does not come in at a false pose must not begin as one of the robot's
 * own: it would keep its id from the map for as long as it is seen. */
static void test_landmarks_of_the_map_stay_landmarks_of_the_map(void) {
    const double xi[6] = {2, -1.5, 0.3, 0.1, -0.1, 0.5};
    unsigned known = 0;
    rig.config.known_map = true;
    rig.options.most_seen = 12;
    rig_begin_with(PLR_MODE_SLAM, true);
    set_pose_off_by(xi, 0.05);
    rig_frame();
    rig_drive(40);
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++)
        known += rig.filter.belief.slots[slot].known;
    TEST_ASSERT_GREATER_THAN_UINT(rig.filter.belief.count / 2, known);
    demand_covered();
}

/* A robot on a plane: height, roll and pitch are known exactly. */
static void test_a_start_that_is_exact_along_some_axes_comes_in(void) {
    double P[36] = {0};
    const plr_pose at = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0.3, -0.2, 0}};
    P[0] = P[7] = 0.04;
    P[35] = 0.01;
    rig_begin_with(PLR_MODE_LOCALIZATION, true);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&rig.filter, rig.world.t_ns, &at, P));
    rig_frame();
    TEST_ASSERT_GREATER_THAN_UINT(5, rig.report.used);
}
