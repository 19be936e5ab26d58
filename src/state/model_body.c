// SPDX-License-Identifier: MIT
/*
 * The `body` model: landmarks q in the current left camera, with errors in the polar chart at q. An
 * observation depends on its landmark alone, and a motion of the body moves all landmarks. The
 * filter is invariant: directions that nothing observes (the pose of the world) stay unobserved, so
 * that it gains no information about them from linearisation. docs/MATH.md 2 and 6.
 */
#include "pelorus/assertions.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/polar.h"
#include "state/rigid_fit.h"
#include "state/sensitivity.h"

#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "state/camera.h"
#include "state/motion.h"
#include "state/pose.h"

/*
 * Three products of Jw and Ji are written out below. Each contains q^T N = 0 or q x q = 0: a
 * difference of large equal numbers, which for a point at a kilometre would be rounding alone in
 * float32.
 */

/* row = [way turn] Ad, with Ad = [R, C; 0, R]. turn = NULL means zeros. */
static inline void times_adjoint(plr_real row[PLR_POSE_DIM], const plr_real way[3],
                                 const plr_real *turn, const plr_real Ad[PLR_POSE_SQUARE]) {
    const plr_real *R0 = Ad, *R1 = R0 + PLR_POSE_DIM, *R2 = R1 + PLR_POSE_DIM;
    const plr_real *T0 = R2 + PLR_POSE_DIM, *T1 = T0 + PLR_POSE_DIM, *T2 = T1 + PLR_POSE_DIM;
    for (int j = 0; j < PLR_POSE_DIM; j++)
        row[j] = PLR_FMA(way[2], R2[j], PLR_FMA(way[1], R1[j], way[0] * R0[j]));
    for (int j = 3; j < PLR_POSE_DIM && turn; j++)
        row[j] = PLR_FMA(turn[2], T2[j], PLR_FMA(turn[1], T1[j], PLR_FMA(turn[0], T0[j], row[j])));
}

/* J = Jw(q) [-I | [q]x] Ad(T_CB), 3x6: the derivative of a landmark's chart by the body's twist.
 * Jw [-I | [q]x] = [ -N^T / r | N^T [mu]x ; mu^T / r^2 | 0 ]. */
static void chart_by_body_twist(const plr_camera_model *camera, const plr_polar *chart,
                                plr_real J[PLR_ROWS * PLR_POSE_DIM]) {
    const plr_real inverse = PLR_R(1) / chart->r;
    plr_real way[3];
    for (int row = 0; row < 2; row++) {
        const plr_real *n = chart->N[row];
        plr_real turn[3];
        plr_cross3(turn, n, chart->mu); /* n^T [mu]x */
        for (int j = 0; j < 3; j++)
            way[j] = -n[j] * inverse;
        times_adjoint(J + PLR_POSE_DIM * row, way, turn, camera->Ad_CB);
    }
    for (int j = 0; j < 3; j++)
        way[j] = chart->mu[j] * inverse * inverse;
    times_adjoint(J + 2 * PLR_POSE_DIM, way, NULL, camera->Ad_CB);
}

/* F = Jw(q+) R^T Ji(q), 3x3, for q+ = R^T (q - p): the derivative of the chart at q+ by the chart
 * at q. With N+^T q+ = 0 and q^T N = 0:
 *   F = [ r/r+ N+^T R^T N | -r/r+ N+^T R^T p ; r/r+^3 p^T N | (r - p^T mu) r^2 / r+^3 ]. */
static void chart_jacobian(plr_real F[9], const plr_polar *to, const plr_real R[9],
                           const plr_real p[3], const plr_polar *from) {
    const plr_real ratio = from->r / to->r;
    const plr_real shrink = ratio / (to->r * to->r);
    plr_real turned[3];
    for (int column = 0; column < 2; column++) {
        plr_mat3_tvec(turned, R, from->N[column]);
        for (int row = 0; row < 2; row++)
            F[3 * row + column] = ratio * plr_dot3(to->N[row], turned);
        F[6 + column] = shrink * plr_dot3(p, from->N[column]);
    }
    plr_mat3_tvec(turned, R, p);
    for (int row = 0; row < 2; row++)
        F[3 * row + 2] = -ratio * plr_dot3(to->N[row], turned);
    F[8] = shrink * (from->r - plr_dot3(p, from->mu)) * from->r;
}

