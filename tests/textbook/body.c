// SPDX-License-Identifier: MIT
#include "textbook/body.h"

#include <math.h>
#include <string.h>

#include "support/oracle.h"
#include "support/rigid.h"
#include "textbook/observe.h"
#include "textbook/search.h"
#include "textbook/transport.h"

enum { POSE = 6, BIAS = 6 }; /* rows of the pose; the first one of the biases */

static const double min_range = 0.01; /* nothing is put nearer to the camera */

static double norm3(const double x[3]) {
    return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
}

/* ---------------------------------------------------------------- the motion that is pending */

void body_forget_motion(textbook *t) {
    memset(t->D, 0, sizeof t->D);
    memset(t->M, 0, sizeof t->M);
    for (int i = 0; i < 4; i++)
        t->D[5 * i] = 1;
    if (textbook_is_body(t))
        memset(t->C, 0, 6 * (size_t)textbook_dim(t) * sizeof *t->C);
    t->pending = false;
}

/* Cov(x, n) <- Cov(x, n) A^T + P_(:,b) N^T. */
static void carry_shared(textbook *t, const double A[36], const double *N) {
    for (unsigned i = 0; i < textbook_dim(t); i++) {
        double *row = t->C + 6 * (size_t)i, next[6] = {0};
        for (unsigned a = 0; a < 6; a++)
            for (unsigned b = 0; b < 6; b++) {
                next[a] += row[b] * A[6 * a + b];
                if (N)
                    next[a] += textbook_covariance(t, i, BIAS + b) * N[6 * a + b];
            }
        memcpy(row, next, sizeof next);
    }
}

/* Cov(n) <- A Cov(n) A^T + N Cov(b, n) A^T + (...)^T + N P_bb N^T + W, and Cov(x, n) with it. */
void body_hold(textbook *t, const double D[16], const double A[36], const double *N,
               const double W[6]) {
    double moved[16], M[36], NC[36] = {0}, NCA[36] = {0}, P_b[36], joint[36] = {0};
    square_multiply(4, t->D, D, moved);
    memcpy(t->D, moved, sizeof moved);
    oracle_sandwich(6, 6, A, t->M, M);
    if (N) {
        for (unsigned i = 0; i < 36; i++)
            P_b[i] = textbook_covariance(t, BIAS + i / 6, BIAS + i % 6);
        oracle_sandwich(6, 6, N, P_b, joint);
        square_multiply(6, N, t->C + 6 * BIAS, NC);
        oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, 6, 6, 6, 1, NC, A, 0, NCA);
    }
    for (unsigned i = 0; i < 6; i++)
        for (unsigned j = 0; j < 6; j++)
            t->M[6 * i + j] = M[6 * i + j] + NCA[6 * i + j] + NCA[6 * j + i] + joint[6 * i + j] +
                              (i == j ? W[i] : 0);
    carry_shared(t, A, N);
    t->pending = true;
}

/* A P A^T + A C + (A C)^T + M, A of the motion back. */
void textbook_pose_covariance(const textbook *t, double P_xi[36]) {
    double back[16], A[36], P[36], AC[36];
    for (unsigned i = 0; i < 36; i++)
        P[i] = P_xi[i] = textbook_covariance(t, i / 6, i % 6);
    if (!t->pending)
        return;
    rigid_inverse(back, t->D);
    rigid_adjoint(A, back);
    oracle_sandwich(6, 6, A, P, P_xi);
    square_multiply(6, A, t->C, AC);
    for (unsigned i = 0; i < 6; i++)
        for (unsigned j = 0; j < 6; j++)
            P_xi[6 * i + j] += AC[6 * i + j] + AC[6 * j + i] + t->M[6 * i + j];
}

/* ---------------------------------------------------------------- the chart */

void body_beyond(const textbook_landmark *l, double e[3]) {
    for (int k = 0; k < 3; k++)
        e[k] = -norm3(l->x) * l->beyond * l->x[k];
}

void body_polar_step(const double q[3], const double e[3], double moved[3], double J[9]) {
    const double r = norm3(q);
    const double mu[3] = {q[0] / r, q[1] / r, q[2] / r};
    const double along = mu[0] * e[0] + mu[1] * e[1] + mu[2] * e[2];
    const double turn[6] = {0,
                            0,
                            0, /* mu x e / r: the part of e along mu falls out */
                            (mu[1] * e[2] - mu[2] * e[1]) / r,
                            (mu[2] * e[0] - mu[0] * e[2]) / r,
                            (mu[0] * e[1] - mu[1] * e[0]) / r};
    const double r_moved = 1 / (1 / r - along / (r * r));
    const double ratio = r_moved / r;
    double E[16], R[9], stretch[9];
    rigid_exp(E, turn);
    rigid_rotation(R, E);
    for (int i = 0; i < 3; i++)
        moved[i] = r_moved * (R[3 * i] * mu[0] + R[3 * i + 1] * mu[1] + R[3 * i + 2] * mu[2]);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            stretch[3 * i + j] = (i == j ? ratio : 0) + (ratio * ratio - ratio) * mu[i] * mu[j];
    square_multiply(3, R, stretch, J);
}

