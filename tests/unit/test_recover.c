// SPDX-License-Identifier: MIT
/* Going on after the covariance has broken down: the pose stays, with what was known of it and of the
 * motion since; landmarks are made anew; the biases go back to their prior. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "filter/filter_internal.h"
#include "filter/predict.h"
#include "math/packed.h"
#include "state/motion.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/reseal.h"
#include "support/rig.h"
#include "support/specimens.h"

static const double prior_mean[6] = {0.02, -0.01, 0.01, 0.001, -0.002, 0.003};
static const double prior_variance[6] = {4e-4, 4e-4, 4e-4, 1e-6, 1e-6, 1e-6};

void setUp(void) {
    rig_set_up();
    rig.config.bias = 1;
    rig.config.pixel_sigma_px = 1;
    rig_begin();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_bias(&rig.filter, prior_mean, prior_variance));
    rig_drive(10);
}

static void break_covariance(void) {
    rig.filter.belief.P[plr_packed_at(1, 1)] = PLR_R(-1);
    reseal(&rig.filter);
}

static void ten_twists(void) {
    rig_twists();
}

static void demand_positive(void) {
    double *P = specimen_covariance(&rig.filter);
    const unsigned n = 12 + 3 * rig.filter.belief.count;
    for (unsigned i = 0; i < n; i++) /* scaled to ones on the diagonal */
        for (unsigned j = 0; j < i; j++)
            P[n * i + j] = P[n * j + i] /= sqrt(P[(n + 1) * i] * P[(n + 1) * j]);
    for (unsigned i = 0; i < n; i++) {
        TEST_ASSERT_TRUE(P[(n + 1) * i] > 0);
        P[(n + 1) * i] = 1;
    }
    TEST_ASSERT_TRUE(oracle_smallest_eigenvalue(n, P) > 0);
    free(P);
}

static void test_the_frame_that_diverges_makes_landmarks_again(void) {
    for (int times = 1; times <= 3; times++) {
        break_covariance();
        ten_twists();
        rig_frame();
        TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_RECOVERED);
        TEST_ASSERT_EQUAL_UINT32((uint32_t)times, rig.filter.totals.recoveries);
        TEST_ASSERT_EQUAL_UINT32((uint32_t)times, rig.filter.totals.widened);
        TEST_ASSERT_GREATER_THAN_UINT(10, rig.report.created);
        TEST_ASSERT_EQUAL_UINT(rig.report.created, rig.filter.belief.count);
        demand_positive();
        rig_drive(1);
        TEST_ASSERT_FALSE(rig.report.reasons & PLR_REASON_RECOVERED);
        TEST_ASSERT_GREATER_THAN_UINT(10, rig.report.used);
        demand_positive();
    }
    TEST_ASSERT_EQUAL_UINT32(0, rig.filter.totals.resets);
    rig_drive(20); /* in agreement again */
    TEST_ASSERT_FALSE(rig.report.reasons & PLR_REASON_POSE_MAY_BE_WRONG);
}

static void test_the_pose_stays_where_the_twists_have_brought_it(void) {
    ten_twists();
    const plr_pose before = pose_of(&rig.filter);
    break_covariance();
    rig_frame();
    TEST_ASSERT_TRUE(rig.report.reasons & PLR_REASON_RECOVERED);
    const plr_pose after = pose_of(&rig.filter);
    TEST_ASSERT_TRUE(largest_difference(before.p, after.p, 3) < 0.03); /* to the frame's time */
    TEST_ASSERT_EQUAL_UINT(rig.report.created, rig.filter.belief.count);
}

/* What is known afterwards is what was known when all was in order, and less by the motion since: not
 * the start's covariance, and not better than before. */
