// SPDX-License-Identifier: MIT
/* Accelerometer, gyro and camera say nothing of position and of the angle about the vertical, and
 * everything of the rest. So must the filter believe, whose estimates jump with each frame: its own
 * derivatives, taken at other estimates each time, must leave these four directions alone. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "state/covariance.h"
#include "support/imu_rig.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/rigid.h"
#include "support/specimens.h"

enum {
    FRAMES = 18,
    POINTS = 8,
    CORE = PLR_CORE_DIM,
    DRIVER = PLR_DRIVERS,
    THETA = 3,
    VELOCITY = 6
};
enum { STATE = CORE + 3 * POINTS, ROWS = 3 * POINTS };

static const double eps = REAL_EPSILON;
static plr_filter other;

void setUp(void) {
    imu_rig_set_up();
}

/* ---------------------------------------------------------------- what a frame applied */

typedef struct stretch {
    double D[16], B[6 * DRIVER], V[3 * DRIVER]; /* of the filter, before the frame applies it */
    double xi[6];                               /* how the frame corrected the pose */
    unsigned count;
    uint32_t id[PLR_MAX_LANDMARKS];
    double q[PLR_MAX_LANDMARKS][3]; /* the estimates after the frame, in the camera */
} stretch;

static stretch flown[FRAMES];

static void note_points(stretch *s) {
    const plr_filter *f = &imu_rig.filter;
    s->count = f->belief.count;
    for (unsigned slot = 0; slot < f->belief.count; slot++) {
        s->id[slot] = f->belief.slots[slot].id;
        to_doubles(s->q[slot], f->belief.slots[slot].x, 3);
    }
}

static void pose_now(double T[16]) {
    const plr_pose pose = pose_of(&imu_rig.filter);
    rigid_from_pose(T, &pose);
}

static void fly_and_note(stretch *s) {
    const plr_filter *f = &imu_rig.filter;
    double before[16], after[16], back[16], jump[16];
    imu_rig_readings(IMU_RIG_EVERY);
    memset(s->D, 0, sizeof s->D);
    for (int i = 0; i < 3; i++) {
        s->D[4 * i + 3] = (double)f->motion.p[i];
        for (int j = 0; j < 3; j++)
            s->D[4 * i + j] = (double)f->motion.E[3 * i + j] + (i == j);
    }
    s->D[15] = 1;
    to_doubles(s->B, f->motion.B, 6 * DRIVER);
    to_doubles(s->V, f->motion.core.V, 3 * DRIVER);
    pose_now(before);
    imu_rig_frame();
    pose_now(after);
    rigid_inverse(back, before);
    square_multiply(4, back, after, jump);
    rigid_log(s->xi, jump);
    note_points(s);
}

/* ---------------------------------------------------------------- the observability matrix */

/* The estimate of a point after a frame; NULL if the filter has it no more. */
static const double *find(const stretch *s, uint32_t id) {
    for (unsigned i = 0; i < s->count; i++)
        if (s->id[i] == id)
            return s->q[i];
    return NULL;
}

/* Ids that the filter kept all the time. */
static unsigned kept_points(uint32_t id[POINTS]) {
    unsigned count = 0;
    for (unsigned i = 0; i < flown[0].count && count < POINTS; i++) {
        bool always = true;
        for (unsigned k = 1; k < FRAMES; k++)
            always = always && find(&flown[k], flown[0].id[i]) != NULL;
        if (always)
            id[count++] = flown[0].id[i];
    }
    return count;
}

