// SPDX-License-Identifier: MIT
/* The polar chart: two bearing angles and inverse range (MATH 5). */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "state/polar.h"
#include "support/matrices.h"
#include "support/random.h"
#include "support/rigid.h"

enum { RUNS = 1000 };

#define MIN_INVERSE_RANGE PLR_R(1e-5) /* 100 km */

static const double eps = REAL_EPSILON;
static rng chance;

void setUp(void) {
    chance = rng_seeded(42);
}

static double norm(const double x[3]) {
    return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
}

/* A point anywhere around, r_m away; the poles and the seam z = 0 come up too. */
static void random_point(int run, double r_m, plr_real q[3], double exact[3]) {
    static const double special[6][3] = {{0, 0, 1},  {0, 0, -1},     {1, 0, 0},
                                         {0, -1, 0}, {1, 1, -1e-12}, {1, 1, 1e-12}};
    rng_normals(&chance, 1, exact, 3);
    if (run < 6)
        memcpy(exact, special[run], sizeof special[run]);
    const double scale = r_m / norm(exact);
    for (int i = 0; i < 3; i++)
        exact[i] *= scale;
    to_reals(q, exact, 3);
    to_doubles(exact, q, 3);
}

static double random_range(void) {
    return exp(rng_uniform(&chance, log(0.05), log(3000)));
}

/* Dot product of columns a and b of [N mu]. */
static double dot_of_columns(const plr_polar *chart, int a, int b) {
    double sum = 0;
    for (int i = 0; i < 3; i++)
        sum += (double)(a < 2 ? chart->N[a][i] : chart->mu[i]) *
               (double)(b < 2 ? chart->N[b][i] : chart->mu[i]);
    return sum;
}

static void test_bearing_and_basis_are_orthonormal(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_polar chart;
        plr_real q[3];
        double exact[3];
        random_point(run, random_range(), q, exact);
        plr_polar_at(&chart, q);
        TEST_ASSERT_DOUBLE_WITHIN(4 * eps * norm(exact), norm(exact), (double)chart.r);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                TEST_ASSERT_DOUBLE_WITHIN(8 * eps, a == b, dot_of_columns(&chart, a, b));
    }
}

static void test_basis_is_a_function_of_the_bearing_alone(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_polar near, far;
        plr_real q[3], q8[3];
        double exact[3];
        random_point(run, 3, q, exact);
        for (int i = 0; i < 3; i++)
            q8[i] = 8 * q[i]; /* exact: the bearing is the same to the bit */
        plr_polar_at(&near, q);
        plr_polar_at(&far, q8);
        TEST_ASSERT_TRUE(same_bits(near.mu, far.mu, 3));
        TEST_ASSERT_TRUE(same_bits(near.N[0], far.N[0], 6));
    }
}

static void test_from_point_and_to_point_are_inverse(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_polar chart;
        plr_real q[3], Jw[9], Ji[9];
        double exact[3];
        const double r = random_range();
        random_point(run, r, q, exact);
        plr_polar_at(&chart, q);
        plr_polar_from_point(Jw, &chart);
        plr_polar_to_point(Ji, &chart);
        /* a chart's errors have units: rad, rad, 1/m. In units of 1/r all are pure numbers. */
        const double unit[3] = {1, 1, 1 / r};
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                double sum = 0;
                for (int k = 0; k < 3; k++)
                    sum += (double)Jw[3 * i + k] * (double)Ji[3 * k + j];
                TEST_ASSERT_DOUBLE_WITHIN(30 * eps, i == j, sum * unit[j] / unit[i]);
            }
    }
}

/* The chart's coordinates of a point near its origin, in double: N^T (mu' - mu), 1/r' - 1/r. */
static void coordinates(const plr_polar *chart, const double q[3], double w[3]) {
    const double r = norm(q);
    w[0] = w[1] = 0;
    for (int i = 0; i < 3; i++) {
        w[0] += (double)chart->N[0][i] * q[i] / r;
        w[1] += (double)chart->N[1][i] * q[i] / r;
    }
    w[2] = 1 / r;
}

static void test_from_point_agrees_with_differences_of_the_coordinates(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_polar chart;
        plr_real q[3], Jw[9];
        double exact[3];
        const double r = random_range(), h = 1e-6 * r;
        random_point(run, r, q, exact);
        plr_polar_at(&chart, q);
        plr_polar_from_point(Jw, &chart);
        for (int j = 0; j < 3; j++) {
            double ahead[3], behind[3], w_ahead[3], w_behind[3];
            memcpy(ahead, exact, sizeof ahead);
            memcpy(behind, exact, sizeof behind);
            ahead[j] += h;
            behind[j] -= h;
            coordinates(&chart, ahead, w_ahead);
            coordinates(&chart, behind, w_behind);
            for (int i = 0; i < 3; i++) {
                const double size = i < 2 ? 1 / r : 1 / (r * r);
                TEST_ASSERT_DOUBLE_WITHIN(size * (1e-9 + 20 * eps),
                                          (w_ahead[i] - w_behind[i]) / (2 * h),
                                          (double)Jw[3 * i + j]);
            }
        }
    }
}

