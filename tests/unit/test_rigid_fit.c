// SPDX-License-Identifier: MIT
/* The rigid motion that corrections have in common. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "state/rigid_fit.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/random.h"

enum { RUNS = 200, MOST = 12 };

static const plr_real W[3] = {1, 1, PLR_R(0.04)};
/* Of the motion that the landmarks may share: anything, or close to nothing. */
static const plr_real free_motion[6] = {PLR_R(1e9), PLR_R(1e9), PLR_R(1e9),
                                        PLR_R(1e9), PLR_R(1e9), PLR_R(1e9)},
                      no_motion[6];
static const plr_real noise = PLR_R(1e-4); /* of w, squared */
static rng chance;

void setUp(void) {
    chance = rng_seeded(61);
}

static void draw(plr_real *x, double *same, size_t n, double sigma) {
    rng_normals(&chance, sigma, same, n);
    to_reals(x, same, n);
    to_doubles(same, x, n);
}

/* What the corrections scatter by about the motion that fits them best, residual by residual. */
static double scatter_twin(unsigned count, double (*J)[18], double (*w)[3], const double *A,
                           const double *b) {
    double M[36], motion[6], sum = 0, ridge = 0;
    memcpy(M, A, sizeof M);
    memcpy(motion, b, sizeof motion);
    for (unsigned k = 0; k < 6; k++)
        M[7 * k] += 1e-5 * M[7 * k] + 1e-12;
    if (count < 3 || !oracle_solve_spd(6, 1, M, motion))
        return (double)noise;
    for (unsigned i = 0; i < count; i++)
        for (unsigned row = 0; row < 3; row++) {
            double left = w[i][row];
            for (unsigned k = 0; k < 6; k++)
                left -= J[i][6 * row + k] * motion[k];
            sum += (double)W[row] * left * left;
        }
    for (unsigned k = 0; k < 6; k++)
        ridge += (1e-5 * A[7 * k] + 1e-12) * motion[k] * motion[k];
    return fmin((double)noise, (sum + ridge) / (3 * count - 6));
}

/* The normal equations in double. */
static void solve_twin(unsigned count, double (*J)[18], double (*w)[3], const double *xi,
                       const double *spread, double *eta) {
    double A[36] = {0}, b[6] = {0};
    for (unsigned i = 0; i < count; i++)
        for (unsigned row = 0; row < 3; row++)
            for (unsigned k = 0; k < 6; k++) {
                const double weighted = (double)W[row] * J[i][6 * row + k];
                b[k] += weighted * w[i][row];
                for (unsigned l = 0; l < 6; l++)
                    A[6 * k + l] += weighted * J[i][6 * row + l];
            }
    const double left = scatter_twin(count, J, w, A, b);
    for (unsigned k = 0; k < 6; k++) {
        const double weight = 0.1 * A[7 * k] + 1e-12;
        eta[k] = b[k] + weight * xi[k];
        A[7 * k] += weight + left / (spread[k] + 1e-20);
    }
    TEST_ASSERT_TRUE(oracle_solve_spd(6, 1, A, eta));
}

static void test_it_solves_the_normal_equations(void) {
    for (int run = 0; run < RUNS; run++) {
        const unsigned count = 1 + rng_below(&chance, MOST);
        double J[MOST][18], w[MOST][3], xi[6], spread[6], expected[6], got[6];
        plr_real J_real[18], w_real[3], xi_real[6], spread_real[6], eta[6];
        plr_rigid_fit fit;
        memset(&fit, 0, sizeof fit);
        for (unsigned i = 0; i < count; i++) {
            draw(J_real, J[i], 18, 1);
            draw(w_real, w[i], 3, run % 2 ? 0.1 : 0.005); /* more and less than the noise */
            plr_rigid_fit_add(&fit, J_real, w_real, W);
        }
        draw(xi_real, xi, 6, 0.1);
        for (int k = 0; k < 6; k++) {
            spread_real[k] = PLR_R(1e-4) * (plr_real)rng_below(&chance, 10);
            spread[k] = (double)spread_real[k];
        }
        plr_rigid_fit_solve(&fit, xi_real, spread_real, noise, eta);
        solve_twin(count, J, w, xi, spread, expected);
        to_doubles(got, eta, 6);
        /* A tenth of the diagonal on top keeps the condition below some hundreds. */
        TEST_ASSERT_DOUBLE_WITHIN(3000 * REAL_EPSILON, 0, largest_difference(expected, got, 6));
    }
}

static void check_common_motion(const plr_real spread[6], double tolerance) {
    for (int run = 0; run < RUNS; run++) {
        plr_real xi[6], eta[6];
        double same[6], got[6];
        plr_rigid_fit fit;
        memset(&fit, 0, sizeof fit);
        draw(xi, same, 6, 0.1);
        for (unsigned i = 0; i < MOST; i++) {
            plr_real J[18], w[3] = {0};
            double ignored[18];
            draw(J, ignored, 18, 1);
            for (unsigned row = 0; row < 3; row++)
                for (unsigned k = 0; k < 6; k++)
                    w[row] += J[6 * row + k] * xi[k];
            plr_rigid_fit_add(&fit, J, w, W);
        }
        plr_rigid_fit_solve(&fit, xi, spread, noise, eta);
        to_doubles(got, eta, 6);
        TEST_ASSERT_DOUBLE_WITHIN(tolerance, 0, largest_difference(same, got, 6));
    }
}