/* Phi of the stretch before frame k, and the points as it predicts them. */
static void transition(const stretch *s, const stretch *last, const uint32_t id[POINTS],
                       double *Phi, double q[POINTS][3]) {
    double back[16], Ad[36], T_CB[16], T_BC[16], X[16], D_C[16], back_C[16], R[9], Ad_CB[36];
    memset(Phi, 0, STATE * STATE * sizeof *Phi);
    rigid_inverse(back, s->D);
    rigid_adjoint(Ad, back);
    specimen_put(Phi, STATE, 0, 0, 6, 6, Ad);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < DRIVER; j++)
            Phi[STATE * i + THETA + j] += s->B[DRIVER * i + j];
    specimen_put(Phi, STATE, VELOCITY, THETA, 3, DRIVER, s->V);
    for (int i = CORE - 6; i < CORE; i++)
        Phi[(STATE + 1) * i] = 1;
    rigid_from_pose(T_CB, &imu_rig.flight.calibration.T_CB);
    rigid_adjoint(Ad_CB, T_CB);
    rigid_inverse(T_BC, T_CB);
    square_multiply(4, T_CB, s->D, X);
    square_multiply(4, X, T_BC, D_C);
    rigid_inverse(back_C, D_C);
    rigid_rotation(R, back_C);
    for (unsigned p = 0; p < POINTS; p++) {
        rigid_apply(q[p], back_C, find(last, id[p]));
        const double *x = q[p];
        const double M[18] = {-1,   0, 0,     0, -x[2], x[1], 0,     -1,   0,
                              x[2], 0, -x[0], 0, 0,     -1,   -x[1], x[0], 0};
        double K[18], KB[3 * DRIVER];
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 6, 1, M, Ad_CB, 0, K);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, DRIVER, 6, 1, K, s->B, 0, KB);
        specimen_put(Phi, STATE, CORE + 3 * p, THETA, 3, DRIVER, KB);
        specimen_put(Phi, STATE, CORE + 3 * p, CORE + 3 * p, 3, 3, R);
    }
}

/* d(uL, uR, v) of all points, in pixels. */
static void observe(const double q[POINTS][3], double *H) {
    const plr_calibration *c = &imu_rig.flight.calibration;
    memset(H, 0, ROWS * STATE * sizeof *H);
    for (unsigned p = 0; p < POINTS; p++) {
        const double x = q[p][0], y = q[p][1], z = q[p][2];
        const double D[9] = {c->fx_px / z,
                             0,
                             -c->fx_px * x / (z * z),
                             c->fx_px / z,
                             0,
                             -c->fx_px * (x - c->baseline_m) / (z * z),
                             0,
                             c->fy_px / z,
                             -c->fy_px * y / (z * z)};
        specimen_put(H, STATE, 3 * p, CORE + 3 * p, 3, 3, D);
    }
}

/* After the correction xi: the pose's error in the new estimate's axes. */
static void correct(const double xi[6], double *total) {
    double E[16], back[16], Ad[36], turned[6 * STATE];
    rigid_exp(E, xi);
    rigid_inverse(back, E);
    rigid_adjoint(Ad, back);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, STATE, 6, 1, Ad, total, 0, turned);
    memcpy(total, turned, sizeof turned);
}

/* O, FRAMES ROWS x STATE: what all pictures after the first say of the state at the first. */
static void observability(const uint32_t id[POINTS], double *O) {
    static double Phi[STATE * STATE], total[STATE * STATE], next[STATE * STATE], H[ROWS * STATE];
    double q[POINTS][3];
    memset(total, 0, sizeof total);
    for (unsigned i = 0; i < STATE; i++)
        total[(STATE + 1) * i] = 1;
    for (unsigned p = 0; p < POINTS; p++)
        memcpy(q[p], find(&flown[0], id[p]), sizeof q[p]);
    for (unsigned k = 0; k < FRAMES; k++) {
        if (k > 0) {
            transition(&flown[k], &flown[k - 1], id, Phi, q);
            square_multiply(STATE, Phi, total, next);
            memcpy(total, next, sizeof total);
        }
        observe((const double(*)[3])q, H);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, ROWS, STATE, STATE, 1, H, total, 0,
                    O + (size_t)k * ROWS * STATE);
        if (k > 0)
            correct(flown[k].xi, total);
    }
}

/* ---------------------------------------------------------------- tests of O */

static double O[FRAMES * ROWS * STATE];

/* The filter starts on the way, with tilt and velocity unknown, so that its first frames turn it by
 * some degrees. Returns R^T e_z at the first of them. */
static void fly_with_jumps(double up[3]) {
    uint32_t id[POINTS];
    double T[16], turned = 0;
    imu_rig_begin(IMU_RIG_IN_MOTION, 5);
    imu_rig_readings(2 * IMU_RIG_EVERY);
    imu_rig_frame();
    note_points(&flown[0]);
    pose_now(T);
    for (int i = 0; i < 3; i++)
        up[i] = T[8 + i];
    for (unsigned k = 1; k < FRAMES; k++) {
        fly_and_note(&flown[k]);
        turned += fabs(flown[k].xi[3]) + fabs(flown[k].xi[4]) + fabs(flown[k].xi[5]);
    }
    TEST_ASSERT_TRUE(turned > 0.03);
    TEST_ASSERT_EQUAL_UINT(POINTS, kept_points(id));
    observability(id, O);
}

