// SPDX-License-Identifier: MIT
#include "filter/motion_first.h"

#include <string.h>

#include "camera/stereo.h"
#include "filter/covariance.h"
#include "filter/gate.h"
#include "filter/model.h"
#include "filter/polar.h"
#include "filter/slots.h"
#include "filter/tracks.h"
#include "lie/se3.h"
#include "linalg/dense.h"
#include "linalg/small.h"

enum {
    TRIALS = 4, /* of a better point; the start and a return to the best one come on top */
    FEW = 3,    /* fewer points say nothing that could be checked */
    MANY = 6    /* fewer are not believed against the twists */
};

/* Huber's limit on a whitened residual of three rows: beyond it an observation pulls no harder. */
#define HUBER PLR_R(2.5)
/* A step that promises less of the sum is not worth its evaluation. */
#define SMALL_GAIN PLR_R(0.1)
/* An observation speaks for one of two motions if its squared residuals differ by more. */
#define DECISIVE PLR_R(9)
/* It agrees with a motion if its squared residual is below this. */
#define AGREES PLR_R(16)
/* Points are well spread if together they leave no more of an open prior's variance in any direction. */
#define LEFT_OPEN PLR_R(0.25)
/* The least share, about, that a point may leave to the others in what is known of its own prediction.
 * Below it the point has made the motion what it is, and cannot be judged by it. */
#define LEAST_REST PLR_R(0.05)

/* One matched observation. */
typedef struct plr_sighting {
    plr_real V[18];     /* what the landmark shares with nu by the biases: P_(i,b) B^T L^-T, 3x6 */
    plr_real P[9];      /* the landmark's covariance once nu is known */
    plr_real U[2][6];   /* of S = J P J^T + R = U^T U: at the best point, and at the one on trial */
    plr_real a[18];     /* U^-T dz/dnu, 3x6, at the point evaluated last */
    plr_real rho[3];    /* U^-T r there */
    plr_real closer;    /* P J^T S^-1 r: by how much the observation changes its inverse range */
    plr_real weight;    /* Huber's: 1, and less for a large residual */
    plr_real cost;      /* Huber's rho at the best point */
    plr_real at_zero;   /* d^2 around the twists' prediction; negative: no place to linearise */
    plr_real gain;      /* det S there */
    plr_real voice;     /* 1: takes part in the search; 0: known, or barred */
    plr_real by_twists; /* |U^-T r|^2 where the twists have their say */
} plr_sighting;

/* The search for nu. */
typedef struct plr_search {
    plr_filter *f;
    const plr_frame *frame;
    plr_sighting *sightings; /* in work.Vt, which no one needs before the motion is applied */
    unsigned count;
    unsigned bank; /* of U at the best point */
    plr_applied_motion prior;
} plr_search;

/* The sum |z|^2 + sum of Huber's rho(|U^-T r|^2) at a point, and its derivatives. */
typedef struct plr_search_point {
    plr_real z[6];
    plr_real cost;
    plr_real J[21 + PLR_KERNEL_MARGIN]; /* sum of w a^T a, packed upper */
    plr_real b[6];                      /* sum of w a^T rho */
} plr_search_point;

static const plr_observation *observation_of(const plr_search *s, unsigned i) {
    const plr_workspace *w = &s->f->work;
    return &s->frame->observations[w->order[w->used[i]]];
}

static const plr_slot *slot_of(const plr_search *s, unsigned i) {
    const plr_workspace *w = &s->f->work;
    return &s->f->slots[w->slot_of[w->used[i]]];
}

static plr_real huber(plr_real d2) {
    return d2 <= HUBER * HUBER ? d2 : PLR_R(2) * HUBER * PLR_SQRT(d2) - HUBER * HUBER;
}

/* What does not change while nu is sought. */
static void prepare(plr_search *s, unsigned i) {
    plr_filter *f = s->f;
    plr_sighting *at = &s->sightings[i];
    const unsigned slot = f->work.slot_of[f->work.used[i]];
    plr_covariance_motion_share(f, plr_covariance_row(f, slot), 3, s->prior.K, at->V);
    plr_covariance_landmark(f, slot, at->P);
    for (unsigned r = 0; r < 3; r++)
        for (unsigned c = 0; c < 3; c++)
            for (unsigned k = 0; k < 6; k++)
                at->P[3 * r + c] = PLR_FMA(-at->V[6 * r + k], at->V[6 * c + k], at->P[3 * r + c]);
}

