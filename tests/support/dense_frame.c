// SPDX-License-Identifier: MIT
/* A frame in the dense filter: gate, one gain for all observations, retraction, new landmarks. */
#include "support/dense_ekf.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "support/dense_first.h"
#include "support/dense_parts.h"
#include "support/oracle.h"
#include "support/rigid.h"

static const double min_range = 0.01; /* nothing is put nearer to the camera */

/* Observations that passed the gate, stacked. */
typedef struct stack {
    unsigned rows;
    double *H, *r, *R; /* rows x n, rows, rows */
} stack;

/* Three rows of H and the innovation of a matched observation. False if it is too near. */
static bool linearise(const dense_ekf *e, unsigned landmark, const plr_observation *o, double *H,
                      double r[3]) {
    const unsigned n = dense_dim(e), row = dense_row(e, landmark);
    double q[3], z[3], Dz[9];
    dense_in_camera(e, landmark, q);
    if (!(q[2] >= e->config.min_depth_m))
        return false;
    dense_project(&e->camera, q, z, Dz);
    r[0] = (double)o->uL_px - z[0];
    r[1] = (double)o->uR_px - z[1];
    r[2] = ((double)o->vL_px + (double)o->vR_px) / 2 - z[2];
    memset(H, 0, 3 * (size_t)n * sizeof *H);
    if (dense_is_body(e)) {
        dense_put(H, n, 0, row, 3, 3, Dz);
        return true;
    }
    double K[18], H_pose[18], R_WC[9], H_l[9];
    dense_camera_by_pose(e, q, K);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 3, 1, Dz, K, 0, H_pose);
    dense_camera_to_world(e, R_WC);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, 3, 3, 3, 1, Dz, R_WC, 0, H_l);
    dense_put(H, n, 0, 0, 3, 6, H_pose);
    dense_put(H, n, 0, row, 3, 3, H_l);
    return true;
}

/* What the rows of both images differ by, squared, for d^2 (MATH 8). */
static double row_gap2(const dense_ekf *e, const plr_observation *o) {
    const double gap = (double)o->vL_px - (double)o->vR_px;
    return gap * gap / (2 * e->config.pixel_sigma_px * e->config.pixel_sigma_px);
}

/* r^T S^-1 r of one observation. */
static double distance2(const dense_ekf *e, const double *H, const double r[3]) {
    const double s2 = e->config.pixel_sigma_px * e->config.pixel_sigma_px;
    double S[9], y[3] = {r[0], r[1], r[2]};
    oracle_sandwich(3, dense_dim(e), H, e->P, S);
    S[0] += s2;
    S[4] += s2;
    S[8] += s2 / 2;
    if (!oracle_solve_spd(3, 1, S, y))
        return (double)INFINITY;
    return r[0] * y[0] + r[1] * y[1] + r[2] * y[2];
}

/* dx += K (r - H dx) and P in Joseph's form, K = P H^T S^-1. */
static void gain(dense_ekf *e, const stack *s, double *dx) {
    const unsigned n = dense_dim(e), m = s->rows;
    double *HP = dense_zeros(m, n), *S = dense_zeros(m, m), *K = dense_zeros(n, m),
           *IKH = dense_identity(n);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, m, n, n, 1, s->H, e->P, 0, HP);
    oracle_sandwich(m, n, s->H, e->P, S);
    for (unsigned i = 0; i < m; i++)
        S[i * m + i] += s->R[i];
    if (!oracle_solve_spd(m, n, S, HP)) /* now S^-1 H P = K^T */
        abort();
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, m, 1, n, -1, s->H, dx, 1, s->r);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, n, 1, m, 1, HP, s->r, 1, dx);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, n, n, m, -1, HP, s->H, 1, IKH);
    dense_sandwich(e, IKH);
    for (unsigned i = 0; i < n; i++)
        for (unsigned k = 0; k < m; k++)
            K[i * m + k] = HP[k * n + i] * sqrt(s->R[k]);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, n, n, m, 1, K, K, 1, e->P);
    free(IKH);
    free(K);
    free(S);
    free(HP);
}

