// SPDX-License-Identifier: MIT
/* The packed covariance against a dense matrix in double: update, and landmarks that come and go. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "math/packed.h"
#include "state/covariance.h"
#include "support/covariance_twin.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/specimens.h"

static const double eps = REAL_EPSILON;

void setUp(void) {
    twin.chance = rng_seeded(43);
}

static void random_rows(plr_rows *rows, bool uses_pose, double *H, unsigned slot) {
    double unused[18];
    memset(rows, 0, sizeof *rows);
    rows->terms = uses_pose ? 2 : 1;
    rows->term[0].row = plr_covariance_row(&twin.filter.belief, slot);
    rows->term[0].columns = 3;
    rows->term[1].columns = 6;
    twin_random(rows->term[1].H, unused, 18);
    twin_random(rows->term[0].H, unused, 9);
    memset(H, 0, 3 * (size_t)twin.n * sizeof *H);
    specimen_put_rows(H, twin.n, rows);
}

static void check_innovation(void) {
    double *H = specimen_zeros(3, twin.n);
    for (unsigned slot = 0; slot < twin.filter.belief.count; slot++)
        for (int uses_pose = 0; uses_pose < 2; uses_pose++) {
            plr_rows rows_of_H;
            plr_real S[9];
            double dense[9], got[9];
            random_rows(&rows_of_H, uses_pose, H, slot);
            oracle_sandwich(3, twin.n, H, twin.P, dense);
            plr_covariance_of_rows(&twin.filter.belief, &rows_of_H, S);
            to_doubles(got, S, 9);
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(100 * eps, 0, specimen_gap(3, dense, got), twin.at);
        }
    free(H);
}

static void test_innovation_covariance_agrees(void) {
    twin_for_each_size(check_innovation);
}

static void check_project(void) {
    const unsigned ld = plr_covariance_ld(&twin.filter.belief);
    double *H = specimen_zeros(3, twin.n), *HP = specimen_zeros(3, twin.n);
    for (unsigned slot = 0; slot < twin.filter.belief.count; slot++)
        for (int uses_pose = 0; uses_pose < 2; uses_pose++) {
            plr_rows rows_of_H;
            plr_real *rows = twin.filter.work.Vt;
            random_rows(&rows_of_H, uses_pose, H, slot);
            oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, twin.n, twin.n, 1, H, twin.P, 0, HP);
            plr_covariance_project(&twin.filter.belief, &rows_of_H, rows, ld);
            for (unsigned r = 0; r < 3; r++) {
                double scale = 0;
                for (unsigned j = 0; j < twin.n; j++)
                    scale += fabs(H[r * twin.n + j]) * sqrt(twin.P[j * twin.n + j]);
                for (unsigned i = 0; i < twin.n; i++)
                    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(
                        30 * eps * scale * sqrt(twin.P[i * twin.n + i]), HP[r * twin.n + i],
                        (double)rows[r * ld + i], twin.at);
            }
        }
    free(HP);
    free(H);
}

static void test_projection_on_an_observation_agrees(void) {
    twin_for_each_size(check_project);
}

/* Fills V^T with rows of which each takes `share` of every variance. */
static void fill_rows(unsigned depth, double share, double *Vt) {
    const unsigned ld = plr_covariance_ld(&twin.filter.belief);
    memset(twin.filter.work.Vt, 0, (size_t)depth * ld * sizeof *twin.filter.work.Vt);
    for (unsigned k = 0; k < depth; k++)
        for (unsigned i = 0; i < twin.n; i++) {
            const double sign = rng_below(&twin.chance, 2) ? 1 : -1;
            const plr_real v = (plr_real)(sign * sqrt(share * twin.P[i * twin.n + i]));
            twin.filter.work.Vt[k * ld + i] = v;
            Vt[k * twin.n + i] = (double)v;
        }
}

static void check_subtract(void) {
    double *Vt = specimen_zeros(PLR_BLOCK_ROWS, twin.n);
    for (unsigned depth = 1; depth <= PLR_BLOCK_ROWS; depth += 11) {
        pack_lower(twin.filter.belief.P, twin.P, twin.n);
        fill_rows(depth, 0.9 / depth, Vt);
        memcpy(twin.expected, twin.P, (size_t)twin.n * twin.n * sizeof *twin.P);
        oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, twin.n, twin.n, depth, -1, Vt, Vt, 1,
                    twin.expected);
        TEST_ASSERT_TRUE_MESSAGE(
            plr_covariance_subtract(&twin.filter.belief, twin.filter.work.Vt, depth), twin.at);
        double *got = specimen_covariance(&twin.filter);
        /* against P before: a tenth of the variance is left */
        for (unsigned i = 0; i < twin.n; i++)
            for (unsigned j = 0; j < twin.n; j++)
                TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(
                    30 * eps * sqrt(twin.P[i * twin.n + i] * twin.P[j * twin.n + j]),
                    twin.expected[i * twin.n + j], got[i * twin.n + j], twin.at);
        free(got);
    }
    free(Vt);
}