/* In units that are about as large as what a filter knows, so that numbers can be compared. */
static double unit_of(unsigned column) {
    static const double of[5] = {1, 0.01, 0.1, 0.1, 0.01};
    return column < CORE ? of[column / 3] : 0.1;
}

static void test_position_and_yaw_are_not_observed(void) {
    double up[3], most = 0, tilt = 0;
    fly_with_jumps(up);
    for (unsigned r = 0; r < FRAMES * ROWS; r++) {
        const double *row = O + (size_t)r * STATE;
        double yaw = 0;
        for (unsigned i = 0; i < 3; i++) {
            TEST_ASSERT_TRUE(fabs(row[i]) <= 0);
            yaw += row[THETA + i] * up[i];
            tilt = fmax(tilt, fabs(row[THETA + i]));
        }
        most = fmax(most, fabs(yaw));
    }
    TEST_ASSERT_TRUE(tilt > 1000); /* px in a rad: it is not that nothing is seen */
    TEST_ASSERT_DOUBLE_WITHIN(200 * eps * tilt, 0, most);
}

static void test_all_else_is_observed(void) {
    static double S[STATE * STATE], values[STATE];
    double up[3];
    fly_with_jumps(up);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, STATE, STATE, FRAMES * ROWS, 1, O, O, 0, S);
    for (unsigned i = 0; i < STATE; i++)
        for (unsigned j = 0; j < STATE; j++)
            S[STATE * i + j] *= unit_of(i) * unit_of(j);
    oracle_eigenvalues(STATE, S, values);
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, 0, values[3]); /* four directions, and no more */
    TEST_ASSERT_TRUE_MESSAGE(values[4] > 1e-3, "a fifth direction is not observed");
    for (unsigned i = 0; i < 3; i++) {
        S[(STATE + 1) * i] += 1;
        for (unsigned j = 0; j < 3; j++)
            S[STATE * (THETA + i) + THETA + j] += up[i] * up[j];
    }
    TEST_ASSERT_TRUE(oracle_smallest_eigenvalue(STATE, S) > 1e-3);
}

/* ---------------------------------------------------------------- tests of the whole filter */

/* Sigma of a row of the state. */
static double sigma_of(const plr_filter *f, unsigned row) {
    const size_t diagonal = (size_t)row * (row + 1) / 2 + row;
    return sqrt((double)f->belief.P[diagonal]);
}

/* `other` and the rig's filter agree, but for the pose: differences in sigmas, which are small numbers of
 * roundings of much larger ones. */
static void demand_agreement(void) {
    const plr_filter *f = &imu_rig.filter;
    const double near = 1e5 * eps;
    TEST_ASSERT_EQUAL_UINT(f->belief.count, other.belief.count);
    TEST_ASSERT_GREATER_THAN_UINT(10, f->belief.count);
    for (unsigned i = 0; i < 9; i++) {
        const double own = i < 3 ? (double)f->belief.velocity[i] : (double)f->belief.bias[i - 3];
        const double its =
            i < 3 ? (double)other.belief.velocity[i] : (double)other.belief.bias[i - 3];
        const double sigma = sigma_of(f, VELOCITY + i);
        TEST_ASSERT_DOUBLE_WITHIN(near * sigma, own, its);
        TEST_ASSERT_DOUBLE_WITHIN(near * sigma, sigma, sigma_of(&other, VELOCITY + i));
    }
    for (unsigned slot = 0; slot < f->belief.count; slot++) {
        TEST_ASSERT_EQUAL_UINT32(f->belief.slots[slot].id, other.belief.slots[slot].id);
        const double range =
            hypot(hypot((double)f->belief.slots[slot].x[0], (double)f->belief.slots[slot].x[1]),
                  (double)f->belief.slots[slot].x[2]);
        for (unsigned i = 0; i < 3; i++) {
            const unsigned row = plr_covariance_row(&f->belief, slot) + i;
            TEST_ASSERT_DOUBLE_WITHIN(near * range * 0.01, (double)f->belief.slots[slot].x[i],
                                      (double)other.belief.slots[slot].x[i]);
            TEST_ASSERT_DOUBLE_WITHIN(near * sigma_of(f, row), sigma_of(f, row),
                                      sigma_of(&other, row));
        }
    }
}

