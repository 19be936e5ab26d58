// SPDX-License-Identifier: MIT
/* Twists against pictures (MATH 17): noise is taken for noise, a slip is told at once, and what lies
 * between two stories is a part of the covariance until they agree again. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "filter/consistency.h"
#include "math/dense.h"
#include "math/packed.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "state/motion.h"
#include "support/matrices.h"
#include "support/reseal.h"
#include "support/rig.h"
#include "support/specimens.h"

/* A frame in which the twists announce 0.2 m ahead, to 1 cm and 2 mrad. */
#define WAY_M        0.2
#define SIGMA_M      0.01
#define SIGMA_RAD    0.002
#define SETTLED      15
#define CONTRADICTED PLR_REASON_TWIST_CONTRADICTED
#define MAY_BE_WRONG PLR_REASON_POSE_MAY_BE_WRONG

static plr_filter filter;
static plr_applied_motion believed, applied;
static rng chance;
static double information[6]; /* of a picture on nu, without the prior */
static plr_real moved[6];     /* the pose by a frame, beside the twists */

void setUp(void) {
    chance = rng_seeded(61);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, false, 4);
    plr_consistency_clear(&filter);
    filter.reading_valid = 1; /* and just come */
    filter.reading_ns = filter.t_ns;
    memset(&believed, 0, sizeof believed);
    believed.p[0] = (plr_real)WAY_M;
    for (unsigned k = 0; k < 6; k++) {
        believed.L[7 * k] = (plr_real)(k < 3 ? SIGMA_M : SIGMA_RAD);
        information[k] = 100;
    }
    applied = believed;
    memset(moved, 0, sizeof moved);
}

/* A frame whose picture puts nu at `mean`, give or take its own noise. */
static void add(const double mean[6], double noise) {
    plr_real nu[6], Lambda[21] = {0};
    for (unsigned k = 0; k < 6; k++) {
        const double seen = mean[k] + noise * rng_normal(&chance) / sqrt(information[k]);
        nu[k] = (plr_real)(information[k] / (1 + information[k]) * seen);
        Lambda[plr_upper_row(6, k)] = (plr_real)(1 + information[k]);
    }
    plr_consistency_add(&filter, &believed, &applied, nu, Lambda, moved, NULL, false);
}

static void add_noise(void) {
    double nu[6];
    rng_normals(&chance, 1, nu, 6);
    add(nu, 1);
}

/* The wheels turn and the body stands. */
static void add_slip(void) {
    const double nu[6] = {-WAY_M / SIGMA_M};
    add(nu, 0);
}

static void add_agreement(void) {
    const double nu[6] = {0};
    add(nu, 0);
}

static uint32_t judge(void) {
    const plr_report report = {.matched = 10, .used = 10, .nis = 40, .nis_dof = 40};
    return plr_consistency_judge(&filter, &report, false);
}

/* ---------------------------------------------------------------- noise */

/* s^T V^-1 s of a window, where V is diagonal: of as many degrees of freedom as there are directions. */
static double statistic(const plr_consistency_window *w) {
    double sum = 0;
    for (unsigned k = 0; k < 6; k++)
        sum += pow((double)w->sum[k], 2) / (double)w->variance[plr_upper_row(6, k)];
    return sum;
}