/* Cuts a correction to what the chart takes: a turn of one radian, ranges from min_range to max_range.
 * Returns what the estimate's inverse range is off the point then, which is kept where it is below. */
static double limit_step(const textbook *t, const double q[3], double e[3]) {
    const double r = norm3(q), farthest = r * (1 - r / t->config.max_range_m),
                 nearest = r * (1 - r / min_range);
    double along = (q[0] * e[0] + q[1] * e[1] + q[2] * e[2]) / r, beyond = 0, sideways[3];
    for (int k = 0; k < 3; k++)
        sideways[k] = e[k] - along * q[k] / r;
    const double turn = norm3(sideways) / r, shrink = turn > 1 ? 1 / turn : 1;
    if (along > farthest) /* inverse range is 1 / r - along / r^2 */
        beyond = (farthest - along) / (r * r);
    along = fmin(farthest, fmax(nearest, along));
    for (int k = 0; k < 3; k++)
        e[k] = shrink * sideways[k] + along * q[k] / r;
    return beyond;
}

/* ---------------------------------------------------------------- landmarks along with the camera */

/* q's of the camera before a motion D of the body are `back` applied to them after it. */
static void camera_back(const textbook *t, const double D[16], double back[16], double R_back[9]) {
    double T_BC[16], CD[16], D_C[16];
    rigid_inverse(T_BC, t->T_CB);
    square_multiply(4, t->T_CB, D, CD);
    square_multiply(4, CD, T_BC, D_C);
    rigid_inverse(back, D_C);
    rigid_rotation(R_back, back);
}

/* Brings a landmark along its ray to where it is linearised; the estimate stays, beyond that point. J is
 * the stretch. */
static void move_to_linearisation_point(const textbook *t, textbook_landmark *l, double J[9]) {
    const double r = norm3(l->x);
    double ratio = 1 + (l->beyond + l->range_shift) * r; /* of inverse ranges */
    ratio = fmin(r / min_range, fmax(r / t->config.max_range_m, ratio));
    double along[3], moved[3];
    for (int k = 0; k < 3; k++)
        along[k] = (1 - ratio) * l->x[k]; /* a change of range, to first order in inverse range */
    body_polar_step(l->x, along, moved, J);
    memcpy(l->x, moved, sizeof moved);
    l->beyond -= (ratio - 1) / r;
}

/* Splits an error of a point into the part across its ray, which stays in e, and that along it, as an
 * inverse range. */
static void split_error(textbook_landmark *l, double e[3]) {
    const double r = norm3(l->x);
    const double along = (l->x[0] * e[0] + l->x[1] * e[1] + l->x[2] * e[2]) / r;
    for (int k = 0; k < 3; k++)
        e[k] -= along * l->x[k] / r;
    l->beyond = -along / (r * r);
}

/* Landmarks along with a motion D of the body: `blocks` takes how their errors go, `correction` what
 * the prior says of them. */
static void move_landmarks(textbook *t, const double D[16]) {
    double back[16], R_back[9];
    camera_back(t, D, back, R_back);
    for (unsigned i = 0; i < t->count; i++) {
        textbook_landmark *l = &t->landmarks[i];
        double J[9], beyond[3], *e = t->correction + textbook_row(t, i);
        move_to_linearisation_point(t, l, J);
        body_beyond(l, beyond);
        rigid_apply(l->x, back, l->x);
        const double range = norm3(l->x);
        for (int k = 0; range < min_range && k < 3; k++) /* the camera has run into it */
            l->x[k] = range > 0 ? l->x[k] * min_range / range : (k == 2 ? min_range : 0);
        square_multiply(3, R_back, J, t->blocks + 9 * (size_t)i);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 3, 1, R_back, beyond, 0, e);
        split_error(l, e);
    }
}

/* Is there a correction that no observation has made, of landmarks that are too far away? */
static bool is_left(const textbook *t) {
    bool left = false;
    for (unsigned i = 0; i < textbook_dim(t); i++)
        left = left || t->correction[i] < 0 || t->correction[i] > 0;
    return left;
}

static void clear_correction(textbook *t) {
    memset(t->correction, 0, textbook_dim(t) * sizeof *t->correction);
    memset(t->motion_variance, 0, sizeof t->motion_variance);
}