/* Keeps a landmark at least PLR_MIN_RANGE away: nearer the chart is not defined. */
static void enforce_min_range(plr_real q[3]) {
    const plr_real range2 = plr_dot3(q, q);
    if (range2 >= PLR_MIN_RANGE * PLR_MIN_RANGE)
        return;
    const plr_real scale = range2 > 0 ? PLR_MIN_RANGE / PLR_SQRT(range2) : 0;
    for (int i = 0; i < 3; i++)
        q[i] *= scale;
    if (!(range2 > 0))
        q[2] = PLR_MIN_RANGE;
}

/* W^T, 6 x dim, where the motion's noise is JL before it: rows JL of the pose, G JL of the landmarks,
 * G = Jw(q) [-I | [q]x] Ad(T_CB). */
static void fill_W(const plr_belief *belief, const plr_camera_model *camera,
                   const plr_real JL[PLR_POSE_SQUARE], plr_real *Wt, size_t ld) {
    const unsigned n = plr_covariance_dim(belief), first = plr_covariance_row(belief, 0);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        for (unsigned i = 0; i < PLR_POSE_DIM; i++)
            Wt[k * ld + i] = JL[PLR_POSE_DIM * i + k];
        memset(Wt + k * ld + PLR_POSE_DIM, 0,
               (first - PLR_POSE_DIM) * sizeof *Wt); /* a motion changes no bias */
        memset(Wt + k * ld + n, 0, (ld - n) * sizeof *Wt);
    }
    for (unsigned slot = 0; slot < belief->count; slot++) {
        const unsigned row = plr_covariance_row(belief, slot);
        plr_polar chart;
        plr_real G[PLR_ROWS * PLR_POSE_DIM], GL[PLR_ROWS * PLR_POSE_DIM] = {0};
        plr_polar_at(&chart, belief->slots[slot].x);
        chart_by_body_twist(camera, &chart, G);
        plr_gemm_nn(3, PLR_POSE_DIM, PLR_POSE_DIM, G, PLR_POSE_DIM, JL, PLR_POSE_DIM, GL,
                    PLR_POSE_DIM);
        for (unsigned i = 0; i < 3; i++)
            for (unsigned k = 0; k < PLR_POSE_DIM; k++)
                Wt[k * ld + row + i] = GL[PLR_POSE_DIM * i + k];
    }
}

/* Moves a landmark along its ray to its linearisation point (filter/linearisation.h). The estimate does
 * not change: returns the estimated inverse range minus that of the point, 1/m. */
static plr_real move_to_linearisation_point(plr_belief *belief, const plr_camera_model *camera,
                                            const plr_noise *noise, unsigned slot) {
    PLR_ASSERT(slot < belief->count);
    plr_slot *s = &belief->slots[slot];
    const plr_real range = PLR_SQRT(plr_dot3(s->x, s->x)), nearest = range / PLR_MIN_RANGE;
    const plr_real wanted = s->beyond + noise->range_shift[slot];
    plr_real ratio = PLR_FMA(wanted, range, PLR_R(1)); /* of inverse ranges */
    const plr_real farthest = camera->min_inverse_range * range;
    ratio = ratio < farthest ? farthest : ratio > nearest ? nearest : ratio;
    const plr_real step = (PLR_R(1) - ratio) / ratio;
    for (int i = 0; i < 3; i++)
        s->x[i] = PLR_FMA(step, s->x[i], s->x[i]);
    plr_sensitivity_move_range(belief, camera, slot, ratio);
    return s->beyond - (ratio - PLR_R(1)) / range;
}

static bool body_look(const plr_belief *belief, const plr_camera_model *camera, unsigned slot,
                      plr_view *view) {
    PLR_ASSERT(slot < belief->count);
    memcpy(view->q, belief->slots[slot].x, sizeof view->q);
    plr_se3_move_back(view->q, belief->held.E_C, belief->held.p_C);
    return view->q[2] >= camera->min_depth;
}

/* H = Dz R^T Ji(q) with Ji = [r N | -r q], q being where the landmark stands and R^T (q - p) where the held motion
 * takes it: along q the pixels change by Dz R^T q = Dz R^T (q - p) + Dz R^T p. */