/* How the pixels of a landmark at q0, which the camera's motion (R, p) brings to q, depend on the chart
 * at q0 and on a twist of the body: J = Dz R^T Ji(q0), 3x3, and A = Dz [-I | [q]x] Ad(T_CB), 3x6. As in
 * model_body.c the products that vanish, here Dz q in the rows uL and v, are left out. */
static void differentiate(const plr_camera *camera, const plr_polar *chart, const plr_real R[9],
                          const plr_real p[3], const plr_real q[3], plr_real J[9], plr_real A[18]) {
    plr_real Dz[9], DzRt[9], DzR[9], s_B[3], S[9], DzRS[9];
    plr_stereo_jacobian(Dz, camera, q);
    plr_mat3_mul_nt(DzRt, Dz, R);
    for (int row = 0; row < 3; row++) {
        const plr_real along = row == 1 ? camera->fx * camera->baseline / q[2] : PLR_R(0);
        for (int column = 0; column < 2; column++) {
            const plr_real n[3] = {chart->N[column], chart->N[2 + column], chart->N[4 + column]};
            J[3 * row + column] = chart->r * plr_dot3(DzRt + 3 * row, n);
        }
        J[3 * row + 2] = -chart->r * (along + plr_dot3(DzRt + 3 * row, p));
    }
    plr_mat3_mul(DzR, Dz, camera->R_CB);
    plr_camera_to_body(s_B, camera, q);
    plr_skew(S, s_B);
    plr_mat3_mul(DzRS, DzR, S);
    for (int row = 0; row < 3; row++)
        for (int k = 0; k < 3; k++) {
            A[6 * row + k] = -DzR[3 * row + k];
            A[6 * row + 3 + k] = DzRS[3 * row + k];
        }
}

/* Does a single observation still make a part of what is known of a landmark's range? Of one that
 * has been seen often, the uncertainty is nearly all the camera's, common to all, and moving each by
 * itself would shift them against the pose. */
static bool depends_on_observation(const plr_filter *f, const plr_real J[9], const plr_real P[9]) {
    const plr_real by_range = J[2] - J[5];
    return by_range * by_range * P[8] > PLR_R(0.02) * f->par.pixel_variance;
}

/* One observation at a point: U of the trial bank, a and rho. False where nothing can be said. */
static bool evaluate_one(const plr_search *s, unsigned i, const plr_applied_motion *m,
                         const plr_real E[9], const plr_real p[3]) {
    const plr_camera *camera = &s->f->par.camera;
    const plr_slot *slot = slot_of(s, i);
    plr_sighting *at = &s->sightings[i];
    plr_linearisation lin;
    plr_polar chart;
    plr_real R[9], q[3], J[9], A[18], JP[9], full[9], dz[18] = {0}, shift[3] = {0};
    plr_real S[6];
    memcpy(q, slot->x, sizeof q);
    plr_se3_move_back(q, E, p);
    plr_se3_rotation(R, E);
    if (!(q[2] >= s->f->par.min_depth))
        return false;
    plr_polar_at(&chart, slot->x);
    plr_stereo_project(lin.z, camera, q);
    differentiate(camera, &chart, R, p, q, J, A);
    plr_mat3_mul(JP, J, at->P);
    plr_mat3_mul_nt(full, JP, J);
    for (unsigned r = 0, k = 0; r < 3; r++)
        for (unsigned c = r; c < 3; c++)
            S[k++] = full[3 * c + r] + (r == c ? plr_gate_noise(s->f, r) : PLR_R(0));
    if (!plr_cholesky3(S))
        return false;
    plr_gemm_nn(3, 6, 3, J, 3, at->V, 6, dz, 6);
    plr_gemm_nn(3, 1, 6, dz, 6, m->z, 1, shift, 1);
    for (unsigned r = 0; r < 3; r++)
        shift[r] = PLR_FMA(J[3 * r + 2], slot->beyond, shift[r]);
    plr_gemm_nn(3, 6, 6, A, 6, m->JL, 6, dz, 6);
    plr_gate_innovation(at->rho, observation_of(s, i), &lin);
    for (unsigned r = 0; r < 3; r++)
        at->rho[r] -= shift[r];
    memcpy(at->a, dz, sizeof at->a);
    plr_solve3_transposed(6, S, at->a);
    plr_solve3_transposed(1, S, at->rho);
    at->closer = 0;
    if (depends_on_observation(s->f, J, at->P)) {
        plr_solve3_transposed(3, S, JP);
        const plr_real column[3] = {JP[2], JP[5], JP[8]};
        at->closer = plr_dot3(column, at->rho);
    }
    memcpy(at->U[1 - s->bank], S, sizeof at->U[0]);
    return true;
}

