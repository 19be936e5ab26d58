// SPDX-License-Identifier: MIT
/* Pictures against odometry (docs/SUPERVISION.md): noise is taken for noise, also where it is more than
 * stated; a slip after agreement takes weight from the odometry until both agree again. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "math/dense.h"
#include "supervise/odometry.h"
#include "supervise/supervise.h"
#include "support/matrices.h"
#include "support/random.h"
#include "support/rig.h"

/* A frame in which the odometry announces 0.2 m ahead, to 1 cm and 2 mrad. */
#define WAY_M        0.2
#define SIGMA_M      0.01
#define SIGMA_RAD    0.002
#define CONTRADICTED PLR_REASON_TWIST_CONTRADICTED
#define MAY_BE_WRONG PLR_REASON_POSE_MAY_BE_WRONG

enum { SETTLED = 15, BEFORE = 40 };

static plr_supervisor s;
static plr_frame_evidence e;
static plr_frame_decision decision;
static plr_config config;
static rng chance;
static double information[6]; /* of a picture on nu, without the prior */
static unsigned contradictions;

void setUp(void) {
    chance = rng_seeded(61);
    plr_config_default(&config);
    memset(&s, 0, sizeof s);
    plr_supervise_begin(&s, &config);
    memset(&e, 0, sizeof e);
    e.readings =
        (plr_readings_evidence){.now_ns = 1, .reading_ns = 1, .valid = true, .needed = true};
    e.motion.p[0] = PLR_R(WAY_M);
    for (unsigned k = 0; k < 6; k++) {
        e.motion.L[7 * k] = (plr_real)(k < 3 ? SIGMA_M : SIGMA_RAD);
        information[k] = 100;
    }
    contradictions = 0;
}

static void end_frame(unsigned used) {
    const plr_report report = {.matched = 10, .used = (uint16_t)used, .nis = 40, .nis_dof = 40};
    plr_supervise_frame(&s, &e, &report, &decision);
    contradictions += decision.contradicted_now;
    e.motion.applied = e.motion.outright = false;
}

/* What is decided before a frame whose picture is new. */
static plr_picture_decision decided(void) {
    const plr_picture_evidence nothing = {0};
    return plr_supervise_picture(&s, &nothing);
}

static plr_search_decision search(bool outright) {
    const plr_search_evidence found = {10, 0, outright, 0};
    return plr_supervise_search(&s, &found);
}

/* A frame whose picture puts nu, in stated sigmas, at `mean`, give or take `noise` of its own; the odometry has
 * the weight that was decided. Returns whether the biases are held. */
static bool add(const double mean[6], double noise) {
    plr_motion_evidence *m = &e.motion;
    const bool held = search(false).hold_biases;
    const double w = (double)decided().weight;
    m->applied = true;
    m->weight = (plr_real)w;
    for (unsigned k = 0; k < 6; k++) {
        const double J = information[k] * w * w;
        const double seen = mean[k] + noise * rng_normal(&chance) / sqrt(information[k]);
        m->nu[k] = (plr_real)(J / (1 + J) * seen);
        m->moved[k] = m->nu[k] * m->L[7 * k];
        m->Lambda[plr_upper_row(6, k)] = (plr_real)(1 + J);
    }
    end_frame(10);
    return held;
}

static void add_noise(unsigned frames, double times) {
    for (unsigned i = 0; i < frames; i++) {
        double nu[6];
        rng_normals(&chance, times, nu, 6);
        add(nu, 1);
    }
}

/* The wheels turn and the body stands. */
static void add_slip(unsigned frames) {
    const double nu[6] = {-WAY_M / SIGMA_M};
    while (frames-- > 0)
        add(nu, 0);
}

static void add_agreement(unsigned frames) {
    const double nu[6] = {0};
    while (frames-- > 0)
        add(nu, 0);
}