static void body_derive(const plr_belief *belief, const plr_camera_model *camera, unsigned slot,
                        const plr_view *view, const plr_real Dz[9], const plr_real along[3],
                        plr_real z[3], plr_rows *H) {
    PLR_ASSERT(slot < belief->count);
    (void)camera;
    const plr_held_motion *held = &belief->held;
    plr_polar chart;
    plr_real R[9], DzRt[9];
    plr_polar_at(&chart, belief->slots[slot].x);
    plr_se3_rotation(R, held->E_C);
    plr_mat3_mul_nt(DzRt, Dz, R);
    H->terms = 0;
    plr_real *h = plr_rows_add(H, plr_covariance_row(belief, slot), PLR_LANDMARK_DIM);
    for (int row = 0; row < 3; row++, h += 3) {
        for (int column = 0; column < 2; column++)
            h[column] = chart.r * plr_dot3(DzRt + 3 * row, chart.N[column]);
        h[2] = -chart.r * (along[row] / view->q[2] + plr_dot3(DzRt + 3 * row, held->p_C));
        z[row] = PLR_FMA(h[2], belief->slots[slot].beyond, z[row]);
    }
}

/* P = J_q S_q S_q^T J_q^T, 3x3, J_q the chart's error by the point's. */
static void point_to_chart(const plr_real q[3], const plr_real S_q[9], plr_real J_q[9],
                           plr_real P[9]) {
    plr_polar chart;
    plr_real JS[9];
    plr_polar_at(&chart, q);
    plr_polar_from_point(J_q, &chart);
    plr_mat3_mul(JS, J_q, S_q);
    plr_mat3_mul_nt(P, JS, JS);
}

static void body_initialise(const plr_belief *belief, const plr_camera_model *camera,
                            const plr_real q[3], const plr_real S_q[9],
                            plr_new_landmark *landmark) {
    (void)belief, (void)camera;
    point_to_chart(q, S_q, landmark->J_q, landmark->P);
    memcpy(landmark->x, q, 3 * sizeof *q);
    landmark->uses_pose = false;
}

/* P = J P_W J^T, 3x3, in double: the bearing variance of a far point is smaller than its range
 * variance by more digits than float32 has. False if a variance is negative. */
static bool covariance_in_chart(plr_real P[9], const plr_real J[9], const double P_W[9]) {
    double JP[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            JP[3 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                JP[3 * i + j] += (double)J[3 * i + k] * P_W[3 * k + j];
        }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j <= i; j++) {
            double sum = 0;
            for (int k = 0; k < 3; k++)
                sum += JP[3 * i + k] * (double)J[3 * j + k];
            P[3 * i + j] = P[3 * j + i] = (plr_real)sum;
        }
    return P[0] >= 0 && P[4] >= 0 && P[8] >= 0;
}

static PLR_SELDOM bool body_adopt(const plr_belief *belief, const plr_camera_model *camera,
                                  const plr_motion *motion, const plr_landmark *known,
                                  plr_new_landmark *landmark) {
    plr_real offset_W[3], s_B[3], R_CW[9], R_WB[9];
    double p_WB[3];
    plr_pose_reference(belief, motion, R_WB, p_WB);
    for (int i = 0; i < 3; i++)
        offset_W[i] = (plr_real)(known->p_W_m[i] - p_WB[i]);
    plr_mat3_tvec(s_B, R_WB, offset_W);
    plr_camera_from_body(landmark->x, &camera->given, s_B);
    const plr_real range2 = plr_dot3(landmark->x, landmark->x);
    if (!(range2 > PLR_MIN_RANGE * PLR_MIN_RANGE) ||
        !(range2 * camera->min_inverse_range * camera->min_inverse_range < 1))
        return false;

    plr_polar chart;
    plr_real Jw[9], J_W[9];
    plr_polar_at(&chart, landmark->x);
    chart_by_body_twist(camera, &chart, landmark->J_pose);
    landmark->uses_pose = true;
    memset(landmark->by_calibration, 0, sizeof landmark->by_calibration);
    plr_polar_from_point(Jw, &chart);
    plr_mat3_mul_nt(R_CW, camera->given.R_CB, R_WB);
    plr_mat3_mul(J_W, Jw, R_CW);
    return covariance_in_chart(landmark->P, J_W, known->P_W_m2);
}