/* |U^-T r|^2 with U of the best point, where r = U'^T rho is the residual of the one on trial. */
static plr_real in_best_measure(const plr_sighting *at, unsigned bank) {
    const plr_real *now = at->U[1 - bank];
    plr_real r[3] = {now[0] * at->rho[0], PLR_FMA(now[3], at->rho[1], now[1] * at->rho[0]),
                     PLR_FMA(now[5], at->rho[2], PLR_FMA(now[4], at->rho[1], now[2] * at->rho[0]))};
    plr_solve3_transposed(1, at->U[bank], r);
    return plr_dot3(r, r);
}

/* J += w a^T a, b += w a^T rho */
static void gather(const plr_sighting *at, plr_search_point *point) {
    plr_real *J = point->J;
    for (unsigned k = 0; k < 6; k++) {
        const plr_real column[3] = {at->a[k], at->a[6 + k], at->a[12 + k]};
        point->b[k] = PLR_FMA(at->weight, plr_dot3(column, at->rho), point->b[k]);
        for (unsigned l = k; l < 6; l++, J++) {
            const plr_real other[3] = {at->a[l], at->a[6 + l], at->a[12 + l]};
            *J = PLR_FMA(at->weight, plr_dot3(column, other), *J);
        }
    }
}

static plr_real norm2(const plr_real z[6]) {
    return plr_dot3(z, z) + plr_dot3(z + 3, z + 3);
}

/* All observations at nu = z. Returns by how much the sum is larger than at the best point, in that
 * point's measure. An observation that falls behind the camera is left out of the comparison. */
static plr_real evaluate(plr_search *s, const plr_real z[6], plr_search_point *point) {
    plr_applied_motion m;
    plr_real E[9], p[3], change = 0;
    plr_motion_at(s->f, &s->prior, z, &m);
    plr_camera_motion(E, p, &s->f->par.camera, m.E, m.p);
    memset(point, 0, sizeof *point);
    memcpy(point->z, z, sizeof point->z);
    point->cost = norm2(z);
    for (unsigned i = 0; i < s->count; i++) {
        plr_sighting *at = &s->sightings[i];
        at->weight = 0;
        if (!evaluate_one(s, i, &m, E, p)) {
            memcpy(at->U[1 - s->bank], at->U[s->bank], sizeof at->U[0]);
            continue;
        }
        const plr_real d2 = plr_dot3(at->rho, at->rho);
        at->weight = at->voice * (d2 <= HUBER * HUBER ? PLR_R(1) : HUBER / PLR_SQRT(d2));
        if (!(at->voice > 0))
            continue;
        point->cost += huber(d2);
        change += huber(in_best_measure(at, s->bank)) - at->cost;
        gather(at, point);
    }
    return change;
}

/* Makes the point evaluated last the best one. */
static void accept(plr_search *s) {
    s->bank = 1 - s->bank;
    for (unsigned i = 0; i < s->count; i++)
        s->sightings[i].cost = huber(plr_dot3(s->sightings[i].rho, s->sightings[i].rho));
}

/* U^T U = I + J + damping (I + diag J), packed upper; false if it cannot be factorised. */
static bool factorise(const plr_search_point *point, plr_real damping,
                      plr_real U[21 + PLR_KERNEL_MARGIN]) {
    memcpy(U, point->J, sizeof point->J);
    for (unsigned k = 0; k < 6; k++) {
        plr_real *diagonal = U + plr_upper_row(6, k);
        *diagonal = PLR_FMA(damping, PLR_R(1) + *diagonal, PLR_R(1) + *diagonal);
    }
    return plr_cholesky_upper(6, U);
}

/* The step from a point towards the least sum. Returns what it promises of the sum. */
static plr_real step(const plr_search_point *point, const plr_real *U, plr_real dz[6]) {
    plr_real gradient[6], promise = 0;
    for (unsigned k = 0; k < 6; k++)
        gradient[k] = dz[k] = point->b[k] - point->z[k];
    plr_solve_upper_transposed(6, 1, U, dz, 1);
    plr_solve_upper(6, U, dz);
    for (unsigned k = 0; k < 6; k++)
        promise = PLR_FMA(dz[k], gradient[k], promise);
    return promise;
}