static void test_the_covariance_is_the_last_good_one_and_that_of_the_motion_since(void) {
    for (int applied = 0; applied < 2; applied++) {
        double good[36], after[36];
        setUp();
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, good));
        ten_twists();
        plr_real Q[36];
        memcpy(Q, rig.filter.motion.Q, sizeof Q);
        if (applied) { /* it comes out only after the motion has been taken into P */
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_predict_apply_prior(&rig.filter));
            TEST_ASSERT_EQUAL_UINT8(0, rig.filter.motion.pending);
        }
        break_covariance();
        plr_filter_recover(&rig.filter);
        reseal(&rig.filter);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, after));
        for (unsigned i = 0; i < 6; i++) {
            TEST_ASSERT_TRUE((double)Q[7 * i] > 0);
            TEST_ASSERT_TRUE(after[7 * i] > 0.99 * ((i < 3 ? 0 : good[7 * i]) + (double)Q[7 * i]));
            /* 0.1 s of the biases' prior sigma, and turning by the way */
            TEST_ASSERT_TRUE(after[7 * i] < 2 * (good[7 * i] + (double)Q[7 * i]) + 2e-4);
        }
        TEST_ASSERT_TRUE(after[0] + after[7] + after[14] >
                         0.99 * (good[0] + good[7] + good[14] + 3 * (double)Q[0]));
    }
}

static void test_a_contradiction_that_was_open_stays_covered(void) {
    double after[36];
    rig.filter.supervisor.doubt = PLR_DOUBT_CONTRADICTED;
    rig.filter.supervisor.difference[0] = PLR_R(0.5);
    rig.filter.supervisor.difference_sigmas[0] = PLR_R(50);
    break_covariance();
    plr_filter_recover(&rig.filter);
    reseal(&rig.filter);
    TEST_ASSERT_EQUAL_UINT8(PLR_DOUBT_SETTLING, rig.filter.supervisor.doubt);
    TEST_ASSERT_EQUAL_UINT8(15, rig.filter.supervisor.settle_frames);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, after));
    TEST_ASSERT_TRUE(after[0] > 0.25);
}

static void test_the_biases_go_back_to_their_prior(void) {
    for (int wild = 0; wild < 2; wild++) {
        double b[6], P_b[36];
        setUp();
        for (unsigned i = 0; i < 6; i++) { /* 3 sigma away, or 5 */
            const double off = (wild ? 5 : 3) * sqrt(prior_variance[i]);
            rig.filter.belief.bias[i] = (plr_real)(prior_mean[i] + off);
        }
        break_covariance();
        plr_filter_recover(&rig.filter);
        reseal(&rig.filter);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, P_b));
        for (unsigned i = 0; i < 6; i++) {
            const double sigma = sqrt(prior_variance[i]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-4 * sigma, prior_mean[i] + (wild ? 0 : 3 * sigma), b[i]);
            const double walk = i < 3 ? rig.config.bias_velocity_walk : rig.config.bias_gyro_walk;
            const double variance = prior_variance[i] + rig.filter.source.bias_walked_s * walk;
            for (unsigned j = 0; j < 6; j++)
                TEST_ASSERT_DOUBLE_WITHIN(1e-6 * variance, i == j ? variance : 0, P_b[6 * i + j]);
        }
    }
}

static void test_a_bias_that_is_no_number_goes_back_too(void) {
    rig.filter.belief.bias[2] = (plr_real)NAN;
    break_covariance();
    plr_filter_recover(&rig.filter);
    TEST_ASSERT_EQUAL_DOUBLE((double)(plr_real)prior_mean[2], (double)rig.filter.belief.bias[2]);
}

/* The prior that was set is the one that a pose from outside falls back to, and that health holds the
 * estimate against. */
static void test_the_prior_is_the_one_that_was_set(void) {
    static const plr_pose origin = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    double b[6];
    for (unsigned i = 0; i < 6; i++) {
        TEST_ASSERT_EQUAL_DOUBLE((double)(plr_real)prior_mean[i],
                                 (double)rig.filter.source.bias_prior[i]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, sqrt(prior_variance[i]),
                                  (double)rig.filter.source.bias_prior_sigma[i]);
    }
    rig.filter.belief.P[plr_packed_at(8, 8)] = PLR_R(-1);
    rig.filter.belief.bias[0] = 3;
    reseal(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&rig.filter, rig.world.t_ns, &origin, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&rig.filter, b, NULL));
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, prior_mean[0], b[0]);
}