/* What the last retraction left beyond the farthest range. */
static plr_real beyond;

/* Retracts from q, and demands that the point goes where its chart goes. */
static bool retract_from(const plr_real q[3], plr_polar *moved, plr_real M[4],
                         const plr_polar *chart, const plr_real w[3]) {
    plr_real to[3];
    memcpy(to, q, sizeof to);
    beyond = PLR_R(7); /* it is set in any case */
    const bool cut = plr_polar_retract(moved, M, chart, w, MIN_INVERSE_RANGE, to, &beyond);
    for (int i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(8 * eps * (double)moved->r,
                                  (double)moved->r * (double)moved->mu[i], (double)to[i]);
    return cut;
}

static void test_retracting_nothing_moves_nothing(void) {
    const plr_real w[3] = {0, 0, 0};
    for (int run = 0; run < RUNS; run++) {
        plr_polar chart, moved;
        plr_real q[3], M[4];
        double exact[3];
        random_point(run, random_range(), q, exact);
        plr_polar_at(&chart, q);
        TEST_ASSERT_FALSE(retract_from(q, &moved, M, &chart, w));
        TEST_ASSERT_DOUBLE_WITHIN(4 * eps * (double)chart.r, (double)chart.r, (double)moved.r);
        for (int i = 0; i < 3; i++)
            TEST_ASSERT_DOUBLE_WITHIN(8 * eps, (double)chart.mu[i], (double)moved.mu[i]);
        for (int i = 0; i < 4; i++)
            TEST_ASSERT_DOUBLE_WITHIN(16 * eps, i % 3 == 0, (double)M[i]);
    }
}

/* q+ of the retraction in double, with the chart's own basis. */
static void retract(const plr_polar *chart, const double w[3], double q[3], double E[16]) {
    double along[3], turn[6] = {0};
    for (int i = 0; i < 3; i++)
        along[i] = (double)chart->N[0][i] * w[0] + (double)chart->N[1][i] * w[1];
    for (int i = 0; i < 3; i++)
        turn[3 + i] = (double)chart->mu[(i + 1) % 3] * along[(i + 2) % 3] -
                      (double)chart->mu[(i + 2) % 3] * along[(i + 1) % 3];
    rigid_exp(E, turn);
    const double r = 1 / (1 / (double)chart->r + w[2]);
    for (int i = 0; i < 3; i++) {
        q[i] = 0;
        for (int j = 0; j < 3; j++)
            q[i] += r * E[4 * i + j] * (double)chart->mu[j];
    }
}

static void test_retraction_follows_its_equations(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_polar chart, moved;
        plr_real q[3], M[4], w_real[3];
        double exact[3], expected[3], E[16], w[3];
        const double r = random_range();
        random_point(run, r, q, exact);
        plr_polar_at(&chart, q);
        w[0] = rng_uniform(&chance, -0.6, 0.6);
        w[1] = rng_uniform(&chance, -0.6, 0.6);
        w[2] = rng_uniform(&chance, -0.5, 1) / r;
        to_reals(w_real, w, 3);
        to_doubles(w, w_real, 3);
        if (r < 0.1)
            w[2] = (double)(w_real[2] = 0); /* so that no limit is met */
        retract(&chart, w, expected, E);
        TEST_ASSERT_FALSE(retract_from(q, &moved, M, &chart, w_real));
        const double r_moved = norm(expected);
        TEST_ASSERT_DOUBLE_WITHIN(10 * eps * r_moved, r_moved, (double)moved.r);
        for (int i = 0; i < 3; i++)
            TEST_ASSERT_DOUBLE_WITHIN(16 * eps, expected[i] / r_moved, (double)moved.mu[i]);

        /* M = N(mu+)^T Exp(a) N(mu) */
        for (int a = 0; a < 2; a++)
            for (int b = 0; b < 2; b++) {
                double sum = 0;
                for (int i = 0; i < 3; i++)
                    for (int j = 0; j < 3; j++)
                        sum += (double)moved.N[a][i] * E[4 * i + j] * (double)chart.N[b][j];
                TEST_ASSERT_DOUBLE_WITHIN(30 * eps, sum, (double)M[2 * a + b]);
            }
    }
}