/* May a motion be off by L z? As far as a retraction can follow. */
static bool is_within_reach(const plr_search *s, const plr_real z[6]) {
    static const plr_real way2 = 1e6, turn2 = 4;
    plr_real n[6] = {0};
    plr_gemm_nn(6, 1, 6, s->prior.L, 6, z, 1, n, 1);
    return plr_dot3(n, n) <= way2 && plr_dot3(n + 3, n + 3) <= turn2;
}

/* Levenberg and Marquardt from the best point on: a bounded number of trials, of which one is taken
 * only if the sum falls. */
static void descend(plr_search *s, plr_search_point *best) {
    plr_search_point trial;
    plr_real U[21 + PLR_KERNEL_MARGIN], damping = 0;
    bool at_best = true;
    for (int i = 0; i < TRIALS; i++) {
        plr_real z[6], dz[6];
        if (!factorise(best, damping, U) || !(step(best, U, dz) >= SMALL_GAIN))
            break;
        for (unsigned k = 0; k < 6; k++)
            z[k] = best->z[k] + dz[k];
        at_best = false;
        if (is_within_reach(s, z)) {
            const plr_real change = evaluate(s, z, &trial) + norm2(z) - norm2(best->z);
            if (change < 0) {
                *best = trial;
                accept(s);
                at_best = true;
                damping *= PLR_R(0.1);
                continue;
            }
        }
        damping = damping > 0 ? PLR_R(10) * damping : PLR_R(0.01);
    }
    if (!at_best) { /* a and rho are those of a point that was not taken */
        const plr_search_point kept = *best;
        (void)evaluate(s, kept.z, best);
        accept(s);
    }
}

/* What the twists alone say of an observation: d^2 with nu's whole uncertainty, and det S. */
static void judge_at_zero(plr_search *s, unsigned i) {
    plr_sighting *at = &s->sightings[i];
    const plr_real *U = at->U[s->bank];
    plr_real M[6], x[3];
    plr_real limit = s->f->par.camera.fx * s->f->par.camera.fx;
    bool basis = true;
    for (unsigned r = 0, k = 0; r < 3; r++)
        for (unsigned c = r; c < 3; c++, k++) {
            M[k] = plr_dot3(at->a + 6 * r, at->a + 6 * c) +
                   plr_dot3(at->a + 6 * r + 3, at->a + 6 * c + 3) + (r == c ? PLR_R(1) : PLR_R(0));
        }
    for (unsigned r = 0; r < 3; r++) { /* the diagonal of U^T M U - R */
        plr_real u[3] = {0}, sum = 0;
        for (unsigned k = 0; k <= r; k++)
            u[k] = U[plr_upper_row(3, k) + r - k];
        for (unsigned k = 0; k < 3; k++)
            for (unsigned l = 0; l < 3; l++)
                sum += u[k] * u[l] *
                       M[k <= l ? plr_upper_row(3, k) + l - k : plr_upper_row(3, l) + k - l];
        basis = basis && sum - plr_gate_noise(s->f, r) <= limit;
    }
    at->at_zero = -1;
    if ((!basis && !slot_of(s, i)->known) || !plr_cholesky3(M)) {
        at->voice = 0;
        return;
    }
    memcpy(x, at->rho, sizeof x);
    plr_solve3_transposed(1, M, x);
    at->at_zero = plr_dot3(x, x);
    const plr_real root = U[0] * U[3] * U[5] * M[0] * M[3] * M[5];
    at->gain = root * root;
}

/* d^2 of an observation by what all the others say: with h = a (I + J)^-1 a^T and the weight w that it
 * had in J, e^T [(I - w h)(I + (1 - w) h)]^-1 e. `rest` is the least share left to the others. */