void body_move(textbook *t, const double D[16]) {
    double back[16], A[36];
    rigid_inverse(back, D);
    rigid_adjoint(A, back);
    for (unsigned i = 0; i < t->count; i++)
        t->landmarks[i].range_shift = 0;
    clear_correction(t);
    move_landmarks(t, D);
    transport_covariance(t, POSE, A, t->blocks);
    if (is_left(t))
        body_retract(t);
}

/* F C: the shared part of the state after F = diag(A, I, blocks). */
static void turn_shared(textbook *t, const double A[36]) {
    double turned[36];
    square_multiply(6, A, t->C, turned);
    memcpy(t->C, turned, sizeof turned);
    for (unsigned i = 0; i < t->count; i++) {
        double *rows = t->C + 6 * (size_t)textbook_row(t, i);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 3, 1, t->blocks + 9 * (size_t)i, rows, 0,
                    turned);
        memcpy(rows, turned, 18 * sizeof *rows);
    }
}

/* The pending motion, D Exp(n) at n = L z, and the noise of n about it: with F and G of that motion,
 *   mean <- F mean - G n,  P <- F P F^T + F Cov(x, n) G^T + (...)^T + G L L^T G^T,  G = G_0 Jr(n). */
static void apply_motion(textbook *t, const search_result *found) {
    const unsigned n = textbook_dim(t);
    double motion[6], E[16], T[16], D[16], Jr[36], M[36], JMJ[36], A[36], back[16], K[18];
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, 1, 6, 1, found->L, found->z, 0, motion);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, 6, 6, 6, 0.5, found->L, found->L, 0, M);
    rigid_exp(E, motion);
    rigid_right_jacobian(Jr, motion);
    oracle_sandwich(6, 6, Jr, M, JMJ);
    square_multiply(4, t->T_WB, E, T);
    memcpy(t->T_WB, T, sizeof T);
    square_multiply(4, t->D, E, D);
    rigid_inverse(back, D);
    rigid_adjoint(A, back);
    clear_correction(t);
    for (unsigned k = 0; k < 6; k++)
        t->motion_variance[k] = 2 * JMJ[7 * k];
    move_landmarks(t, D);
    memset(t->noise, 0, 6 * (size_t)n * sizeof *t->noise);
    memcpy(t->noise, Jr, sizeof Jr);
    for (unsigned i = 0; i < t->count; i++) {
        observe_camera_by_pose(t, t->landmarks[i].x, K);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 6, 1, K, Jr, 0,
                    t->noise + 6 * (size_t)textbook_row(t, i));
    }
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, n, 1, 6, -1, t->noise, motion, 1, t->correction);
    turn_shared(t, A);
    memcpy(t->shared, t->C, 6 * (size_t)n * sizeof *t->shared);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, n, 6, 6, 1, t->noise, M, 1, t->shared);
    transport_covariance(t, POSE, A, t->blocks);
    transport_widen(t, t->shared, t->noise);
    body_forget_motion(t);
}

/* ---------------------------------------------------------------- a frame */

/* A frame that uses nothing and makes no landmark leaves the motion pending. */
static bool needs_motion_applied(const textbook *t, const plr_frame *frame,
                                 const search_result *found) {
    bool needed = found->accepted > 0 || t->config.mode != PLR_MODE_SLAM;
    for (unsigned i = 0; i < frame->count && !needed; i++)
        needed = textbook_find(t, frame->observations[i].id) == t->count &&
                 textbook_is_worth_a_landmark(&t->config, &t->camera, &frame->observations[i]);
    return needed;
}

bool body_catch_up(textbook *t, const plr_frame *frame) {
    search_result found = {.accepted = 0};
    clear_correction(t);
    for (unsigned i = 0; i < t->count; i++)
        t->landmarks[i].range_shift = 0;
    if (!t->pending)
        return false;
    const bool judged = t->config.mode == PLR_MODE_SLAM;
    search_prior(t, found.L);
    if (judged)
        search_motion(t, frame, &found);
    if (needs_motion_applied(t, frame, &found))
        apply_motion(t, &found);
    return judged;
}

void body_settle(textbook *t) {
    search_result found = {.accepted = 0};
    for (unsigned i = 0; i < t->count; i++)
        t->landmarks[i].range_shift = 0;
    search_prior(t, found.L);
    apply_motion(t, &found);
    if (is_left(t))
        body_retract(t);
}

/* ---------------------------------------------------------------- corrections */