/* A rigid motion that the corrections of some landmarks have in common. */
typedef struct plr_common_motion {
    plr_real eta[PLR_POSE_DIM]; /* of the body */
    plr_real E[9], R[9], p[3];  /* of the camera: Exp(eta_C), R = I + E */
} plr_common_motion;

/* With an IMU, landmarks out of sight share another motion: the frame that finds the velocity after
 * a dark stretch corrects position and old landmarks by metres, but not those that it sees. */
enum { IN_SIGHT, OUT_OF_SIGHT, SIGHTS };

static unsigned sight_of(const plr_belief *belief, unsigned slot) {
    const bool parted = plr_has_block(belief, PLR_BLOCK_VELOCITY);
    return parted && belief->slots[slot].last_frame != belief->frame_number ? OUT_OF_SIGHT
                                                                            : IN_SIGHT;
}

/* The rigid motions eta of the body that the landmarks' corrections have in common. They differ
 * from the pose's correction xi, which may mostly concern the way before, in which no visible
 * landmark takes part. A bearing is weighted as an angle, an inverse range as the disparity that it
 * causes. Known landmarks are left out: they are fixed in the world, and the common part of a map's
 * errors is no motion. w: the landmarks' corrections, one after the other. J becomes chart_by_body_twist of
 * every slot. */
static void find_common_motions(const plr_belief *belief, const plr_camera_model *camera,
                                const plr_noise *noise, const plr_real xi[PLR_POSE_DIM],
                                const plr_real *w, plr_real *J, plr_common_motion common[SIGHTS]) {
    static const plr_real none[PLR_POSE_DIM] = {0};
    const bool parted = plr_has_block(belief, PLR_BLOCK_VELOCITY);
    const plr_real baseline = camera->given.baseline;
    const plr_real W[3] = {1, 1, baseline * baseline};
    const plr_real angle2 = camera->pixel_variance / (camera->given.fx * camera->given.fx);
    plr_rigid_fit fit[SIGHTS];
    memset(fit, 0, sizeof fit);
    for (unsigned slot = 0; slot < belief->count; slot++, J += PLR_ROWS * PLR_POSE_DIM) {
        plr_polar chart;
        plr_polar_at(&chart, belief->slots[slot].x);
        chart_by_body_twist(camera, &chart, J);
        if (!belief->slots[slot].known)
            plr_rigid_fit_add(&fit[sight_of(belief, slot)], J, w + PLR_LANDMARK_DIM * slot, W);
    }
    for (unsigned sight = 0; sight < (parted ? SIGHTS : 1); sight++) {
        plr_common_motion *m = &common[sight];
        plr_real eta_C[PLR_POSE_DIM];
        plr_rigid_fit_solve(&fit[sight], parted && sight == IN_SIGHT ? none : xi,
                            noise->motion_variance, angle2, m->eta);
        plr_mat6_vec(eta_C, camera->Ad_CB, m->eta);
        plr_se3_expm1(m->E, m->p, eta_C);
        plr_se3_rotation(m->R, m->E);
    }
}

/* Converts the rest of a correction from the chart `from` to `to`, where the common motion brought
 * the point: the same angle, turned by F (chart_jacobian), and the same inverse range. */
static void turn_rest(plr_real w[3], const plr_real F[9], const plr_polar *to,
                      const plr_polar *from) {
    const plr_real ratio = to->r / from->r, w0 = ratio * w[0], w1 = ratio * w[1];
    w[0] = PLR_FMA(F[1], w1, F[0] * w0);
    w[1] = PLR_FMA(F[4], w1, F[3] * w0);
}

/* Moves the landmarks and their sensitivity along the held motion, without P. F: the derivative of each; w: its
 * correction there. What the estimate is beyond the point goes along as an error does. */