static plr_real left_out(const plr_sighting *at, const plr_real *U, const plr_real dz[6],
                         plr_real e[3], plr_real *rest) {
    plr_real X[18], h[9], M[6];
    const plr_real w = at->weight;
    for (unsigned r = 0; r < 3; r++) {
        e[r] = at->rho[r];
        for (unsigned k = 0; k < 6; k++) {
            e[r] = PLR_FMA(-at->a[6 * r + k], dz[k], e[r]);
            X[3 * k + r] = at->a[6 * r + k];
        }
    }
    plr_solve_upper_transposed(6, 3, U, X, 3);
    for (unsigned r = 0; r < 3; r++)
        for (unsigned c = 0; c < 3; c++) {
            h[3 * r + c] = 0;
            for (unsigned k = 0; k < 6; k++)
                h[3 * r + c] = PLR_FMA(X[3 * k + r], X[3 * k + c], h[3 * r + c]);
        }
    for (unsigned r = 0, k = 0; r < 3; r++)
        for (unsigned c = r; c < 3; c++, k++) {
            const plr_real hh = plr_dot3(h + 3 * r, h + 3 * c);
            M[k] = (r == c ? PLR_R(1) : PLR_R(0)) + (PLR_R(1) - PLR_R(2) * w) * h[3 * r + c] -
                   w * (PLR_R(1) - w) * hh;
        }
    *rest = 0;
    if (!plr_cholesky3(M))
        return 0;
    *rest = M[0] < M[3] ? M[0] : M[3];
    *rest = *rest < M[5] ? *rest : M[5];
    *rest *= *rest;
    plr_solve3_transposed(1, M, e);
    return plr_dot3(e, e);
}

/* The squared norm of the four residuals at the point evaluated last, for the course's gate. */
static plr_real residual_norm2(const plr_search *s, unsigned i, plr_real row_gap) {
    const plr_sighting *at = &s->sightings[i];
    const plr_real *U = at->U[s->bank];
    const plr_real r[3] = {U[0] * at->rho[0], PLR_FMA(U[3], at->rho[1], U[1] * at->rho[0]),
                           PLR_FMA(U[5], at->rho[2], PLR_FMA(U[4], at->rho[1], U[2] * at->rho[0]))};
    /* vL and vR lie half the gap to both sides of v */
    return plr_dot3(r, r) + r[2] * r[2] + PLR_R(0.5) * row_gap * row_gap;
}

static bool judge(plr_search *s, unsigned i, bool found, const plr_real *U, const plr_real dz[6],
                  float *nis) {
    const plr_parameters *par = &s->f->par;
    const plr_sighting *at = &s->sightings[i];
    const plr_observation *o = observation_of(s, i);
    const plr_real row_gap = (plr_real)o->vL_px - (plr_real)o->vR_px;
    plr_real d2 = at->at_zero, e[3], rest = 0;
    if (!(d2 >= 0))
        return false;
    if (found) {
        const plr_real by_others = left_out(at, U, dz, e, &rest);
        d2 = rest >= LEAST_REST ? by_others : d2;
    }
    d2 += row_gap * row_gap / (PLR_R(2) * par->pixel_variance);
    const bool accepted = plr_gate_accepts(s->f, d2, residual_norm2(s, i, row_gap));
    plr_slot *slot = &s->f->slots[s->f->work.slot_of[s->f->work.used[i]]];
    if (accepted && rest >= LEAST_REST)
        plr_track_add(slot, e);
    if (!accepted || slot->strays)
        return false;
    *nis += (float)d2;
    return true;
}

/* Have so many observations little weight that another motion may fit them better? */
static bool is_suspicious(const plr_search *s, const plr_search_point *best) {
    plr_real voices = 0, weight = 0;
    for (unsigned i = 0; i < s->count; i++) {
        voices += s->sightings[i].voice;
        weight += s->sightings[i].weight;
    }
    return weight < PLR_R(0.7) * voices || norm2(best->z) > PLR_R(36);
}

/* Do the observations leave no direction of the motion open? */
static bool is_well_spread(const plr_search_point *point) {
    plr_real U[21 + PLR_KERNEL_MARGIN] = {0}, C[36] = {0};
    if (!factorise(point, 0, U))
        return false;
    for (unsigned k = 0; k < 6; k++)
        C[7 * k] = 1;
    plr_solve_upper_transposed(6, 6, U, C, 6);
    for (unsigned k = 0; k < 6; k++) {
        plr_real left = 0;
        for (unsigned r = 0; r < 6; r++)
            left = PLR_FMA(C[6 * r + k], C[6 * r + k], left);
        if (left > LEFT_OPEN)
            return false;
    }
    return true;
}

/* Do at least three of the observations, and four times as many as for the twists, speak for the other
 * motion, and do three fifths of at least six, well spread, agree on it? */
