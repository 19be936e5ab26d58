// SPDX-License-Identifier: MIT
#include "filter/search.h"

#include <string.h>

#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "sensor/stereo.h"
#include "state/camera.h"
#include "state/covariance.h"
#include "state/motion.h"

enum {
    TRIALS = 4, /* besides the evaluations at the start and, if needed, of the best point again */
    CONCENTRATIONS = 2
};

/* Huber's limit on the norm of a whitened residual: beyond it the pull on the motion stays
 * constant. */
#define HUBER PLR_R(2.5)
/* A step that should lower the cost by less is not evaluated. */
#define MIN_DECREASE PLR_R(0.1)

static plr_real huber(plr_real d2) {
    return d2 <= HUBER * HUBER ? d2 : PLR_R(2) * HUBER * PLR_SQRT(d2) - HUBER * HUBER;
}

/* V and P of one residual, which do not change during the search. */
static void prepare(plr_search *s, unsigned i, const plr_real Kt[PLR_MOTION_BY]) {
    plr_filter *f = s->f;
    plr_residual *at = &s->residuals[i];
    const unsigned slot = plr_search_row(s, i)->slot;
    plr_covariance_motion_share(&f->belief, plr_covariance_row(&f->belief, slot), Kt, at->V);
    plr_covariance_landmark(&f->belief, slot, at->P);
    for (unsigned r = 0; r < 3; r++)
        for (unsigned c = 0; c < 3; c++)
            for (unsigned k = 0; k < PLR_POSE_DIM; k++)
                at->P[3 * r + c] = PLR_FMA(-at->V[PLR_POSE_DIM * r + k],
                                           at->V[PLR_POSE_DIM * c + k], at->P[3 * r + c]);
}

/* dq/dnu = [-I | [q]x] N, 3x6, with N = Ad(T_CB) JL. */
static void point_by_motion(const plr_real q[3], const plr_real N[PLR_POSE_SQUARE],
                            plr_real dq[PLR_ROWS * PLR_POSE_DIM]) {
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        const plr_real turn[3] = {N[3 * PLR_POSE_DIM + k], N[4 * PLR_POSE_DIM + k],
                                  N[5 * PLR_POSE_DIM + k]};
        plr_real lever[3];
        plr_cross3(lever, q, turn);
        for (unsigned i = 0; i < 3; i++)
            dq[PLR_POSE_DIM * i + k] = lever[i] - N[PLR_POSE_DIM * i + k];
    }
}

/* The camera's motion at a point of the search. */
typedef struct plr_camera_step {
    plr_real z[PLR_POSE_DIM];
    plr_real R[9], E[9], p[3];   /* R = I + E */
    plr_real N[PLR_POSE_SQUARE]; /* the camera's motion by nu: Ad(T_CB) JL, 6x6 */
} plr_camera_step;

static void step_to(const plr_search *s, const plr_real z[PLR_POSE_DIM], plr_camera_step *step) {
    plr_applied_motion m;
    plr_motion_at(&s->f->motion, &s->prior, z, &m);
    plr_camera_motion(step->E, step->p, &s->f->camera.given, m.E, m.p);
    plr_se3_rotation(step->R, step->E);
    memcpy(step->z, z, sizeof step->z);
    plr_mat6_mul(step->N, s->f->camera.Ad_CB, m.JL);
}

/* Evaluates one observation at a point: U on trial, a and e. False if it cannot be predicted
 * there. */
static bool evaluate_one(const plr_search *s, unsigned i, const plr_camera_step *step) {
    const plr_slot *slot = plr_search_slot(s, i);
    const plr_observation *seen = plr_search_row(s, i)->seen;
    const plr_camera_model *camera = &s->f->camera;
    plr_residual *at = &s->residuals[i];
    plr_stereo_prediction sight;
    plr_real dq[PLR_ROWS * PLR_POSE_DIM], JP[9], full[9], dz[PLR_ROWS * PLR_POSE_DIM] = {0},
                                                                        shift[3] = {0};
    plr_real S[6], R[PLR_ROWS];
    if (!plr_stereo_predict_after(camera, slot, seen, step->E, step->R, step->p, &sight))
        return false;
    const plr_real *J = sight.J;
    plr_stereo_variances(camera, seen, R);
    plr_mat3_mul(JP, J, at->P);
    plr_mat3_mul_nt(full, JP, J);
    for (unsigned r = 0, k = 0; r < 3; r++)
        for (unsigned c = r; c < 3; c++)
            S[k++] = full[3 * c + r] + (r == c ? R[r] : PLR_R(0));
    if (!plr_cholesky3(S))
        return false;
    plr_gemm_nn(3, PLR_POSE_DIM, 3, J, 3, at->V, PLR_POSE_DIM, dz, PLR_POSE_DIM);
    plr_gemm_nn(3, 1, PLR_POSE_DIM, dz, PLR_POSE_DIM, step->z, 1, shift, 1);
    for (unsigned r = 0; r < 3; r++)
        shift[r] = PLR_FMA(J[3 * r + 2], slot->beyond, shift[r]);
    point_by_motion(sight.q, step->N, dq);
    plr_gemm_nn(3, PLR_POSE_DIM, 3, sight.Dz, 3, dq, PLR_POSE_DIM, dz, PLR_POSE_DIM);
    for (unsigned r = 0; r < 3; r++)
        at->e[r] = sight.r[r] - shift[r];
    memcpy(at->a, dz, sizeof at->a);
    plr_solve3_transposed(PLR_POSE_DIM, S, at->a);
    plr_solve3_transposed(1, S, at->e);
    at->range_change = 0;
    at->range_variance = at->P[8];
    if (plr_stereo_improves_range(camera, seen, J, at->P)) {
        plr_solve3_transposed(3, S, JP);
        const plr_real column[3] = {JP[2], JP[5], JP[8]};
        at->range_change = plr_dot3(column, at->e);
        at->range_variance -= plr_dot3(column, column);
    }
    memcpy(at->U[1 - s->current], S, sizeof at->U[0]);
    return true;
}