/* The points agree on a motion that is further by `way_m`; the frame that waits comes before. */
static void exclude_odometry(double way_m) {
    plr_motion_evidence *m = &e.motion;
    if (search(true).wait) {
        end_frame(0);
        TEST_ASSERT_FALSE(search(true).wait);
    }
    m->applied = m->outright = true;
    memset(m->nu, 0, sizeof m->nu);
    for (unsigned k = 0; k < 6; k++)
        m->Lambda[plr_upper_row(6, k)] = 1000;
    m->nu[0] = (plr_real)(way_m / SIGMA_M);
    m->moved[0] = (plr_real)way_m;
    end_frame(10);
}

static bool is_said(uint32_t reasons) {
    return (decision.reasons & reasons) == reasons;
}

/* The variance along an axis that the reported covariance gains. */
static double cover(unsigned axis) {
    static const plr_real none[9] = {0};
    plr_real P[36] = {0};
    plr_supervise_enlarge(&s, none, none, P);
    return (double)P[7 * axis];
}

/* ---------------------------------------------------------------- noise */

static void test_noise_is_not_told(void) {
    unsigned told = 0;
    for (unsigned k = 0; k < 3000; k++) {
        add_noise(1, 1);
        told += decision.reasons != 0;
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT(60, told); /* one excursion in all that, with its settling */
    TEST_ASSERT_EQUAL_UINT(0, contradictions);
}

/* Noise of three times the stated sigma all along: counted in units of what is usual. */
static void test_a_drive_whose_sigmas_are_too_small_is_good_and_told(void) {
    unsigned good = 0;
    add_noise(200, 3);
    for (unsigned k = 0; k < 1000; k++) {
        add_noise(1, 3);
        good += decision.health == PLR_HEALTH_GOOD;
        TEST_ASSERT_TRUE(is_said(PLR_REASON_NOISE_MISFIT));
        TEST_ASSERT_TRUE(s.usual[k % 6] > 2 && s.usual[k % 6] < 20);
    }
    TEST_ASSERT_GREATER_THAN_UINT(900, good);
    TEST_ASSERT_EQUAL_UINT(0, contradictions);
    add_noise(3000, 1);
    TEST_ASSERT_FALSE(is_said(PLR_REASON_NOISE_MISFIT));
}

/* ---------------------------------------------------------------- a slip */

static void test_a_slip_after_agreement_contradicts_within_five_frames_and_once(void) {
    unsigned frames = 0;
    add_noise(BEFORE, 1);
    for (; contradictions == 0 && frames < 20; frames++)
        add_slip(1);
    TEST_ASSERT_LESS_OR_EQUAL_UINT(5, frames);
    add_slip(30);
    TEST_ASSERT_EQUAL_UINT(1, contradictions);
    TEST_ASSERT_TRUE(is_said(CONTRADICTED | MAY_BE_WRONG));
    TEST_ASSERT_EQUAL_INT(PLR_HEALTH_DEGRADED, decision.health);
}

/* There is no before: wrong sigmas or a wrong calibration are likelier than wheels that always slip. */
static void test_a_slip_from_the_first_frame_is_told_and_takes_no_weight(void) {
    for (unsigned k = 0; k < 300; k++) {
        add_slip(1);
        TEST_ASSERT_FALSE(decided().may_exclude_odometry);
        TEST_ASSERT_TRUE(decided().weight <= 1);
        TEST_ASSERT_TRUE(k < 5 || is_said(CONTRADICTED));
    }
    TEST_ASSERT_TRUE(is_said(PLR_REASON_NOISE_MISFIT));
    TEST_ASSERT_EQUAL_UINT(0, contradictions);
}

/* What creeps up is first more than agreement and less than a departure: that takes no before away. */
static void test_an_event_that_begins_slowly_has_a_before(void) {
    const double nu[6] = {1.5};
    unsigned between = 0;
    add_agreement(BEFORE);
    for (unsigned k = 0; k < 40; k++) {
        const plr_real before = s.agreement;
        add(nu, 0);
        between += s.statistic > 16 && s.statistic < 32;
        TEST_ASSERT_TRUE(s.statistic > 32 || s.agreement >= before);
    }
    TEST_ASSERT_GREATER_THAN_UINT(2, between);
}

static void test_odometry_that_slips_loses_weight(void) {
    add_agreement(BEFORE);
    add_slip(6);
    TEST_ASSERT_GREATER_THAN_DOUBLE(sqrt(1 + 40.0 / 2), (double)decided().weight);
}

/* What distant points say of the way is next to nothing in a frame and enough in twenty. */
static void test_a_difference_that_is_hardly_seen_is_said_and_takes_no_weight(void) {
    const double nu[6] = {10};
    unsigned told = 0;
    add_agreement(1000); /* before, or it becomes usual sooner than it is told */
    information[0] = 0.025;
    for (unsigned k = 0; k < 100; k++) {
        add(nu, 0);
        told += is_said(CONTRADICTED | MAY_BE_WRONG);
        TEST_ASSERT_TRUE(decided().weight <= 1);
    }
    TEST_ASSERT_GREATER_THAN_UINT(10, told);
    TEST_ASSERT_EQUAL_UINT(0, contradictions);
}

/* ---------------------------------------------------------------- outright */

static void test_one_wild_frame_is_not_used_and_the_next_is(void) {
    add_agreement(BEFORE);
    plr_search_decision found = search(true);
    TEST_ASSERT_TRUE(found.wait && found.make_none && !found.drop_rejected);
    end_frame(0);
    TEST_ASSERT_TRUE(is_said(CONTRADICTED));
    add_agreement(1);
    TEST_ASSERT_EQUAL_HEX32(0, decision.reasons);
    TEST_ASSERT_TRUE(search(true).wait); /* and the one after that would wait again */
    TEST_ASSERT_EQUAL_UINT(0, contradictions);
}

static void test_a_second_frame_confirms_and_one_that_rejects_nearly_all_does_not_deny(void) {
    const plr_search_evidence at_a_loss = {10, 9, false, 0};
    add_agreement(BEFORE);
    TEST_ASSERT_TRUE(search(true).wait);
    end_frame(0);
    TEST_ASSERT_FALSE(plr_supervise_search(&s, &at_a_loss).wait);
    end_frame(1);
    TEST_ASSERT_TRUE(is_said(CONTRADICTED));
    TEST_ASSERT_FALSE(search(true).wait);
    exclude_odometry(0.4);
    TEST_ASSERT_EQUAL_UINT(1, contradictions);
    TEST_ASSERT_TRUE(is_said(CONTRADICTED | MAY_BE_WRONG));
    TEST_ASSERT_DOUBLE_WITHIN(0.1, sqrt(1 + 0.5 * pow(0.4 / SIGMA_M, 2)), (double)decided().weight);
}

/* ---------------------------------------------------------------- what is covered */

/* Where the scene may move as one, either may be right; where it stands, the pictures are. */
static void test_the_covariance_reaches_to_the_other_pose_that_may_be_true(void) {
    for (uint8_t policy = PLR_SCENE_STANDS; policy <= PLR_SCENE_MAY_MOVE; policy++) {
        setUp();
        s.scene = policy;
        add_agreement(BEFORE);
        TEST_ASSERT_EQUAL_DOUBLE(0, cover(0));
        add_slip(10);
        const double apart = 10 * WAY_M;
        if (policy == PLR_SCENE_STANDS) {
            TEST_ASSERT_LESS_THAN_DOUBLE(pow(0.3 * apart, 2), cover(0));
            continue;
        }
        TEST_ASSERT_DOUBLE_WITHIN(0.4 * apart * apart, apart * apart, cover(0));
        TEST_ASSERT_DOUBLE_WITHIN(0.01 * cover(0), 0.04 / 1.04 * cover(0), cover(1));
    }
}

static void test_fifteen_frames_of_agreement_settle_it_and_what_lies_between_is_covered(void) {
    s.scene = PLR_SCENE_MAY_MOVE;
    add_agreement(BEFORE);
    exclude_odometry(0.4);
    for (unsigned k = 1; k < SETTLED; k++) {
        add_agreement(1);
        TEST_ASSERT_TRUE(is_said(MAY_BE_WRONG));
        TEST_ASSERT_FALSE(decision.covers);
    }
    add_agreement(1);
    TEST_ASSERT_TRUE(decision.covers);
    TEST_ASSERT_DOUBLE_WITHIN(0.06 * 0.16, 1.04 * 0.16, (double)decision.cover[0]);
    TEST_ASSERT_EQUAL_HEX32(0, decision.reasons);
    TEST_ASSERT_EQUAL_DOUBLE(0, cover(0));
    TEST_ASSERT_EQUAL_DOUBLE(1, (double)decided().weight);
}

static void test_a_frame_that_differs_begins_the_settling_anew(void) {
    const double nu[6] = {0, 12};
    add_agreement(BEFORE);
    exclude_odometry(0.4);
    add_agreement(SETTLED - 1);
    add(nu, 0);
    for (unsigned k = 1; k < SETTLED; k++) {
        TEST_ASSERT_TRUE(is_said(MAY_BE_WRONG));
        add_agreement(1);
    }
}

static void test_an_old_reading_is_no_rival_of_the_picture(void) {
    s.scene = PLR_SCENE_MAY_MOVE;
    add_agreement(BEFORE);
    e.readings.now_ns += 1000000000;
    exclude_odometry(0.4);
    TEST_ASSERT_TRUE(is_said(CONTRADICTED | MAY_BE_WRONG | PLR_REASON_NO_TWISTS));
    TEST_ASSERT_EQUAL_DOUBLE(0, cover(0));
}

/* Frames of agreement that end the doubt, after `frames` that differ by `sigmas` in a direction of which a
 * frame says so much. */
static unsigned doubted_after(unsigned frames, double sigmas, double said) {
    const double nu[6] = {0, sigmas};
    unsigned agreeing = 0;
    setUp();
    add_agreement(BEFORE);
    information[1] = said;
    for (unsigned k = 0; k < frames; k++)
        add(nu, 0);
    TEST_ASSERT_EQUAL_UINT8(PLR_DOUBT_DEPARTED, s.doubt);
    do {
        add_agreement(1);
        agreeing += s.doubt != PLR_DOUBT_DEPARTED;
    } while (is_said(MAY_BE_WRONG) && agreeing < 100);
    return agreeing;
}

static void
test_a_departure_is_doubted_as_long_as_it_lasted_and_no_longer_than_a_contradiction(void) {
    TEST_ASSERT_LESS_THAN_UINT(SETTLED - 5,
                               doubted_after(1, 14, 100)); /* as noise may, in 60,000 */
    TEST_ASSERT_EQUAL_UINT(SETTLED, doubted_after(38, 10, 0.05));
}

/* ---------------------------------------------------------------- between frames */

static void test_biases_are_taught_nothing_until_it_is_settled_or_has_lasted_for_a_minute(void) {
    unsigned held = 0;
    const double nu[6] = {0};
    add_agreement(BEFORE);
    TEST_ASSERT_FALSE(add(nu, 0));
    exclude_odometry(0.4);
    for (unsigned k = 1; k <= SETTLED; k++)
        TEST_ASSERT_TRUE(add(nu, 0));
    TEST_ASSERT_FALSE(add(nu, 0));
    (void)plr_supervise_begun_anew(&s, true); /* a doubt that does not end */
    for (unsigned k = 0; k < 800; k++) {
        e.events.lost_in_map = true;
        s.frozen = 1;
        s.frozen_variance[0] = 1; /* repeats were used before the body was seen to move */
        held += add(nu, 0);
    }
    TEST_ASSERT_UINT_WITHIN(2, 600, held);
}

static void test_a_picture_that_was_seen_to_repeat_at_once_casts_no_doubt(void) {
    const double nu[6] = {0};
    add_agreement(BEFORE);
    s.frozen = 1;
    (void)add(nu, 0);
    TEST_ASSERT_FALSE(is_said(MAY_BE_WRONG));
    s.frozen_variance[0] = 1;
    (void)add(nu, 0);
    TEST_ASSERT_TRUE(is_said(MAY_BE_WRONG));
}

static void test_a_pose_that_is_set_is_in_no_doubt_and_one_found_anew_is(void) {
    add_agreement(BEFORE);
    add_slip(10);
    plr_supervise_pose_set(&s);
    TEST_ASSERT_EQUAL_UINT8(PLR_DOUBT_NONE, s.doubt);
    TEST_ASSERT_EQUAL_DOUBLE(0, cover(0));
    TEST_ASSERT_TRUE(decided().may_exclude_odometry); /* what was learnt of the odometry holds */
    (void)plr_supervise_begun_anew(&s, true);
    TEST_ASSERT_TRUE(plr_supervise_was_relocated(&s));
    add_agreement(SETTLED - 1);
    TEST_ASSERT_TRUE(is_said(MAY_BE_WRONG));
    add_agreement(1);
    TEST_ASSERT_FALSE(is_said(MAY_BE_WRONG) || plr_supervise_was_relocated(&s));
}

/* ---------------------------------------------------------------- on a drive */

static void test_wheels_that_slip_do_not_carry_the_pose_away(void) {
    double e6[6];
    rig_set_up();
    rig.config.pixel_sigma_px = 1;
    rig_begin();
    rig_drive(30);
    for (unsigned k = 0; k < 15; k++) {
        rig_twists_in_place(2);
        rig_frame();
        TEST_ASSERT_TRUE(k < 4 || rig.report.reasons & CONTRADICTED);
    }
    (void)rig_squared_error(e6);
    TEST_ASSERT_LESS_THAN_DOUBLE(0.1,
                                 sqrt(e6[0] * e6[0] + e6[1] * e6[1] + e6[2] * e6[2])); /* of 6 m */
    for (unsigned k = 0; k < 60; k++) {
        rig_twists_in_place(0);
        rig_frame();
    }
    TEST_ASSERT_FALSE(rig.report.reasons & (CONTRADICTED | MAY_BE_WRONG));
}

/* The readings scatter three times as much as the settings say. */
static void test_a_drive_of_too_small_sigmas_is_good_and_its_covariance_covers(void) {
    enum { SEEDS = PELORUS_SHORT_FORM ? 3 : 10, FRAMES = PELORUS_SHORT_FORM ? 150 : 300 };
    double sum = 0;
    unsigned good = 0;
    rig_set_up();
    rig.config.pixel_sigma_px = 1;
    rig.options.velocity_sigma_mps *= 3;
    rig.options.gyro_sigma_radps *= 3;
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        double e6[6];
        rig.options.seed = seed;
        rig_begin();
        for (unsigned k = 0; k < FRAMES; k++) {
            rig_drive(1);
            good += rig.report.health == PLR_HEALTH_GOOD;
        }
        sum += rig_squared_error(e6) / SEEDS;
    }
    TEST_ASSERT_GREATER_THAN_UINT(SEEDS * FRAMES * 9 / 10, good);
    TEST_ASSERT_LESS_THAN_DOUBLE(30, sum);
}

static void test_what_is_told_of_a_frame_is_what_was_seen_and_decided(void) {
    plr_supervision told;
    rig_set_up();
    rig.options.outliers = 0.3;
    rig_begin();
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_supervision(&rig.filter, &told));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_supervision(&rig.filter, NULL));
    rig_drive(60);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_supervision(&rig.filter, &told));
    TEST_ASSERT_TRUE(told.applied && !told.outright && told.t_ns == rig.report.t_ns);
    TEST_ASSERT_EQUAL_UINT8(PLR_DOUBT_NONE, told.doubt);
    TEST_ASSERT_EQUAL_UINT16(rig.report.matched, told.matched);
    TEST_ASSERT_EQUAL_UINT(rig.report.gated, told.count);
    for (unsigned i = 1; i < told.count; i++)
        TEST_ASSERT_TRUE(told.rejected[i - 1].mean2 >= told.rejected[i].mean2);
    rig_drive_told(20, 0);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_supervision(&rig.filter, &told));
    TEST_ASSERT_EQUAL_UINT8(PLR_DOUBT_CONTRADICTED, told.doubt);
    TEST_ASSERT_TRUE(told.weight > 1 && told.holds_biases);
}