static bool speaks_against_twists(const plr_search *s, const plr_search_point *open) {
    unsigned with = 0, against = 0, agree = 0, voices = 0;
    for (unsigned i = 0; i < s->count; i++) {
        const plr_sighting *at = &s->sightings[i];
        const plr_real d2 = plr_dot3(at->rho, at->rho);
        if (!(at->voice > 0))
            continue;
        voices++;
        agree += d2 < AGREES;
        against += at->by_twists > d2 + DECISIVE;
        with += d2 > at->by_twists + DECISIVE;
    }
    return against >= FEW && 4 * with <= against && 5 * agree >= 3 * voices && voices >= MANY &&
           is_well_spread(open);
}

static void search_from_zero(plr_search *s, plr_search_point *best) {
    static const plr_real zero[6] = {0};
    for (unsigned i = 0; i < s->count; i++)
        prepare(s, i);
    (void)evaluate(s, zero, best);
    accept(s);
}

/* Where the observations may contradict the twists, they are asked again with the twists' word left out.
 * True, with the search at their motion, if they agree on one that the twists exclude; else the search
 * is as it was. */
static bool contradicts(plr_search *s, plr_search_point *best) {
    const plr_applied_motion believed = s->prior;
    plr_search_point open;
    for (unsigned i = 0; i < s->count; i++)
        s->sightings[i].by_twists = plr_dot3(s->sightings[i].rho, s->sightings[i].rho);
    plr_motion_open_prior(s->f, &s->prior);
    search_from_zero(s, &open);
    for (unsigned i = 0; i < 2; i++)
        descend(s, &open);
    if (speaks_against_twists(s, &open)) {
        *best = open;
        return true;
    }
    const plr_search_point kept = *best;
    s->prior = believed;
    for (unsigned i = 0; i < s->count; i++)
        prepare(s, i);
    (void)evaluate(s, kept.z, best);
    accept(s);
    return false;
}

/* Of one or two points none can be checked by the others: only those have a voice that the twists'
 * prediction lets through the gate. */
static void hush_outliers(plr_search *s, plr_search_point *best) {
    for (unsigned i = 0; i < s->count; i++)
        if (!plr_gate_accepts(s->f, s->sightings[i].at_zero, 0))
            s->sightings[i].voice = 0;
    search_from_zero(s, best);
}

void plr_motion_find(plr_filter *f, const plr_frame *frame, unsigned n, plr_motion_first *first,
                     float *nis) {
    plr_search s = {.f = f, .frame = frame, .sightings = (plr_sighting *)(void *)f->work.Vt};
    plr_search_point best;
    plr_real U[21 + PLR_KERNEL_MARGIN] = {0}, dz[6] = {0};
    unsigned voices = 0;
    plr_motion_prior(f, &s.prior);
    for (unsigned k = 0; k < n; k++)
        if (f->work.slot_of[k] != PLR_NO_SLOT) {
            f->work.used[s.count] = (uint16_t)k;
            memset(&s.sightings[s.count], 0, sizeof *s.sightings);
            s.sightings[s.count++].voice = f->slots[f->work.slot_of[k]].known ? 0 : 1;
        }
    search_from_zero(&s, &best);
    for (unsigned i = 0; i < s.count; i++) {
        if (s.sightings[i].weight > 0 || slot_of(&s, i)->known)
            judge_at_zero(&s, i);
        else
            s.sightings[i].at_zero = -1;
        voices += s.sightings[i].voice > 0;
    }
    first->found = voices >= FEW;
    if (voices < FEW)
        hush_outliers(&s, &best);
    if (voices > 0)
        descend(&s, &best);
    first->contradicted = first->found && is_suspicious(&s, &best) && contradicts(&s, &best);
    first->found = first->found && factorise(&best, 0, U);
    if (first->found)
        (void)step(&best, U, dz);
    plr_motion_at(f, &s.prior, best.z, &first->motion);
    memset(f->work.noise.closer, 0, f->count * sizeof *f->work.noise.closer);
    for (unsigned i = 0; i < s.count; i++) {
        const bool accepted = judge(&s, i, first->found, U, dz, nis);
        f->work.gain[f->work.used[i]] = accepted ? s.sightings[i].gain : PLR_R(-1);
        if (accepted)
            f->work.noise.closer[slot_of(&s, i) - f->slots] = s.sightings[i].closer;
    }
}