/* Some directions are seen well, others hardly: the windows know how much noise each may hold. */
static void test_under_noise_each_window_is_chi_square_of_six(void) {
    enum { RUNS = 3000, FRAMES = 40 };
    static const double seen[6] = {1000, 100, 10, 1, 0.1, 0.03};
    double sum[PLR_CONSISTENCY_WINDOWS] = {0}, squares[PLR_CONSISTENCY_WINDOWS] = {0};
    unsigned beyond[PLR_CONSISTENCY_WINDOWS] = {0};
    memcpy(information, seen, sizeof information);
    for (int run = 0; run < RUNS; run++) {
        plr_consistency_clear(&filter);
        for (int k = 0; k < FRAMES; k++)
            add_noise();
        for (unsigned w = 0; w < PLR_CONSISTENCY_WINDOWS; w++) {
            const double s = statistic(&filter.consistency.windows[w]);
            sum[w] += s;
            squares[w] += s * s;
            beyond[w] += s > 16.81; /* one in a hundred */
        }
    }
    for (unsigned w = 0; w < PLR_CONSISTENCY_WINDOWS; w++) {
        const double mean = sum[w] / RUNS;
        /* mean 6 and variance 12, to four sigmas of so many runs */
        TEST_ASSERT_DOUBLE_WITHIN(4 * sqrt(12.0 / RUNS), 6, mean);
        TEST_ASSERT_DOUBLE_WITHIN(1.8, 12, squares[w] / RUNS - mean * mean);
        TEST_ASSERT_UINT_WITHIN(22, RUNS / 100, beyond[w]);
    }
    TEST_ASSERT_EQUAL_UINT32(0, filter.totals.contradictions);
}