static void test_transport_is_a_rotation_of_the_plane(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_polar chart, moved;
        plr_real q[3], M[4], w[3];
        double exact[3], w_double[3];
        random_point(run, random_range(), q, exact);
        plr_polar_at(&chart, q);
        rng_normals(&chance, 0.3, w_double, 2);
        w_double[2] = 0;
        to_reals(w, w_double, 3);
        (void)retract_from(q, &moved, M, &chart, w);
        const double m[4] = {(double)M[0], (double)M[1], (double)M[2], (double)M[3]};
        TEST_ASSERT_DOUBLE_WITHIN(30 * eps, 1, m[0] * m[0] + m[2] * m[2]);
        TEST_ASSERT_DOUBLE_WITHIN(30 * eps, 1, m[1] * m[1] + m[3] * m[3]);
        TEST_ASSERT_DOUBLE_WITHIN(30 * eps, 0, m[0] * m[1] + m[2] * m[3]);
        TEST_ASSERT_DOUBLE_WITHIN(30 * eps, 1, m[0] * m[3] - m[1] * m[2]);
    }
}

/* d retr(q, w) / dw at w = 0 is Ji(q): by differences of the double twin. */
static void test_retraction_starts_along_the_chart(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_polar chart;
        plr_real q[3], Ji[9];
        double exact[3];
        const double r = random_range();
        random_point(run, r, q, exact);
        plr_polar_at(&chart, q);
        plr_polar_to_point(Ji, &chart);
        for (int j = 0; j < 3; j++) {
            const double h = j < 2 ? 1e-6 : 1e-6 / r;
            double w[3] = {0}, ahead[3], behind[3], E[16];
            w[j] = h;
            retract(&chart, w, ahead, E);
            w[j] = -h;
            retract(&chart, w, behind, E);
            const double size = j < 2 ? r : r * r;
            for (int i = 0; i < 3; i++)
                TEST_ASSERT_DOUBLE_WITHIN(size * (1e-8 + 20 * eps),
                                          (ahead[i] - behind[i]) / (2 * h), (double)Ji[3 * i + j]);
        }
    }
}

/* ---------------------------------------------------------------- limits */

static void retract_at_10_m(const double w_double[3], plr_polar *chart, plr_polar *moved,
                            bool *cut) {
    static const plr_real q[3] = {PLR_R(6), PLR_R(0), PLR_R(8)};
    plr_real w[3], M[4];
    to_reals(w, w_double, 3);
    plr_polar_at(chart, q);
    *cut = retract_from(q, moved, M, chart, w);
}

static double angle_between(const plr_polar *a, const plr_polar *b) {
    double cross[3], dot = 0;
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        cross[i] = (double)a->mu[j] * (double)b->mu[k] - (double)a->mu[k] * (double)b->mu[j];
        dot += (double)a->mu[i] * (double)b->mu[i];
    }
    return atan2(norm(cross), dot);
}

/* A point that noise puts beyond infinity stands at the farthest range and remembers the rest: nothing
 * of the correction is lost, so that noise of the other sign brings it back to where it was. */
static void test_what_lies_beyond_the_farthest_range_is_kept(void) {
    const double w[3][3] = {{0, 0, -0.1}, {0, 0, -5}, {0.1, 0.1, -1e30}};
    for (int i = 0; i < 3; i++) {
        plr_polar chart, moved;
        bool cut;
        retract_at_10_m(w[i], &chart, &moved, &cut);
        TEST_ASSERT_FALSE(cut);
        TEST_ASSERT_DOUBLE_WITHIN(1e5 * 4 * eps, 1e5, (double)moved.r);
        const double left = 0.1 + w[i][2] - 1e-5;
        TEST_ASSERT_DOUBLE_WITHIN(4 * eps * (0.1 + fabs(w[i][2])), left, (double)beyond);
    }
}

static void test_a_range_that_can_be_had_leaves_nothing_beyond(void) {
    const double w[3][3] = {{0, 0, 0}, {0.1, -0.2, -0.0999}, {0, 0, 300}};
    for (int i = 0; i < 3; i++) {
        plr_polar chart, moved;
        bool cut;
        retract_at_10_m(w[i], &chart, &moved, &cut);
        TEST_ASSERT_EQUAL(i == 2, cut);
        TEST_ASSERT_EQUAL_DOUBLE(0, (double)beyond);
    }
}

/* There and back, in steps of any size through infinity: the sum of the inverse range and of what is
 * beyond is what the steps add up to. */
static void test_steps_through_infinity_and_back_lose_nothing(void) {
    plr_real q[3], M[4];
    double exact[3], expected = 0.001, size = expected;
    plr_polar chart, moved;
    random_point(9, 1000, q, exact);
    beyond = 0;
    for (int run = 0; run < RUNS; run++) {
        const double step = rng_normal(&chance) * 0.001 - 0.1 * (expected - 0.001);
        const plr_real w[3] = {0, 0, beyond + (plr_real)step};
        plr_polar_at(&chart, q);
        (void)plr_polar_retract(&moved, M, &chart, w, MIN_INVERSE_RANGE, q, &beyond);
        expected += (double)(plr_real)step;
        size += fabs(expected) + fabs(step);
        TEST_ASSERT_TRUE(beyond <= 0);
        TEST_ASSERT_TRUE(beyond >= 0 || (double)moved.r > 1e5 * (1 - 4 * eps));
        TEST_ASSERT_DOUBLE_WITHIN(2 * eps * size, expected, 1 / (double)moved.r + (double)beyond);
    }
}