/* The correction of `body`: the rigid motion that the landmarks have in common, then the chart for
 * the rest of each. */
static void retract_body(dense_ekf *e, const double *dx) {
    const unsigned n = dense_dim(e);
    double eta[6], eta_C[6], E[16], back[16], R_back[9], pose[16], pose_back[16], A[36];
    double *F = dense_identity(n), q[DENSE_MAX][3], corrections[DENSE_MAX][3];
    unsigned voices = 0;
    for (unsigned i = 0; i < e->count; i++)
        if (!e->known[i]) {
            memcpy(corrections[voices], dx + dense_row(e, i), sizeof corrections[0]);
            memcpy(q[voices++], e->x[i], sizeof q[0]);
        }
    dense_common_motion(e, voices, q, corrections, dx, eta);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, 1, 6, 1, e->Ad_CB, eta, 0, eta_C);
    rigid_exp(E, eta_C);
    rigid_inverse(back, E);
    dense_rotation(R_back, back);
    rigid_exp(pose, dx);
    rigid_inverse(pose_back, pose);
    dense_adjoint(A, pose_back);
    dense_put(F, n, 0, 0, 6, 6, A);
    for (unsigned i = 0; i < e->count; i++) {
        double K[18], rest[3], moved[3], J[9], RJ[9];
        dense_camera_by_pose(e, e->x[i], K);
        memcpy(rest, dx + dense_row(e, i), sizeof rest);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 6, -1, K, eta, 1, rest);
        dense_polar_step(e->x[i], rest, moved, J);
        square_multiply(3, R_back, J, RJ);
        dense_put(F, n, dense_row(e, i), dense_row(e, i), 3, 3, RJ);
        dense_apply(e->x[i], back, moved);
    }
    dense_sandwich(e, F);
    free(F);
}

static void retract(dense_ekf *e, const double *dx) {
    double D[16], T[16];
    if (dense_is_body(e))
        retract_body(e, dx);
    else
        for (unsigned i = 0; i < e->count; i++)
            for (unsigned k = 0; k < 3; k++)
                e->x[i][k] += dx[dense_row(e, i) + k];
    for (unsigned i = 0; e->config.bias && i < 6; i++)
        e->bias[i] += dx[DENSE_BIAS + i];
    rigid_exp(D, dx);
    square_multiply(4, e->T_WB, D, T);
    memcpy(e->T_WB, T, sizeof T);
}

/* ---------------------------------------------------------------- new landmarks */

/* Grows P by a landmark whose error is J xi + N(0, P_new); J may be null. */
static void append(dense_ekf *e, uint32_t id, const double x[3], const double *J,
                   const double P_new[9]) {
    const unsigned n = dense_dim(e), N = n + 3;
    double *grown = dense_zeros(N, N), own[9], J_all[3 * DENSE_MAX_DIM] = {0};
    for (unsigned i = 0; i < n; i++)
        memcpy(grown + i * N, e->P + i * n, n * sizeof *grown);
    memcpy(own, P_new, sizeof own);
    if (J) {
        double cross[3 * DENSE_MAX_DIM], S[9];
        dense_put(J_all, n, 0, 0, 3, 6, J);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, n, n, 1, J_all, e->P, 0, cross);
        oracle_sandwich(3, n, J_all, e->P, S);
        for (unsigned i = 0; i < 3; i++)
            for (unsigned j = 0; j < n; j++)
                grown[(n + i) * N + j] = grown[j * N + n + i] = cross[i * n + j];
        for (unsigned i = 0; i < 9; i++)
            own[i] += S[i];
    }
    dense_put(grown, N, n, n, 3, 3, own);
    memcpy(e->P, grown, (size_t)N * N * sizeof *grown);
    free(grown);
    memset(e->C + (size_t)6 * n, 0, 18 * sizeof *e->C);
    if (J)
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 6, 1, J, e->C, 0, e->C + (size_t)6 * n);
    e->id[e->count] = id;
    e->known[e->count] = false;
    memcpy(e->x[e->count++], x, 3 * sizeof *x);
}