static void test_noise_is_not_told(void) {
    unsigned told = 0;
    for (int k = 0; k < 3000; k++) {
        add_noise();
        told += judge() != 0;
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT(60, told); /* one excursion in all that, with its settling */
    TEST_ASSERT_EQUAL_UINT32(0, filter.totals.contradictions);
}

/* ---------------------------------------------------------------- a slip */

static void test_a_slip_is_told_within_five_frames(void) {
    for (int k = 0; k < 100; k++) {
        add_noise();
        (void)judge();
    }
    int frames = 0;
    while (!filter.consistency.contradicted && frames < 20) {
        add_slip();
        frames++;
    }
    TEST_ASSERT_LESS_OR_EQUAL_INT(5, frames);
    TEST_ASSERT_EQUAL_HEX32(CONTRADICTED | MAY_BE_WRONG, judge() & (CONTRADICTED | MAY_BE_WRONG));
    TEST_ASSERT_EQUAL_UINT32(1, filter.totals.contradictions);
}

/* Noise settings are never quite true: what differs by more than its noise, and by little, is said, and
 * the twists keep their word. */
static void test_a_second_slip_adds_to_what_the_first_left_unsettled(void) {
    enum { AGREEING = 36 }; /* the windows are clear again after 29, and 15 later it is settled */
    double apart = 0;
    for (int slips = 0; slips < 3; slips++) {
        for (int k = 0; k < 30; k++) {
            add_slip();
            (void)judge();
            /* a way behind grows: 20 cm a frame, but for the few until it is told */
            TEST_ASSERT_GREATER_OR_EQUAL_DOUBLE(apart, -(double)filter.consistency.difference[0]);
            apart = -(double)filter.consistency.difference[0];
        }
        for (int k = 0; k < AGREEING && slips < 2; k++) {
            add_agreement();
            (void)judge();
        }
        TEST_ASSERT_EQUAL_UINT8(15, filter.consistency.settling_frames); /* not settled yet */
    }
    TEST_ASSERT_GREATER_THAN_DOUBLE(0.9 * 90 * WAY_M, apart);
    plr_real P[36] = {0};
    plr_consistency_enlarge(&filter, P);
    TEST_ASSERT_GREATER_THAN_DOUBLE(0.9 * apart * apart, (double)P[0]);
}

static void test_a_small_difference_is_said_and_widens_nothing(void) {
    const double nu[6] = {3}; /* 3 cm in a frame of 20 */
    plr_motion before;
    for (int k = 0; k < 100; k++) {
        add(nu, 0);
        (void)judge();
    }
    TEST_ASSERT_EQUAL_UINT8(1, filter.consistency.drifting);
    TEST_ASSERT_EQUAL_UINT8(0, filter.consistency.contradicted);
    TEST_ASSERT_EQUAL_HEX32(CONTRADICTED | MAY_BE_WRONG, judge() & (CONTRADICTED | MAY_BE_WRONG));
    TEST_ASSERT_EQUAL_UINT32(0, filter.totals.contradictions);
    specimen_motion(&filter, &chance, &filter.motion);
    memcpy(&before, &filter.motion, sizeof before);
    plr_consistency_widen(&filter, &believed);
    TEST_ASSERT_EQUAL_MEMORY(&before, &filter.motion, sizeof before);
}

/* Distant points say next to nothing about the way in one frame, and enough in a hundred. That is told; the
 * twists are believed all the same, for real pixels are not as white. */
static void test_what_is_hardly_seen_is_told_and_takes_no_weight_from_the_twists(void) {
    const double nu[6] = {10}; /* 10 cm in a frame of 20 */
    information[0] = 0.003;
    for (int k = 0; k < 200; k++) {
        add(nu, 0);
        (void)judge();
    }
    TEST_ASSERT_EQUAL_HEX32(CONTRADICTED | MAY_BE_WRONG, judge() & (CONTRADICTED | MAY_BE_WRONG));
    TEST_ASSERT_EQUAL_UINT8(0, filter.consistency.contradicted);
}

static void contradict_outright(double way_m) {
    plr_real nu[6] = {(plr_real)(way_m / 0.5)}, Lambda[21] = {0};
    for (unsigned k = 0; k < 6; k++) {
        applied.L[7 * k] = PLR_R(0.5);
        Lambda[plr_upper_row(6, k)] = 1000;
    }
    plr_consistency_add(&filter, &believed, &applied, nu, Lambda, moved, NULL, true);
    applied = believed;
}

/* Q is `before`, with the variances of the translation times `way`, of the turns times `turn`. */
static void demand_widened(const plr_motion *before, double way, double turn) {
    for (unsigned i = 0; i < 6; i++)
        for (unsigned j = 0; j < 6; j++) {
            const double q =
                (double)before->Q[6 * i + j] * sqrt(i < 3 ? way : turn) * sqrt(j < 3 ? way : turn);
            TEST_ASSERT_DOUBLE_WITHIN(8 * REAL_EPSILON * fabs(q), q,
                                      (double)filter.motion.Q[6 * i + j]);
        }
    TEST_ASSERT_EQUAL_MEMORY(before->B, filter.motion.B, sizeof before->B);
}

static void test_twists_that_are_contradicted_are_believed_less(void) {
    plr_motion before;
    for (int k = 0; k < 5; k++)
        add_slip();
    TEST_ASSERT_EQUAL_UINT8(1, filter.consistency.contradicted);
    specimen_motion(&filter, &chance, &filter.motion);
    memcpy(&before, &filter.motion, sizeof before);
    plr_consistency_widen(&filter, &believed);
    const double factor = (double)filter.motion.Q[0] / (double)before.Q[0];
    TEST_ASSERT_GREATER_THAN_DOUBLE(40.0 / 6, factor); /* they are not, before a window says 40 */
    demand_widened(&before, factor, 1); /* wheels that slip say nothing against the gyro */
}

/* A turn shows in the rate alone; how much of it is translation, no one knows. */
static void test_a_gyro_that_is_contradicted_is_believed_less_and_so_are_the_wheels(void) {
    const double nu[6] = {0, 0, 0, 0, 0, 30};
    plr_motion before;
    for (int k = 0; k < 5; k++)
        add(nu, 0);
    TEST_ASSERT_EQUAL_UINT8(1, filter.consistency.contradicted);
    specimen_motion(&filter, &chance, &filter.motion);
    memcpy(&before, &filter.motion, sizeof before);
    plr_consistency_widen(&filter, &believed);
    const double factor = (double)filter.motion.Q[35] / (double)before.Q[35];
    TEST_ASSERT_GREATER_THAN_DOUBLE(40.0 / 6, factor);
    demand_widened(&before, factor, factor);
}

/* Real pixels have small lasting errors, which a good gyro shows: what is no good part of the turn takes
 * as much weight as it says by itself, whatever the wheels do. */
static void test_turns_that_are_off_by_little_keep_most_of_their_weight(void) {
    const double nu[6] = {-WAY_M / SIGMA_M, 0, 0, 0, 0, 0.0038 / SIGMA_RAD};
    plr_motion before;
    for (int k = 0; k < 5; k++)
        add(nu, 0);
    TEST_ASSERT_EQUAL_UINT8(1, filter.consistency.contradicted);
    plr_motion_clear(&filter);
    for (unsigned k = 0; k < 6; k++)
        filter.motion.Q[7 * k] = believed.L[7 * k] * believed.L[7 * k];
    memcpy(&before, &filter.motion, sizeof before);
    plr_consistency_widen(&filter, &believed);
    const double way = (double)filter.motion.Q[0] / (double)before.Q[0];
    const double turn = (double)filter.motion.Q[35] / (double)before.Q[35];
    TEST_ASSERT_GREATER_THAN_DOUBLE(1 + 11.3 / 2, turn);
    TEST_ASSERT_LESS_THAN_DOUBLE(12, turn);
    TEST_ASSERT_GREATER_THAN_DOUBLE(100, way);
    demand_widened(&before, way, turn);
}

/* What one frame says outright counts for each by itself, too. */
static void test_a_slip_that_is_outright_leaves_the_turns_their_weight(void) {
    plr_motion before;
    contradict_outright(0.4);
    specimen_motion(&filter, &chance, &filter.motion);
    memcpy(&before, &filter.motion, sizeof before);
    plr_consistency_widen(&filter, &believed);
    demand_widened(&before, 1 + 0.5 * pow(0.4 / SIGMA_M, 2), 1);
}

/* As long as it lasts the pose's covariance reaches from one story to the other. */
static void test_the_covariance_covers_both_stories(void) {
    plr_real C[36] = {0};
    plr_motion_clear(&filter);
    plr_consistency_enlarge(&filter, C);
    for (unsigned i = 0; i < 36; i++)
        TEST_ASSERT_EQUAL_DOUBLE(0, (double)C[i]);
    for (int k = 0; k < 10; k++)
        add_slip();
    const double apart = (double)filter.consistency.difference[0];
    TEST_ASSERT_DOUBLE_WITHIN(0.3, -10 * WAY_M, apart);
    plr_consistency_enlarge(&filter, C);
    TEST_ASSERT_DOUBLE_WITHIN(0.06 * apart * apart, apart * apart, (double)C[0]);
    for (unsigned i = 1; i < 3; i++) /* and a fifth of it to the sides */
        TEST_ASSERT_DOUBLE_WITHIN(0.002 * apart * apart, 0.04 * apart * apart, (double)C[7 * i]);
}

/* ---------------------------------------------------------------- outright */

static void test_a_frame_may_contradict_the_twists_outright(void) {
    add_noise();
    TEST_ASSERT_EQUAL_HEX32(0, judge());
    contradict_outright(0.4);
    TEST_ASSERT_EQUAL_HEX32(CONTRADICTED | MAY_BE_WRONG, judge());
    TEST_ASSERT_EQUAL_UINT32(1, filter.totals.contradictions);
    TEST_ASSERT_EQUAL_UINT8(1, filter.consistency.contradicted);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.4, (double)filter.consistency.difference[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-2, pow(0.4 / SIGMA_M, 2), (double)filter.consistency.excess);
}

/* A scene of which a part moves carries the landmarks and with them the pose, frame after frame. */
static void test_what_the_frames_moved_the_pose_by_is_covered_too(void) {
    moved[0] = PLR_R(-0.9);
    moved[4] = PLR_R(0.02);
    contradict_outright(0.4);
    const plr_real *d = filter.consistency.difference;
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, -0.9, (double)d[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.02, (double)d[4]);
    moved[0] = moved[4] = 0;
    add_slip(); /* of which the pictures say more */
    TEST_ASSERT_DOUBLE_WITHIN(0.2 * WAY_M, -0.9 - WAY_M, (double)d[0]);
}

static void test_an_old_reading_is_no_rival_of_the_picture(void) {
    filter.t_ns += 1000000000;
    contradict_outright(0.4);
    TEST_ASSERT_EQUAL_HEX32(CONTRADICTED | MAY_BE_WRONG, judge());
    TEST_ASSERT_EQUAL_UINT8(1, filter.consistency.contradicted);
    TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.consistency.difference[0]);
}