static void test_subtraction_agrees(void) {
    twin_for_each_size(check_subtract);
}

static void check_subtract_refuses(void) {
    double *Vt = specimen_zeros(3, twin.n);
    plr_real *before = malloc(plr_packed_row(twin.n) * sizeof *before);
    TEST_ASSERT_NOT_NULL(before);
    memcpy(before, twin.filter.belief.P, plr_packed_row(twin.n) * sizeof *before);
    const unsigned ld = plr_covariance_ld(&twin.filter.belief);
    for (unsigned i = 0; i < twin.n; i++) {
        fill_rows(3, 0.1, Vt);
        twin.filter.work.Vt[2 * ld + i] = (plr_real)sqrt(0.81 * twin.P[i * twin.n + i]);
        TEST_ASSERT_FALSE_MESSAGE(
            plr_covariance_subtract(&twin.filter.belief, twin.filter.work.Vt, 3), twin.at);
        twin.filter.work.Vt[2 * ld + i] = (plr_real)NAN;
        TEST_ASSERT_FALSE_MESSAGE(
            plr_covariance_subtract(&twin.filter.belief, twin.filter.work.Vt, 3), twin.at);
    }
    TEST_ASSERT_TRUE_MESSAGE(same_bits(before, twin.filter.belief.P, plr_packed_row(twin.n)),
                             twin.at);
    free(before);
    free(Vt);
}

static void test_subtraction_that_would_lose_a_variance_changes_nothing(void) {
    twin_for_each_size(check_subtract_refuses);
}

static void check_subtract_exact_pose(void) {
    double *Vt = specimen_zeros(3, twin.n);
    for (unsigned i = 0; i < 6; i++)
        for (unsigned j = 0; j < twin.n; j++)
            twin.filter.belief.P[plr_packed_at(i, j)] = 0;
    fill_rows(3, 0.2, Vt);
    for (unsigned k = 0; k < 3; k++)
        memset(twin.filter.work.Vt + k * plr_covariance_ld(&twin.filter.belief), 0,
               6 * sizeof(plr_real));
    TEST_ASSERT_TRUE_MESSAGE(plr_covariance_subtract(&twin.filter.belief, twin.filter.work.Vt, 3),
                             twin.at);
    TEST_ASSERT_TRUE(plr_covariance_is_positive(&twin.filter.belief));
    free(Vt);
}

static void test_a_variance_of_zero_may_stay_zero(void) {
    twin_for_each_size(check_subtract_exact_pose);
}

/* ---------------------------------------------------------------- slots */

static void check_append(void) {
    for (int uses_pose = 0; uses_pose < 2; uses_pose++) {
        plr_new_landmark landmark = {.uses_pose = uses_pose};
        double pose[18], own[9], *J = specimen_zeros(twin.n + 3, twin.n);
        twin_random(landmark.J_pose, pose, 18);
        random_spd(&twin.chance, 3, 0.1, own);
        to_reals(landmark.P, own, 9);
        for (unsigned i = 0; i < twin.n; i++)
            J[i * twin.n + i] = 1;
        if (uses_pose)
            specimen_put(J, twin.n, twin.n, 0, 3, 6, pose);
        double *grown = specimen_zeros(twin.n + 3, twin.n + 3);
        oracle_sandwich(twin.n + 3, twin.n, J, twin.P, grown);
        for (unsigned i = 0; i < 9; i++)
            grown[(twin.n + i / 3) * (twin.n + 3) + twin.n + i % 3] += own[i];
        plr_covariance_append(&twin.filter.belief, &landmark);
        twin.filter.belief.count++;
        double *got = specimen_covariance(&twin.filter);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(100 * eps, 0, specimen_gap(twin.n + 3, grown, got),
                                          twin.at);
        twin.filter.belief.count--;
        free(got);
        free(grown);
        free(J);
    }
}

static void test_a_new_landmark_appends_its_rows(void) {
    twin_for_each_size(check_append);
}

static void check_remove(void) {
    const unsigned count = twin.filter.belief.count;
    for (unsigned slot = 0; slot < count; slot++) {
        pack_lower(twin.filter.belief.P, twin.P, twin.n);
        const unsigned to = plr_covariance_row(&twin.filter.belief, slot);
        plr_covariance_remove(&twin.filter.belief, slot);
        twin.filter.belief.count--;
        /* the last landmark's rows stand where the removed one's stood */
        for (unsigned i = 0; i < twin.n - 3; i++)
            for (unsigned j = 0; j <= i; j++) {
                const unsigned a = i >= to && i < to + 3 ? twin.n - 3 + (i - to) : i;
                const unsigned b = j >= to && j < to + 3 ? twin.n - 3 + (j - to) : j;
                TEST_ASSERT_EQUAL_DOUBLE(twin.P[a * twin.n + b],
                                         (double)twin.filter.belief.P[plr_packed_at(i, j)]);
            }
        twin.filter.belief.count++;
    }
}

static void test_removal_moves_the_last_landmark_bit_for_bit(void) {
    twin_for_each_size(check_remove);
}