/* |U^-T r|^2 with U of the best point and the residual r = U'^T e of the point on trial. */
static plr_real d2_by_best_covariance(const plr_residual *at, unsigned best) {
    plr_real r[3];
    plr_multiply3_transposed(r, at->U[1 - best], at->e);
    plr_solve3_transposed(1, at->U[best], r);
    return plr_dot3(r, r);
}

/* J += w a^T a, b += w a^T e, with Huber's weight. */
static void add_to_sums(plr_residual *at, plr_search_point *point) {
    const plr_real d2 = plr_dot3(at->e, at->e);
    plr_real *J = point->J;
    at->weight = d2 <= HUBER * HUBER ? PLR_R(1) : HUBER / PLR_SQRT(d2);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        const plr_real column[3] = {at->a[k], at->a[PLR_POSE_DIM + k], at->a[2 * PLR_POSE_DIM + k]};
        point->b[k] = PLR_FMA(at->weight, plr_dot3(column, at->e), point->b[k]);
        for (unsigned l = k; l < PLR_POSE_DIM; l++, J++) {
            const plr_real other[3] = {at->a[l], at->a[PLR_POSE_DIM + l],
                                       at->a[2 * PLR_POSE_DIM + l]};
            *J = PLR_FMA(at->weight, plr_dot3(column, other), *J);
        }
    }
}

void plr_search_add(plr_search *s, unsigned row, plr_real active) {
    static const plr_real identity[6] = {1, 0, 0, 1, 0, 1};
    PLR_ASSERT(s->count < s->f->belief.count && plr_is_matched(&s->sightings->at[row]));
    plr_residual *at = &s->residuals[s->count++];
    at->row = (uint16_t)row;
    memcpy(at->U[s->current], identity, sizeof at->U[0]);
    at->active = active;
    at->trimmed = false;
    at->cost = at->twist_d2 = 0;
}

void plr_search_prepare(plr_search *s) {
    plr_real K[PLR_MOTION_BY], Kt[PLR_MOTION_BY];
    plr_motion_by_drivers(&s->f->belief, &s->f->motion, s->prior.L, K);
    plr_motion_transpose(K, Kt);
    for (unsigned i = 0; i < s->count; i++)
        prepare(s, i, Kt);
}

/* Evaluates all observations at nu = z. Returns by how much the cost of the observations is larger
 * than at the best point, both with the S of the best point. An observation whose landmark comes to
 * lie behind the camera is left out of the comparison. */
static plr_real evaluate(plr_search *s, const plr_real z[PLR_POSE_DIM], plr_search_point *point) {
    plr_camera_step step;
    plr_real change = 0;
    step_to(s, z, &step);
    memset(point, 0, sizeof *point);
    memcpy(point->z, z, sizeof point->z);
    for (unsigned i = 0; i < s->count; i++) {
        plr_residual *at = &s->residuals[i];
        at->weight = 0;
        at->behind = !evaluate_one(s, i, &step);
        if (at->behind) {
            memcpy(at->U[1 - s->current], at->U[s->current], sizeof at->U[0]);
            continue;
        }
        if (!(at->active > 0) || at->trimmed)
            continue;
        change += huber(d2_by_best_covariance(at, s->current)) - at->cost;
        add_to_sums(at, point);
    }
    return change;
}

/* Makes the point evaluated last the best one. */
static void accept(plr_search *s) {
    s->current = 1 - s->current;
    for (unsigned i = 0; i < s->count; i++)
        s->residuals[i].cost = huber(plr_dot3(s->residuals[i].e, s->residuals[i].e));
}