static void test_after_fifteen_frames_of_agreement_it_is_settled(void) {
    const double before = (double)filter.P[plr_packed_at(0, 0)];
    const uint32_t widened = filter.totals.widened;
    contradict_outright(0.4);
    (void)judge();
    for (int k = 1; k < SETTLED; k++) {
        add_agreement();
        TEST_ASSERT_EQUAL_HEX32(CONTRADICTED | MAY_BE_WRONG, judge() | CONTRADICTED);
        TEST_ASSERT_EQUAL_UINT8(1, filter.consistency.contradicted);
        TEST_ASSERT_EQUAL_UINT32(widened, filter.totals.widened);
    }
    const double apart = (double)filter.consistency.difference[0];
    add_agreement();
    TEST_ASSERT_EQUAL_HEX32(0, judge());
    TEST_ASSERT_EQUAL_UINT8(0, filter.consistency.contradicted);
    TEST_ASSERT_EQUAL_UINT8(0, filter.consistency.settling_frames);
    TEST_ASSERT_EQUAL_UINT32(widened + 1,
                             filter.totals.widened); /* what was between them is in P */
    TEST_ASSERT_DOUBLE_WITHIN(0.06 * apart * apart, before + 1.04 * apart * apart,
                              (double)filter.P[plr_packed_at(0, 0)]);
    TEST_ASSERT_EQUAL_DOUBLE(0, (double)filter.consistency.difference[0]);
}

