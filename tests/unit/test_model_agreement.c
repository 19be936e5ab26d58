// SPDX-License-Identifier: MIT
/*
 * Where the two models must agree: at one linearisation point they are linearly equivalent,
 * H_world A = H_body with A the map from body errors to world errors (MATH 12), and so are their
 * innovation covariances, if P_world = A P_body A^T. Also src/state/model.c, on which A rests.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "filter/gate.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/pose.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/rigid.h"
#include "support/specimens.h"
#include "support/twin.h"

enum { RUNS = 20, LANDMARKS = 5 };

static const double eps = REAL_EPSILON;
static plr_filter body, world;
static rng chance;

void setUp(void) {
    chance = rng_seeded(46);
}

/* A, from (xi, db, w) to (xi, db, dm): dm = J (xi, w). n x n; to be freed. */
static double *errors_to_world(void) {
    const unsigned n = plr_covariance_dim(&body.belief);
    double *A = specimen_zeros(n, n);
    for (unsigned i = 0; i < plr_covariance_row(&body.belief, 0); i++)
        A[i * n + i] = 1;
    for (unsigned slot = 0; slot < body.belief.count; slot++) {
        const unsigned row = plr_covariance_row(&body.belief, slot);
        plr_world_point point;
        plr_model_body.in_world(&body.belief, &body.camera, &body.motion, &body.belief.slots[slot],
                                &point);
        specimen_put_rows(A + (size_t)row * n, n, &point.J);
    }
    return A;
}

/* The same state in both models. */
static void take_pair(bool bias) {
    specimen_filter(&body, &chance, PLR_MODEL_BODY, bias, LANDMARKS);
    world = body;
    world.config.model = PLR_MODEL_WORLD;
    world.belief.model = PLR_MODEL_WORLD;
    for (unsigned slot = 0; slot < LANDMARKS; slot++) {
        plr_world_point point;
        plr_model_body.in_world(&body.belief, &body.camera, &body.motion, &body.belief.slots[slot],
                                &point);
        to_reals(world.belief.slots[slot].x, point.p_W, 3);
    }
    const unsigned n = plr_covariance_dim(&body.belief);
    double *A = errors_to_world(), *P = specimen_covariance(&body), *AP = specimen_zeros(n, n);
    oracle_sandwich(n, n, A, P, AP);
    pack_lower(world.belief.P, AP, n);
    free(AP);
    free(P);
    free(A);
}

static void test_observations_are_linearly_equivalent_at_one_point(void) {
    for (int run = 0; run < RUNS; run++) {
        take_pair(run % 2);
        const unsigned n = plr_covariance_dim(&body.belief);
        double *A = errors_to_world(), *H_body = specimen_zeros(3, n);
        double *H_world = specimen_zeros(3, n), *HA = specimen_zeros(3, n);
        for (unsigned slot = 0; slot < LANDMARKS; slot++) {
            const plr_observation corner = {0};
            const plr_measurement in_body = specimen_measurement(&body, slot, &corner);
            const plr_measurement in_world = specimen_measurement(&world, slot, &corner);
            memset(H_body, 0, 3 * (size_t)n * sizeof *H_body);
            memset(H_world, 0, 3 * (size_t)n * sizeof *H_world);
            specimen_put_rows(H_body, n, &in_body.H);
            specimen_put_rows(H_world, n, &in_world.H);
            oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, n, n, 1, H_world, A, 0, HA);
            /* entries to 500 px a unit times 35 m, of which the world model takes differences */
            TEST_ASSERT_DOUBLE_WITHIN(2e5 * eps, 0, largest_difference(H_body, HA, 3 * n));
        }
        free(HA);
        free(H_world);
        free(H_body);
        free(A);
    }
}

static void test_the_gate_judges_alike(void) {
    static const float shift_px[4] = {2, -1, 0.5F, 1};
    for (int run = 0; run < RUNS; run++) {
        take_pair(run % 2);
        for (unsigned slot = 0; slot < LANDMARKS; slot++) {
            const plr_observation seen = specimen_observation(&body, slot, shift_px);
            const plr_verdict a = specimen_judge(&body, slot, &seen);
            const plr_verdict b = specimen_judge(&world, slot, &seen);
            /* the world's P holds terms a hundred times larger, which cancel in H P H^T */
            TEST_ASSERT_DOUBLE_WITHIN(1e-9 + 1e5 * eps, 1, (double)(b.d2 / a.d2));
        }
    }
}

static void test_how_the_pose_moves_a_point_agrees_with_differences(void) {
    textbook truth;
    specimen_filter(&body, &chance, PLR_MODEL_BODY, false, 0);
    twin_of_specimen(&truth, &body);
    for (int run = 0; run < RUNS; run++) {
        plr_real s_real[3], J[18];
        double s[3];
        rng_normals(&chance, 5, s, 3);
        to_reals(s_real, s, 3);
        to_doubles(s, s_real, 3);
        plr_world_by_pose(body.belief.R_WB, s_real, J);
        for (int j = 0; j < 6; j++) {
            const double h = 1e-6;
            double ends[2][3];
            for (int end = 0; end < 2; end++) {
                double xi[6] = {0}, E[16], T[16];
                xi[j] = end ? -h : h;
                rigid_exp(E, xi);
                square_multiply(4, truth.T_WB, E, T);
                rigid_apply(ends[end], T, s);
            }
            for (int i = 0; i < 3; i++)
                TEST_ASSERT_DOUBLE_WITHIN(1e-8 + 100 * eps, (ends[0][i] - ends[1][i]) / (2 * h),
                                          (double)J[6 * i + j]);
        }
    }
}