static void create(dense_ekf *e, const plr_observation *o) {
    const double z[3] = {(double)o->uL_px, (double)o->uR_px,
                         ((double)o->vL_px + (double)o->vR_px) / 2};
    const double sigma = e->config.landmark_sigma_m;
    double q[3], P_q[9];
    dense_back_project(&e->camera, z, e->config.pixel_sigma_px * e->config.pixel_sigma_px, q, P_q);
    for (int i = 0; sigma > 0 && i < 9; i++)
        P_q[i] = i % 4 == 0 ? sigma * sigma : 0;
    if (dense_is_body(e)) {
        append(e, o->id, q, NULL, P_q);
        return;
    }
    double T_BC[16], s[3], m[3], J[18], R_WC[9], P_m[9];
    rigid_inverse(T_BC, e->T_CB);
    dense_apply(s, T_BC, q);
    dense_apply(m, e->T_WB, s);
    dense_world_by_pose(e, s, J);
    dense_camera_to_world(e, R_WC);
    oracle_sandwich(3, 3, R_WC, P_q, P_m);
    const bool shares = e->config.landmark_prior == PLR_PRIOR_CORRELATED;
    append(e, o->id, m, shares ? J : NULL, P_m);
}

void dense_insert_known(dense_ekf *e, const plr_landmark *known) {
    if (!dense_is_body(e)) {
        append(e, known->id, known->p_W_m, NULL, known->P_W_m2);
        e->known[e->count - 1] = true;
        return;
    }
    double T_WB[16], T_BW[16], q[3], K[18], R_WC[9], R_CW[9], P_q[9];
    dense_reference(e, T_WB);
    rigid_inverse(T_BW, T_WB);
    dense_apply(q, T_BW, known->p_W_m);
    dense_apply(q, e->T_CB, q);
    dense_camera_by_pose(e, q, K);
    dense_camera_to_world(e, R_WC);
    for (int i = 0; i < 9; i++)
        R_CW[i] = R_WC[3 * (i % 3) + i / 3];
    oracle_sandwich(3, 3, R_CW, known->P_W_m2, P_q);
    append(e, known->id, q, K, P_q);
    e->known[e->count - 1] = true;
}

/* May these pixels make a landmark? (MATH 9) */
static bool is_worth_it(const dense_ekf *e, const plr_observation *o) {
    const plr_config *c = &e->config;
    const double disparity = (double)o->uL_px - (double)o->uR_px;
    const double depth = e->camera.fx_px * e->camera.baseline_m / disparity;
    return disparity > 0 && disparity >= c->min_disparity_px && depth >= c->min_depth_m &&
           (c->max_depth_m <= 0 || depth <= c->max_depth_m) &&
           (c->max_row_gap_px <= 0 ||
            fabs((double)o->vL_px - (double)o->vR_px) <= c->max_row_gap_px);
}

unsigned dense_find(const dense_ekf *e, uint32_t id) {
    unsigned i = 0;
    while (i < e->count && e->id[i] != id)
        i++;
    return i;
}

/* The bias walk since the last frame: added once, without the correlation that arises meanwhile. */
static void walk(dense_ekf *e) {
    const unsigned n = dense_dim(e);
    for (unsigned i = 0; e->config.bias && i < 6; i++)
        e->P[(DENSE_BIAS + i) * n + DENSE_BIAS + i] +=
            e->walked_s * (i < 3 ? e->config.bias_velocity_walk : e->config.bias_gyro_walk);
    e->walked_s = 0;
}