void plr_search_go_to(plr_search *s, const plr_real z[PLR_POSE_DIM], plr_search_point *best) {
    (void)evaluate(s, z, best);
    accept(s);
}

void plr_search_again(plr_search *s, plr_search_point *best) {
    const plr_search_point kept = *best;
    plr_search_go_to(s, kept.z, best);
}

bool plr_search_factorise(const plr_search_point *point, plr_real damping,
                          plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN]) {
    memcpy(U, point->J, sizeof point->J);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        plr_real *diagonal = U + plr_upper_row(PLR_POSE_DIM, k);
        *diagonal = PLR_FMA(damping, PLR_R(1) + *diagonal, PLR_R(1) + *diagonal);
    }
    return plr_cholesky_upper(PLR_POSE_DIM, U);
}

plr_real plr_search_step(const plr_search_point *point, const plr_real *U,
                         plr_real dz[PLR_POSE_DIM]) {
    plr_real gradient[PLR_POSE_DIM], decrease = 0;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        gradient[k] = dz[k] = point->b[k] - point->z[k];
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, dz, 1);
    plr_solve_upper(PLR_POSE_DIM, U, dz);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        decrease = PLR_FMA(dz[k], gradient[k], decrease);
    return decrease;
}

/* True if L z is small enough for a retraction: 1 km and 2 rad. */
static bool is_representable(const plr_search *s, const plr_real z[PLR_POSE_DIM]) {
    static const plr_real way2 = 1e6, turn2 = 4;
    plr_real n[PLR_POSE_DIM];
    plr_mat6_vec(n, s->prior.L, z);
    return plr_dot3(n, n) <= way2 && plr_dot3(n + 3, n + 3) <= turn2;
}

void plr_search_descend(plr_search *s, plr_search_point *best) {
    plr_search_point trial;
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN], damping = 0;
    bool is_at_best = true;
    for (int i = 0; i < TRIALS; i++) {
        plr_real z[PLR_POSE_DIM], dz[PLR_POSE_DIM];
        if (!plr_search_factorise(best, damping, U) ||
            !(plr_search_step(best, U, dz) >= MIN_DECREASE))
            break;
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            z[k] = best->z[k] + dz[k];
        is_at_best = false;
        if (is_representable(s, z)) {
            const plr_real change =
                evaluate(s, z, &trial) + plr_norm2_of_6(z) - plr_norm2_of_6(best->z);
            if (change < 0) {
                *best = trial;
                accept(s);
                is_at_best = true;
                damping *= PLR_R(0.1);
                continue;
            }
        }
        damping = damping > 0 ? PLR_R(10) * damping : PLR_R(0.01);
    }
    if (!is_at_best) /* a and e are those of a trial that was not accepted */
        plr_search_again(s, best);
}

/* Of those that take part, how many fit the best point better than residual i. */
static unsigned count_better(const plr_search *s, unsigned i) {
    const plr_real cost = s->residuals[i].cost;
    unsigned better = 0;
    for (unsigned j = 0; j < s->count; j++) {
        const plr_residual *other = &s->residuals[j];
        better += other->active > 0 && (other->cost < cost || (other->cost <= cost && j < i));
    }
    return better;
}

/* Compares all pairs: they are few, and it is done seldom. */
static void trim_worst(plr_search *s) {
    unsigned active = 0;
    for (unsigned i = 0; i < s->count; i++)
        active += s->residuals[i].active > 0;
    for (unsigned i = 0; i < s->count; i++)
        s->residuals[i].trimmed = s->residuals[i].behind || 5 * count_better(s, i) >= 3 * active;
}

void plr_search_concentrate(plr_search *s, plr_search_point *best) {
    for (unsigned again = 0; again < CONCENTRATIONS; again++) {
        trim_worst(s);
        plr_search_again(s, best);
        plr_search_descend(s, best);
    }
    for (unsigned i = 0; i < s->count; i++)
        s->residuals[i].trimmed = false;
    plr_search_again(s, best);
}

void plr_search_without_trimmed(plr_search *s, plr_search_point *best) {
    memset(best->J, 0, sizeof best->J);
    memset(best->b, 0, sizeof best->b);
    for (unsigned i = 0; i < s->count; i++) {
        plr_residual *at = &s->residuals[i];
        at->weight = 0;
        if (at->active > 0 && !at->trimmed && !at->behind)
            add_to_sums(at, best);
    }
    plr_search_descend(s, best);
}

void plr_search_from_zero(plr_search *s, plr_search_point *best) {
    static const plr_real zero[PLR_POSE_DIM] = {0};
    plr_search_prepare(s);
    plr_search_go_to(s, zero, best);
}