static void move_along(plr_belief *belief, const plr_real *dx, plr_real *F, plr_real *w) {
    const plr_held_motion *held = &belief->held;
    plr_real R[9];
    plr_se3_rotation(R, held->E_C);
    for (unsigned slot = 0; slot < belief->count; slot++, F += 9, w += PLR_LANDMARK_DIM) {
        plr_slot *s = &belief->slots[slot];
        const plr_real beyond = s->beyond, *before = dx + plr_covariance_row(belief, slot);
        plr_polar from, to;
        if (!held->any) {
            plr_mat3_identity(F);
            memcpy(w, before, PLR_LANDMARK_DIM * sizeof *w);
            continue;
        }
        plr_polar_at(&from, s->x);
        plr_se3_move_back(s->x, held->E_C, held->p_C);
        enforce_min_range(s->x);
        plr_polar_at(&to, s->x);
        chart_jacobian(F, &to, R, held->p_C, &from);
        plr_sensitivity_turn_landmark(belief, slot, F);
        plr_mat3_vec(w, F, before);
        w[0] = PLR_FMA(F[2], beyond, w[0]);
        w[1] = PLR_FMA(F[5], beyond, w[1]);
        s->beyond = F[8] * beyond;
    }
}

/* F <- diag(M, 1) F, 3x3 */
static void turn_chart(plr_real F[9], const plr_real M[4]) {
    for (int k = 0; k < 3; k++) {
        const plr_real f[2] = {F[k], F[3 + k]};
        F[k] = PLR_FMA(M[1], f[1], M[0] * f[0]);
        F[3 + k] = PLR_FMA(M[3], f[1], M[2] * f[0]);
    }
}

/*
 * Moves landmarks and P, once, along the motion that is held and by the correction. At the end of the motion the common
 * part of the landmarks' corrections is applied as a rigid motion eta, exactly, and the
 * rest of each through its chart, at the point to which eta has brought the landmark:
 *   w_rest = w - Jw(q) [-I | [q]x] eta_C,  q~ = Exp(eta_C)^-1 q,  q+ = retr(q~, w_rest).
 * P is transported by diag(M, 1) Jw(q~) Exp(-theta_C) Ji(q) F, where theta_C is the rotation of
 * eta_C and F the derivative of the held motion, and the pose's rows by Ad(Exp(-xi)) A.
 */
static unsigned body_retract(plr_belief *belief, const plr_camera_model *camera,
                             plr_workspace *work, const plr_real *dx) {
    plr_real R_xi[9], p_xi[3], xi[PLR_POSE_DIM], A[PLR_POSE_SQUARE], by_xi[PLR_POSE_SQUARE],
        by_both[PLR_POSE_SQUARE];
    plr_common_motion both[SIGHTS];
    plr_motion_held_adjoint(belief, A);
    plr_mat6_vec(xi, A, dx);
    plr_se3_exp(R_xi, p_xi, xi);
    plr_se3_adjoint_inverse(by_xi, R_xi, p_xi);
    plr_mat6_mul(by_both, by_xi, A);
    plr_real *F = work->Vt, *J = F + 9 * belief->count; /* 30 numbers a slot; Vt has at least 72 */
    plr_real *w = J + PLR_ROWS * PLR_POSE_DIM * belief->count;
    move_along(belief, dx, F, w);
    find_common_motions(belief, camera, &work->noise, xi, w, J, both);

    unsigned cut = 0;
    for (unsigned slot = 0; slot < belief->count; slot++) {
        const plr_common_motion *common = &both[sight_of(belief, slot)];
        plr_slot *s = &belief->slots[slot];
        plr_polar from, there, to;
        plr_real M[4], rigid[9], along[9];
        plr_polar_at(&from, s->x);
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < PLR_POSE_DIM; k++)
                w[i] = PLR_FMA(-J[PLR_POSE_DIM * i + k], common->eta[k], w[i]);
        w[2] += s->beyond;
        plr_se3_move_back(s->x, common->E, common->p);
        plr_polar_at(&there, s->x);
        chart_jacobian(rigid, &there, common->R, common->p, &from);
        turn_rest(w, rigid, &there, &from);
        cut += plr_polar_retract(&to, M, &there, w, camera->min_inverse_range, s->x, &s->beyond);
        plr_sensitivity_move_range(belief, camera, slot, there.r / to.r);
        turn_chart(rigid, M);
        plr_sensitivity_turn_landmark(belief, slot, rigid);
        memcpy(along, F + 9 * slot, sizeof along);
        plr_mat3_mul(F + 9 * slot, rigid, along);
        J += PLR_ROWS * PLR_POSE_DIM;
        w += PLR_LANDMARK_DIM;
    }
    memset(&belief->held, 0, sizeof belief->held);
    plr_covariance_transport(belief, work->Vt, by_both, F);
    return cut;
}