/* What is turned away for minutes says that the settings are wrong, not that something happens. */
static void test_biases_are_kept_from_a_doubt_until_it_is_settled_or_has_become_usual(void) {
    const plr_report disagrees = {
        .matched = 10, .gated = 5, .gated_again = 5, .used = 5, .nis = 20, .nis_dof = 20};
    unsigned kept = 0;
    TEST_ASSERT_FALSE(plr_consistency_keeps_biases(&filter));
    for (int k = 0; k < 800; k++) {
        add_agreement();
        (void)plr_consistency_judge(&filter, &disagrees, k == 0);
        TEST_ASSERT_EQUAL_UINT8(0, filter.consistency.contradicted);
        kept += plr_consistency_keeps_biases(&filter);
    }
    TEST_ASSERT_UINT_WITHIN(10, 600, kept);
    TEST_ASSERT_FALSE(plr_consistency_keeps_biases(&filter));
    contradict_outright(0.4);
    (void)judge();
    TEST_ASSERT_TRUE(plr_consistency_keeps_biases(&filter));
    for (int k = 0; k < 2 * SETTLED; k++) {
        add_agreement();
        (void)judge();
    }
    contradict_outright(0.4);
    for (int k = 0; k < SETTLED; k++) {
        (void)judge();
        TEST_ASSERT_TRUE(plr_consistency_keeps_biases(&filter));
        add_agreement();
    }
    (void)judge();
    TEST_ASSERT_FALSE(plr_consistency_keeps_biases(&filter));
}

static void test_a_frame_that_differs_begins_the_settling_anew(void) {
    const double nu[6] = {0, 8};
    contradict_outright(0.4);
    (void)judge();
    for (int k = 1; k < SETTLED; k++) {
        add_agreement();
        (void)judge();
    }
    add(nu, 0);
    for (int k = 1; k < SETTLED; k++) {
        TEST_ASSERT_TRUE(judge() & MAY_BE_WRONG);
        add_agreement();
    }
}

/* Frames in agreement that end the doubt, after `frames` that differ by `sigmas`. */
static unsigned doubted_after(unsigned frames, double sigmas) {
    const double nu[6] = {0, sigmas};
    unsigned settled = 0;
    setUp();
    for (unsigned k = 0; k < frames; k++) {
        add(nu, 0);
        TEST_ASSERT_EQUAL_UINT8(0, filter.consistency.contradicted); /* 1 cm a frame is little */
        (void)judge();
    }
    TEST_ASSERT_EQUAL_UINT8(1, filter.consistency.drifting);
    do {
        add_agreement();
        settled += !filter.consistency.drifting;
    } while (judge() & MAY_BE_WRONG);
    return settled;
}