static void test_what_all_have_in_common_with_the_pose_is_found_exactly(void) {
    check_common_motion(free_motion, 1000 * REAL_EPSILON);
}

/* A robot that stands: what all correct together is mostly of earlier frames, and ten times what this
 * frame's motion may have been. They are of one mind, so it is no less rigid. */
static void test_it_is_found_where_this_frames_motion_alone_cannot_explain_it(void) {
    const plr_real spread[6] = {PLR_R(1e-4), PLR_R(1e-4), PLR_R(1e-4),
                                PLR_R(1e-4), PLR_R(1e-4), PLR_R(1e-4)};
    check_common_motion(spread, 1e-3);
}

/* A correction of the way here: the pose moves by metres, no landmark in the camera. */
static void test_landmarks_that_stay_outvote_the_pose(void) {
    const plr_real xi[6] = {3, -2, 1, PLR_R(0.1), PLR_R(-0.2), PLR_R(0.3)}, still[3] = {0};
    plr_real eta[6];
    plr_rigid_fit fit;
    memset(&fit, 0, sizeof fit);
    for (unsigned i = 0; i < 200; i++) {
        plr_real J[18];
        double ignored[18];
        draw(J, ignored, 18, 1);
        plr_rigid_fit_add(&fit, J, still, W);
    }
    plr_rigid_fit_solve(&fit, xi, free_motion, noise, eta);
    /* eta = (A + 0.1 diag A)^-1 0.1 diag A xi, and A is nearly diagonal */
    for (int k = 0; k < 6; k++)
        TEST_ASSERT_DOUBLE_WITHIN(0.2, 0, (double)eta[k] / 3);
}

/* Points so far away that a pixel's noise looks like metres: how far the body may have moved is known
 * better than that. */
static void test_far_points_do_not_move_further_together_than_the_body_may_have_moved(void) {
    const plr_real xi[6] = {0}, narrow[6] = {PLR_R(1e-6), PLR_R(1e-6), PLR_R(1e-6),
                                             PLR_R(1e-6), PLR_R(1e-6), PLR_R(1e-6)};
    double longest = 0;
    for (int limited = 0; limited < 2; limited++) {
        plr_real eta[6];
        plr_rigid_fit fit;
        memset(&fit, 0, sizeof fit);
        for (unsigned i = 0; i < 20; i++) {
            plr_real J[18] = {0}, w[3];
            double ignored[6];
            draw(J, ignored, 3, 0.005); /* inverse ranges */
            draw(J + 6, ignored, 3, 0.005);
            draw(J + 3, ignored, 3, 1);
            draw(J + 9, ignored, 3, 1);
            draw(w, ignored, 3, 0.01);
            plr_rigid_fit_add(&fit, J, w, W);
        }
        plr_rigid_fit_solve(&fit, xi, limited ? narrow : free_motion, noise, eta);
        const double way = sqrt((double)(eta[0] * eta[0] + eta[1] * eta[1] + eta[2] * eta[2]));
        if (limited)
            TEST_ASSERT_LESS_THAN_DOUBLE(1e-3, way); /* its sigma */
        else
            longest = way;
    }
    TEST_ASSERT_GREATER_THAN_DOUBLE(0.1, longest);
}

static void test_without_landmarks_and_after_an_accident_it_is_the_pose(void) {
    const plr_real xi[6] = {1, 2, 3, PLR_R(0.1), PLR_R(0.2), PLR_R(0.3)};
    plr_real eta[6], J[18] = {0};
    plr_rigid_fit fit;
    memset(&fit, 0, sizeof fit);
    plr_rigid_fit_solve(&fit, xi, no_motion, noise, eta);
    for (int k = 0; k < 6; k++)
        TEST_ASSERT_DOUBLE_WITHIN(10 * REAL_EPSILON, (double)xi[k], (double)eta[k]);

    const plr_real huge[3] = {PLR_R(1e6), 0, 0}, nothing[3] = {(plr_real)NAN, 0, 0};
    J[3] = J[10] = J[17] = 1;
    memset(&fit, 0, sizeof fit);
    plr_rigid_fit_add(&fit, J, huge, W);
    plr_rigid_fit_solve(&fit, xi, free_motion, noise, eta);
    TEST_ASSERT_TRUE(same_bits(xi, eta, 6));
    memset(&fit, 0, sizeof fit);
    plr_rigid_fit_add(&fit, J, nothing, W);
    plr_rigid_fit_solve(&fit, xi, free_motion, noise, eta);
    TEST_ASSERT_TRUE(same_bits(xi, eta, 6));
}