void body_fit_add(const textbook *t, body_fit *fit, const double q[3], const double e[3]) {
    const double r2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2], baseline = t->camera.baseline_m;
    double K[18], W[9], WK[18];
    fit->heard++;
    for (unsigned k = 0; k < 9; k++) {
        const double along = q[k / 3] * q[k % 3] / r2; /* mu mu^T */
        W[k] = ((k % 4 == 0) - along) / r2 + baseline * baseline * along / (r2 * r2);
    }
    observe_camera_by_pose(t, q, K);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 3, 1, W, K, 0, WK);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, 6, 6, 3, 1, K, WK, 1, fit->A);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, 6, 1, 3, 1, WK, e, 1, fit->b);
    for (unsigned k = 0; k < 9; k++)
        fit->square += e[k / 3] * W[k] * e[k % 3];
}

/* Per degree of freedom, what no common motion explains of the corrections. */
static double scatter(const body_fit *fit, double most) {
    double A[36], y[6], left = fit->square;
    memcpy(A, fit->A, sizeof A);
    memcpy(y, fit->b, sizeof y);
    for (unsigned k = 0; k < 6; k++)
        A[7 * k] += 1e-5 * A[7 * k] + 1e-12;
    if (fit->heard < 3 || !oracle_solve_spd(6, 1, A, y))
        return most;
    for (unsigned k = 0; k < 6; k++)
        left -= fit->b[k] * y[k];
    return fmax(0, fmin(most, left / (3 * fit->heard - 6)));
}

void body_fit_solve(const textbook *t, body_fit *fit, const double xi[6], double eta[6]) {
    const double angle = t->config.pixel_sigma_px / t->camera.fx_px;
    const double left = scatter(fit, angle * angle);
    for (unsigned k = 0; k < 6; k++) {
        const double weight = 0.1 * fit->A[7 * k] + 1e-12;
        eta[k] = fit->b[k] + weight * xi[k];
        fit->A[7 * k] += weight + left / (t->motion_variance[k] + 1e-20);
    }
    if (fit->heard == 0 || !oracle_solve_spd(6, 1, fit->A, eta))
        memcpy(eta, xi, 6 * sizeof *eta);
}

void body_along(const textbook *t, const double eta[6], const double back[16], double q[3],
                double e[3]) {
    double K[18], R_back[9], turned[3];
    const double before = norm3(q);
    observe_camera_by_pose(t, q, K);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 6, -1, K, eta, 1, e);
    const double along = (q[0] * e[0] + q[1] * e[1] + q[2] * e[2]) / before;
    for (unsigned k = 0; k < 3; k++) /* an angle */
        e[k] = (e[k] - along * q[k] / before) / before;
    rigid_rotation(R_back, back);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 3, 1, R_back, e, 0, turned);
    rigid_apply(q, back, q);
    const double r = norm3(q), off = (q[0] * turned[0] + q[1] * turned[1] + q[2] * turned[2]) / r;
    for (unsigned k = 0; k < 3; k++) /* across the new ray, and along it */
        e[k] = r * (turned[k] - off * q[k] / r) + along * r / (before * before) * q[k];
}

/* One landmark's correction: along with the common motion eta, then the rest through the chart. */
static void retract_landmark(textbook *t, unsigned landmark, const double eta[6],
                             const double back[16], double block[9]) {
    textbook_landmark *l = &t->landmarks[landmark];
    double e[3], beyond[3], moved[3], J[9], R_back[9];
    rigid_rotation(R_back, back);
    body_beyond(l, beyond);
    for (unsigned k = 0; k < 3; k++)
        e[k] = t->correction[textbook_row(t, landmark) + k] + beyond[k];
    body_along(t, eta, back, l->x, e);
    l->beyond = limit_step(t, l->x, e);
    body_polar_step(l->x, e, moved, J);
    square_multiply(3, J, R_back, block);
    memcpy(l->x, moved, sizeof moved);
}

void body_retract(textbook *t) {
    const double *d = t->correction;
    double eta[6], eta_C[6], E[16], back[16], pose[16], pose_back[16], A[36];
    body_fit fit = {.A = {0}};
    for (unsigned i = 0; i < t->count; i++)
        if (!t->landmarks[i].known)
            body_fit_add(t, &fit, t->landmarks[i].x, d + textbook_row(t, i));
    body_fit_solve(t, &fit, d, eta);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, 1, 6, 1, t->Ad_CB, eta, 0, eta_C);
    rigid_exp(E, eta_C);
    rigid_inverse(back, E);
    rigid_exp(pose, d);
    rigid_inverse(pose_back, pose);
    rigid_adjoint(A, pose_back);
    for (unsigned i = 0; i < t->count; i++)
        retract_landmark(t, i, eta, back, t->blocks + 9 * (size_t)i);
    transport_covariance(t, POSE, A, t->blocks);
}