void dense_remove(dense_ekf *e, uint32_t id) {
    const unsigned n = dense_dim(e), landmark = dense_find(e, id), row = dense_row(e, landmark);
    if (landmark == e->count)
        return;
    double *next = e->P;
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < n; j++)
            if ((i < row || i >= row + 3) && (j < row || j >= row + 3))
                *next++ = e->P[i * n + j];
    memmove(e->C + (size_t)6 * row, e->C + (size_t)6 * (row + 3), (n - row - 3) * 6 * sizeof *e->C);
    e->count--;
    for (unsigned i = landmark; i < e->count; i++) {
        e->id[i] = e->id[i + 1];
        e->known[i] = e->known[i + 1];
        memcpy(e->x[i], e->x[i + 1], sizeof e->x[i]);
    }
}

/* Brings landmarks along their rays to where they are linearised. `mean` (dim) takes what that leaves of
 * the prior, P the stretch. */
static void bring_closer(dense_ekf *e, const double *closer, double *mean) {
    const unsigned n = dense_dim(e);
    double *F = dense_identity(n), *C = dense_zeros(n, 6);
    for (unsigned i = 0; i < e->count; i++) {
        double *q = e->x[i], along[3], moved[3], J[9];
        const double r = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
        double ratio = fmin(2, fmax(0.5, 1 + closer[i] * r)); /* of inverse ranges */
        ratio = fmin(r / min_range, fmax(r / e->config.max_range_m, ratio));
        for (int k = 0; k < 3; k++)
            along[k] = (1 - ratio) * q[k]; /* a change of range, to first order in inverse range */
        dense_polar_step(q, along, moved, J);
        dense_put(F, n, dense_row(e, i), dense_row(e, i), 3, 3, J);
        for (int k = 0; k < 3; k++) {
            q[k] = moved[k];
            mean[dense_row(e, i) + (unsigned)k] = (ratio - 1) / ratio * moved[k];
        }
    }
    dense_sandwich(e, F);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, n, 6, n, 1, F, e->C, 0, C);
    memcpy(e->C, C, (size_t)n * 6 * sizeof *C);
    free(C);
    free(F);
}

/* The pending motion, D Exp(n) at n = L z, and the noise of n about it: with F and G of that motion,
 *   mean <- F mean - G n,  P <- F P F^T + F Cov(x, n) G^T + (...)^T + G L L^T G^T,  G = G_0 Jr(n). */
static void apply_motion(dense_ekf *e, const dense_first *first, double *mean) {
    const unsigned n = dense_dim(e);
    double motion[6], E[16], T[16], D[16], Jr[36], M[36], A[36], back[16];
    double *F = dense_identity(n), *G = dense_zeros(n, 6), *K = dense_zeros(e->count, 18);
    double *FC = dense_zeros(n, 6), *FCG = dense_zeros(n, n), *GMG = dense_zeros(n, n);
    double *moved = dense_zeros(n, 1);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, 1, 6, 1, first->L, first->z, 0, motion);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, 6, 6, 6, 1, first->L, first->L, 0, M);
    rigid_exp(E, motion);
    rigid_right_jacobian(Jr, motion);
    square_multiply(4, e->T_WB, E, T);
    memcpy(e->T_WB, T, sizeof T);
    square_multiply(4, e->D, E, D);
    rigid_inverse(back, D);
    dense_adjoint(A, back);
    dense_put(F, n, 0, 0, 6, 6, A);
    dense_put(G, 6, 0, 0, 6, 6, Jr);
    dense_move_points(e, D, F, K);
    for (unsigned i = 0; i < e->count; i++)
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 6, 1, K + 18 * i, Jr, 0,
                    G + 6 * dense_row(e, i));
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, n, 1, n, 1, F, mean, 0, moved);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, n, 1, 6, -1, G, motion, 1, moved);
    memcpy(mean, moved, n * sizeof *mean);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, n, 6, n, 1, F, e->C, 0, FC);
    oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, n, n, 6, 1, FC, G, 0, FCG);
    oracle_sandwich(n, 6, G, M, GMG);
    dense_sandwich(e, F);
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < n; j++)
            e->P[i * n + j] += FCG[i * n + j] + FCG[j * n + i] + GMG[i * n + j];
    dense_forget_motion(e);
    free(moved);
    free(GMG);
    free(FCG);
    free(FC);
    free(K);
    free(G);
    free(F);
}