static void test_a_range_below_a_centimetre_is_cut_there(void) {
    const double w[3] = {0, 0, 200};
    plr_polar chart, moved;
    bool cut;
    retract_at_10_m(w, &chart, &moved, &cut);
    TEST_ASSERT_TRUE(cut);
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * 4 * eps, 0.01, (double)moved.r);
}

static void test_a_bearing_turns_by_one_radian_at_most(void) {
    const double w[3] = {3, -4, 0};
    plr_polar chart, moved;
    bool cut;
    retract_at_10_m(w, &chart, &moved, &cut);
    TEST_ASSERT_TRUE(cut);
    TEST_ASSERT_DOUBLE_WITHIN(10 * eps, 1, angle_between(&chart, &moved));
    TEST_ASSERT_DOUBLE_WITHIN(100 * eps, 10, (double)moved.r);
}

static void test_corrections_within_the_limits_are_not_cut(void) {
    const double w[4][3] = {{0.7, 0.7, 0}, {0, 0, 89}, {0, 0, -0.0999}, {-0.5, 0.2, 1}};
    for (int i = 0; i < 4; i++) {
        plr_polar chart, moved;
        bool cut;
        retract_at_10_m(w[i], &chart, &moved, &cut);
        TEST_ASSERT_FALSE(cut);
    }
}

static void test_an_inverse_range_that_is_no_number_is_cut(void) {
    const double w[3] = {0, 0, (double)NAN};
    plr_polar chart, moved;
    bool cut;
    retract_at_10_m(w, &chart, &moved, &cut);
    TEST_ASSERT_TRUE(cut);
    TEST_ASSERT_TRUE(isfinite((double)moved.r));
    TEST_ASSERT_EQUAL_DOUBLE(0, (double)beyond);
}

/* A parked robot corrects by micrometres: what a step changes is rounded at the point's size, not the
 * point's direction and length each on its own. A step there and back is the same point but for one
 * rounding of it, and no step at all is no change of a bit. */
static void test_small_steps_are_rounded_once(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_polar chart, there, back;
        plr_real q[3], to[3], M[4], w[3], w_back[3], zero[3] = {0};
        double exact[3], small[3];
        random_point(run, rng_uniform(&chance, 2, 30), q, exact);
        plr_polar_at(&chart, q);
        memcpy(to, q, sizeof to);
        TEST_ASSERT_FALSE(
            plr_polar_retract(&there, M, &chart, zero, MIN_INVERSE_RANGE, to, &beyond));
        TEST_ASSERT_TRUE(same_bits(q, to, 3));

        rng_normals(&chance, 1e-6, small, 3);
        to_reals(w, small, 3);
        TEST_ASSERT_FALSE(plr_polar_retract(&there, M, &chart, w, MIN_INVERSE_RANGE, to, &beyond));
        for (int i = 0; i < 2; i++) /* -M w */
            w_back[i] = -(M[2 * i] * w[0] + M[2 * i + 1] * w[1]);
        w_back[2] = -w[2];
        TEST_ASSERT_FALSE(
            plr_polar_retract(&back, M, &there, w_back, MIN_INVERSE_RANGE, to, &beyond));
        const double most = largest((double[3]){(double)q[0], (double)q[1], (double)q[2]}, 3);
        for (int i = 0; i < 3; i++)
            TEST_ASSERT_DOUBLE_WITHIN(1.01 * eps * most + 1e-10, (double)q[i], (double)to[i]);
    }
}

/* Three kilometres away a point's range is uncertain by its own size: corrections of the range must
 * not shake its bearing, which holds the attitude. */
static void test_far_points_keep_their_bearing(void) {
    for (int run = 0; run < RUNS; run++) {
        plr_polar chart, moved;
        plr_real q[3], M[4], w[3] = {0};
        double exact[3];
        random_point(run, 3000, q, exact);
        plr_polar_at(&chart, q);
        w[2] = (plr_real)rng_uniform(&chance, -3.2e-4, 1e-2);
        (void)retract_from(q, &moved, M, &chart, w);
        TEST_ASSERT_DOUBLE_WITHIN(4 * eps, 0, angle_between(&chart, &moved));

        const plr_real turned[3] = {PLR_R(3e-5), PLR_R(-4e-5), w[2]};
        (void)retract_from(q, &moved, M, &chart, turned);
        TEST_ASSERT_DOUBLE_WITHIN(4 * eps, 5e-5, angle_between(&chart, &moved));
    }
}