/* The landmarks and P stay where they are: the retraction moves them. */
static void body_propagate(plr_belief *belief, const plr_camera_model *camera,
                           const plr_motion *motion, plr_workspace *work,
                           const plr_applied_motion *applied) {
    plr_held_motion *held = &belief->held;
    plr_real R[9], Ad[PLR_POSE_SQUARE], JL[PLR_POSE_SQUARE];
    memcpy(held->E, applied->E, sizeof held->E);
    memcpy(held->p, applied->p, sizeof held->p);
    plr_camera_motion(held->E_C, held->p_C, &camera->given, held->E, held->p);
    held->any = 1;
    plr_se3_rotation(R, held->E);
    plr_se3_adjoint(Ad, R, held->p);
    plr_mat6_mul(JL, Ad, applied->JL);          /* D' Exp(JL nu) = Exp(Ad(D') JL nu) D' */
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) /* the prior of the common motions */
        work->noise.motion_variance[k] = plr_norm2_of_6(applied->JL + PLR_POSE_DIM * k);
    memset(work->dx, 0, plr_covariance_dim(belief) * sizeof *work->dx);
    for (unsigned slot = 0; slot < belief->count; slot++)
        belief->slots[slot].beyond =
            move_to_linearisation_point(belief, camera, &work->noise, slot);
    if (!motion->noisy) { /* nothing is to be told apart from P */
        (void)body_retract(belief, camera, work, work->dx);
        return;
    }
    fill_W(belief, camera, JL, work->noise.Wt, plr_covariance_ld(belief));
    plr_covariance_open_noise(belief, motion, work, applied);
}

static PLR_SELDOM void body_drift(plr_belief *belief, const plr_camera_model *camera,
                                  plr_real sigma) {
    for (unsigned slot = 0; slot < belief->count; slot++) {
        const plr_real *q = belief->slots[slot].x, wanders = sigma * q[2];
        const plr_real S_q[9] = {
            [0] = wanders / camera->given.fx, [4] = wanders / camera->given.fy};
        plr_real J_q[9], C[9];
        if (belief->slots[slot].known)
            continue;
        point_to_chart(q, S_q, J_q, C);
        plr_covariance_add_to_landmark(belief, slot, C);
    }
}

static PLR_SELDOM void body_in_world(const plr_belief *belief, const plr_camera_model *camera,
                                     const plr_motion *motion, const plr_slot *slot,
                                     plr_world_point *point) {
    plr_polar chart;
    plr_real s_B[3], offset[3], Ji[9], R_WC[9], R_WB[9];
    double p_WB[3];
    plr_pose_reference(belief, motion, R_WB, p_WB);
    plr_camera_to_body(s_B, &camera->given, slot->x);
    plr_mat3_vec(offset, R_WB, s_B);
    for (int i = 0; i < 3; i++)
        point->p_W[i] = p_WB[i] + (double)offset[i];

    const unsigned row = plr_covariance_row(belief, (unsigned)(slot - belief->slots));
    point->J.terms = 0;
    plr_real *own = plr_rows_add(&point->J, row, PLR_LANDMARK_DIM);
    plr_world_by_pose(R_WB, s_B,
                      plr_rows_add(&point->J, plr_row_of(belief, PLR_BLOCK_POSE), PLR_POSE_DIM));
    plr_polar_at(&chart, slot->x);
    plr_polar_to_point(Ji, &chart);
    plr_mat3_mul_nt(R_WC, R_WB, camera->given.R_CB);
    plr_mat3_mul(own, R_WC, Ji);
}

const struct plr_model plr_model_body = {
    .propagate = body_propagate,
    .look = body_look,
    .derive = body_derive,
    .initialise = body_initialise,
    .adopt = body_adopt,
    .drift = body_drift,
    .retract = body_retract,
    .in_world = body_in_world,
};