static void test_a_drift_is_doubted_as_long_as_it_lasted_and_no_longer_than_a_contradiction(void) {
    TEST_ASSERT_LESS_THAN_UINT(SETTLED - 5, doubted_after(1, 6)); /* as noise may, in 60,000 */
    TEST_ASSERT_EQUAL_UINT(SETTLED, doubted_after(30, 2.5));
}

/* ---------------------------------------------------------------- the biases */

/* Is a bias told as off its prior, `sigmas` of that away, if `share` of its variance is gone? */
static bool is_told(unsigned axis, double sigmas, double share) {
    double variance[6];
    plr_report report = {.matched = 10, .used = 10, .nis = 40, .nis_dof = 40};
    rig_set_up();
    rig.config.bias = true;
    rig_begin();
    for (unsigned k = 0; k < 6; k++) {
        const double prior = (double)rig.filter.bias_prior_sigma[k];
        variance[k] = (k == axis ? 1 - share : 1.0) * prior * prior;
    }
    plr_covariance_begin_diagonal(&rig.filter, PLR_BLOCK_BIAS, variance);
    rig.filter.bias[axis] =
        rig.filter.bias_prior[axis] + (plr_real)sigmas * rig.filter.bias_prior_sigma[axis];
    return (plr_consistency_judge(&rig.filter, &report, false) & PLR_REASON_BIAS_OFF_PRIOR) != 0;
}

/* An estimate of which half has been learnt should be within sqrt(1/2) of the prior's sigmas. */
static void test_a_bias_is_held_against_what_has_been_learnt_of_it(void) {
    for (unsigned axis = 0; axis < 6; axis++)
        for (int sign = -1; sign <= 1; sign += 2) {
            TEST_ASSERT_TRUE(is_told(axis, sign * 4.3, 0.99));
            TEST_ASSERT_FALSE(is_told(axis, sign * 4.1, 0.99));
            TEST_ASSERT_TRUE(is_told(axis, sign * 3.05, 0.5));
            TEST_ASSERT_FALSE(is_told(axis, sign * 2.9, 0.5));
        }
}

static void test_a_bias_of_which_little_is_known_is_not_judged(void) {
    TEST_ASSERT_FALSE(is_told(0, 5, 0));
    TEST_ASSERT_FALSE(is_told(0, 5, 0.2));
    TEST_ASSERT_FALSE(is_told(0, 5, -0.5)); /* it has walked since */
    TEST_ASSERT_TRUE(is_told(0, 5, 0.3));
}

/* ---------------------------------------------------------------- on a drive */

static double error_m(void) {
    plr_pose truth;
    scene_pose(&rig.world, &truth);
    const plr_pose pose = pose_of(&rig.filter);
    return sqrt(pow(truth.p[0] - pose.p[0], 2) + pow(truth.p[1] - pose.p[1], 2) +
                pow(truth.p[2] - pose.p[2], 2));
}

static void begin_drive(void) {
    rig_set_up();
    rig.config.pixel_sigma_px = 1;
    rig_begin();
    rig_drive(20);
    TEST_ASSERT_FALSE(rig.report.reasons & CONTRADICTED);
}

static void test_wheels_that_slip_do_not_carry_the_pose_away(void) {
    int frames = 0;
    begin_drive();
    do {
        rig_twists_in_place(2);
        rig_frame();
    } while (!(rig.report.reasons & CONTRADICTED) && ++frames < 20);
    TEST_ASSERT_LESS_OR_EQUAL_INT(4, frames); /* told in the fifth at the latest */
    for (int k = 0; k < 10; k++) {
        rig_twists_in_place(2);
        rig_frame();
    }
    TEST_ASSERT_TRUE(error_m() < 0.1); /* the readings have gone 2 m */
    TEST_ASSERT_TRUE(rig.report.reasons & MAY_BE_WRONG);
    for (int k = 0; k < 60; k++) {
        rig_twists_in_place(0);
        rig_frame();
    }
    TEST_ASSERT_FALSE(rig.report.reasons & (CONTRADICTED | MAY_BE_WRONG));
}