/* A frame that uses nothing and makes no landmark leaves the motion pending. */
static bool is_needed(const dense_ekf *e, const plr_frame *frame, const dense_first *first) {
    bool needed = first->accepted > 0 || e->config.mode != PLR_MODE_SLAM || !dense_is_body(e);
    for (unsigned i = 0; i < frame->count; i++)
        needed = needed || (dense_find(e, frame->observations[i].id) == e->count &&
                            is_worth_it(e, &frame->observations[i]));
    return needed;
}

/* Brings the state up to the frame; `mean` is what the prior says of the errors there. */
static void catch_up(dense_ekf *e, const plr_frame *frame, dense_first *first, double *mean) {
    memset(first, 0, sizeof *first);
    if (e->pending) {
        dense_motion_prior(e, first->L);
        if (e->config.mode == PLR_MODE_SLAM)
            dense_find_motion(e, frame, first);
        if (!is_needed(e, frame, first))
            return;
        bring_closer(e, first->closer, mean);
        apply_motion(e, first, mean);
    }
    walk(e);
}

dense_report dense_update(dense_ekf *e, const plr_frame *frame) {
    dense_report report = {0};
    dense_first first;
    const unsigned n = dense_dim(e);
    double *dx = dense_zeros(n, 1);
    catch_up(e, frame, &first, dx);
    stack s = {0, dense_zeros(3U * frame->count, n), dense_zeros(3U * frame->count, 1),
               dense_zeros(3U * frame->count, 1)};
    const double s2 = e->config.pixel_sigma_px * e->config.pixel_sigma_px;
    for (unsigned i = 0; i < frame->count; i++) {
        const plr_observation *o = &frame->observations[i];
        const unsigned landmark = dense_find(e, o->id);
        double *H = s.H + (size_t)s.rows * n, *r = s.r + s.rows;
        if (landmark == e->count)
            continue;
        report.matched++;
        double d2 = (double)INFINITY;
        if (!e->pending && linearise(e, landmark, o, H, r))
            d2 = (first.judged ? first.d2[landmark] : distance2(e, H, r)) + row_gap2(e, o);
        if (!(isfinite(d2) && (e->config.gate_d2 <= 0 || d2 <= e->config.gate_d2))) {
            report.gated++;
            continue;
        }
        report.used++;
        report.nis += d2;
        for (int k = 0; k < 3; k++)
            s.R[s.rows++] = k == 2 ? s2 / 2 : s2;
    }
    if (s.rows > 0)
        gain(e, &s, dx);
    if (!e->pending)
        retract(e, dx);
    free(dx);
    free(s.R);
    free(s.r);
    free(s.H);
    return report;
}

unsigned dense_create(dense_ekf *e, const plr_frame *frame) {
    const unsigned before = e->count;
    for (unsigned i = 0; i < frame->count && e->count < e->config.slots; i++)
        if (dense_find(e, frame->observations[i].id) == e->count &&
            is_worth_it(e, &frame->observations[i]))
            create(e, &frame->observations[i]);
    return e->count - before;
}

void dense_landmark(const dense_ekf *e, unsigned landmark, double p_W[3], double P_W[9]) {
    const unsigned n = dense_dim(e), row = dense_row(e, landmark);
    double J[3 * DENSE_MAX_DIM] = {0}, own[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    memcpy(p_W, e->x[landmark], 3 * sizeof *p_W);
    if (dense_is_body(e)) {
        double T_WB[16], T_BC[16], s[3], J_pose[18];
        dense_reference(e, T_WB);
        rigid_inverse(T_BC, e->T_CB);
        dense_apply(s, T_BC, e->x[landmark]);
        dense_apply(p_W, T_WB, s);
        dense_world_by_pose(e, s, J_pose);
        dense_camera_to_world(e, own);
        dense_put(J, n, 0, 0, 3, 6, J_pose);
    }
    dense_put(J, n, 0, row, 3, 3, own);
    oracle_sandwich(3, n, J, e->P, P_W);
}