/* A given start, for the rig's filter with covariance P; for `other` from G T with covariance P_other. */
static void begin_both(const double G[16], const double P[36], const double P_other[36]) {
    static const double variance[3] = {0.01, 0.01, 0.01};
    double T[16], v[3], moved[16];
    plr_pose pose;
    imu_rig_begin(IMU_RIG_GIVEN, 9);
    imu_flight_truth(&imu_rig.flight, T, v);
    rigid_to_pose(&pose, T);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_set_pose(&imu_rig.filter, imu_rig.flight.t_ns, &pose, P));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(&imu_rig.filter, v, variance));
    TEST_ASSERT_EQUAL_INT(
        PLR_OK, plr_filter_init(&other, &imu_rig.flight.calibration, &imu_rig.config, NULL));
    square_multiply(4, G, T, moved);
    rigid_to_pose(&pose, moved);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&other, imu_rig.flight.t_ns, &pose, P_other));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_velocity(&other, v, variance));
}

static void fly_both(unsigned frames) {
    for (unsigned k = 1; k <= frames * IMU_RIG_EVERY; k++) {
        const plr_imu imu = imu_rig_read();
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_inertial(&other, imu_rig.flight.t_ns, &imu));
        if (k % IMU_RIG_EVERY != 0)
            continue;
        const plr_frame frame = imu_flight_look(&imu_rig.flight);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&imu_rig.filter, &frame, NULL));
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&other, &frame, NULL));
    }
}

static void some_tilt(double P[36]) {
    memset(P, 0, 36 * sizeof *P);
    for (unsigned i = 0; i < 6; i++)
        P[7 * i] = i < 3 ? 1e-4 : 1e-3;
}

static void
test_a_world_that_is_turned_about_the_vertical_and_shifted_changes_the_pose_alone(void) {
    const double G[16] = {cos(2), -sin(2), 0, 30, sin(2), cos(2), 0, -50, 0, 0, 1, 7, 0, 0, 0, 1};
    double P[36], A[16], B[16], GA[16];
    some_tilt(P);
    begin_both(G, P, P);
    fly_both(40);
    demand_agreement();
    const plr_pose a = pose_of(&imu_rig.filter);
    const plr_pose b = pose_of(&other);
    rigid_from_pose(A, &a);
    rigid_from_pose(B, &b);
    square_multiply(4, G, A, GA);
    TEST_ASSERT_DOUBLE_WITHIN(1e4 * eps, 0, largest_difference(GA, B, 16));
}

/* What is believed of position and yaw at the start is believed of them for ever, and of nothing
 * else. */
static void test_uncertainty_of_position_and_yaw_touches_nothing_else_and_never_shrinks(void) {
    static const double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    double P[36], wide[36], more[36] = {0}, start[16], now[16], back[16], between[16];
    double Ad[36], carried[36], P_own[36], P_other[36];
    some_tilt(P);
    memcpy(wide, P, sizeof wide);
    begin_both(identity, P, P);
    pose_now(start);
    for (int i = 0; i < 3; i++) {
        more[7 * i] = 4;
        for (int j = 0; j < 3; j++)
            more[6 * (3 + i) + 3 + j] = 0.01 * start[8 + i] * start[8 + j];
    }
    for (int i = 0; i < 36; i++)
        wide[i] += more[i];
    begin_both(identity, P, wide);
    fly_both(40);
    demand_agreement();

    pose_now(now);
    rigid_inverse(back, now);
    square_multiply(4, back, start, between);
    rigid_adjoint(Ad, between);
    oracle_sandwich(6, 6, Ad, more, carried);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&imu_rig.filter, P_own));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&other, P_other));
    for (int i = 0; i < 36; i++) {
        const double size = sqrt(P_other[7 * (i / 6)] * P_other[7 * (i % 6)]);
        TEST_ASSERT_DOUBLE_WITHIN(1e4 * eps * size, P_own[i] + carried[i], P_other[i]);
    }
}
