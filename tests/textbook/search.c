// SPDX-License-Identifier: MIT
#include "textbook/search.h"

#include <math.h>
#include <string.h>

#include "support/oracle.h"
#include "support/rigid.h"
#include "textbook/body.h"
#include "textbook/observe.h"

enum { TRIALS = 4, AGAIN = 2, FEW = 3, ENOUGH = 6, BIAS = 6 };

/* Below this share of a pixel's variance an observation says nothing of a range. */
static const double least_range_share = 0.02;

static const double huber_limit = 2.5, least_promise = 0.1, least_rest = 0.05;
static const double share_of_bias = 1e-4, zero_column = 1e-6;

typedef textbook_sighting sight;

typedef struct search {
    const textbook *t;
    const double *L;
    unsigned count;
    sight *sights;
} search;

/* |z|^2 + sum rho, and its normal equations. */
typedef struct sum {
    double z[6], A[36], b[6]; /* A = sum w a^T a, b = sum w a^T rho */
} sum;

static double dot(const double *a, const double *b, unsigned n) {
    double s = 0;
    for (unsigned i = 0; i < n; i++)
        s += a[i] * b[i];
    return s;
}

static double huber(double d2) {
    return d2 <= huber_limit * huber_limit ? d2
                                           : 2 * huber_limit * sqrt(d2) - huber_limit * huber_limit;
}

/* ---------------------------------------------------------------- the prior */

static void factorise(const double M[36], double L[36]) {
    memset(L, 0, 36 * sizeof *L);
    for (unsigned k = 0; k < 6; k++) {
        const double pivot = M[7 * k] - dot(L + 6 * k, L + 6 * k, k);
        for (unsigned i = k; i < 6 && pivot > zero_column * M[7 * k]; i++)
            L[6 * i + k] = (M[6 * i + k] - dot(L + 6 * i, L + 6 * k, k)) / sqrt(pivot);
    }
}

void search_prior(const textbook *t, double L[36]) {
    double M[36], P_b[36], C_b[36], X[36], by_bias[36] = {0};
    memcpy(M, t->M, sizeof M);
    if (t->config.bias) { /* Cov(n, b) P_bb^-1 Cov(b, n) is what n has from the biases */
        for (unsigned i = 0; i < 36; i++)
            P_b[i] = textbook_covariance(t, BIAS + i / 6, BIAS + i % 6);
        memcpy(C_b, t->C + 6 * BIAS, sizeof C_b);
        memcpy(X, C_b, sizeof X);
        if (oracle_solve_spd(6, 6, P_b, X))
            oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, 6, 6, 6, share_of_bias, C_b, X, 0,
                        by_bias);
    }
    for (unsigned i = 0; i < 36; i++)
        M[i] += by_bias[i];
    factorise(M, L);
}

/* x <- L^-1 x, with a zero where L has a zero column. */
static void solve_lower(const double L[36], double x[6]) {
    for (unsigned k = 0; k < 6; k++)
        x[k] = L[7 * k] > 0 ? (x[k] - dot(L + 6 * k, x, k)) / L[7 * k] : 0;
}

/* ---------------------------------------------------------------- the sum at a point */

/* q of the landmarks' places and the rotation there, after D Exp(L z). */
static void camera_motion(const search *s, const double z[6], double back[16], double JL[36]) {
    double n[6], Jr[36], E[16], D[16], T_BC[16], CD[16], D_C[16];
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, 1, 6, 1, s->L, z, 0, n);
    rigid_exp(E, n);
    rigid_right_jacobian(Jr, n);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, 6, 6, 1, Jr, s->L, 0, JL);
    square_multiply(4, s->t->D, E, D);
    rigid_inverse(T_BC, s->t->T_CB);
    square_multiply(4, s->t->T_CB, D, CD);
    square_multiply(4, CD, T_BC, D_C);
    rigid_inverse(back, D_C);
}

static void look(const search *s, sight *at, const double z[6], const double back[16],
                 const double JL[36]) {
    const textbook *t = s->t;
    const double s2 = t->config.pixel_sigma_px * t->config.pixel_sigma_px;
    double q[3], seen[3], Dz[9], R[9], K[18], KJL[18], L_S[9], beyond[3];
    rigid_apply(q, back, t->landmarks[at->landmark].x);
    at->in_front = q[2] >= t->config.min_depth_m;
    if (!at->in_front)
        return;
    observe_project3(&t->camera, q, seen, Dz);
    rigid_rotation(R, back);
    square_multiply(3, Dz, R, at->J);
    oracle_sandwich(3, 3, at->J, at->P, at->S);
    for (unsigned i = 0; i < 3; i++)
        at->S[4 * i] += i == 2 ? s2 / 2 : s2;
    observe_camera_by_pose(t, q, K);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 6, 1, K, JL, 0, KJL);
    double JV[18], pixels[3] = {(double)at->o->uL_px, (double)at->o->uR_px,
                                ((double)at->o->vL_px + (double)at->o->vR_px) / 2};
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 3, 1, at->J, at->V, 0, JV);
    body_beyond(&t->landmarks[at->landmark], beyond);
    for (unsigned i = 0; i < 3; i++)
        at->rho[i] = pixels[i] - seen[i] - dot(JV + 6 * i, z, 6) - dot(at->J + 3 * i, beyond, 3);
    memcpy(at->a, JV, sizeof JV);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 3, 1, Dz, KJL, 1, at->a);
    memcpy(L_S, at->S, sizeof L_S);
    (void)oracle_cholesky(3, L_S);
    oracle_solve_lower(3, 6, L_S, at->a);
    oracle_solve_lower(3, 1, L_S, at->rho);
}

/* r^T S^-1 r with S of the best point, r = the residual of the point looked at last. */
static double d2_by_best_covariance(const sight *at) {
    double L_now[9], L_best[9], r[3];
    memcpy(L_now, at->S, sizeof L_now);
    memcpy(L_best, at->best_S, sizeof L_best);
    (void)oracle_cholesky(3, L_now);
    (void)oracle_cholesky(3, L_best);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 3, 1, L_now, at->rho, 0, r);
    oracle_solve_lower(3, 1, L_best, r);
    return dot(r, r, 3);
}

/* A += w a^T a, b += w a^T rho. */
static void add(const sight *at, double weight, double A[36], double b[6]) {
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, 6, 6, 3, weight, at->a, at->a, 1, A);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, 6, 1, 3, weight, at->a, at->rho, 1, b);
}

/* Looks at all from z; returns by how much the residuals' share of the sum is larger than at the best
 * point, in that point's measure. */
static double evaluate(search *s, const double z[6], sum *point) {
    double back[16], JL[36], change = 0;
    camera_motion(s, z, back, JL);
    memset(point, 0, sizeof *point);
    memcpy(point->z, z, sizeof point->z);
    for (unsigned i = 0; i < s->count; i++) {
        sight *at = &s->sights[i];
        look(s, at, z, back, JL);
        const double d2 = dot(at->rho, at->rho, 3);
        const double takes_part = at->in_front && !at->left_out ? at->active : 0;
        at->weight = takes_part * (sqrt(d2) <= huber_limit ? 1 : huber_limit / sqrt(d2));
        if (!(at->weight > 0))
            continue;
        change += huber(d2_by_best_covariance(at)) - at->cost;
        add(at, at->weight, point->A, point->b);
    }
    return change;
}

static void accept(search *s) {
    for (unsigned i = 0; i < s->count; i++) {
        sight *at = &s->sights[i];
        at->cost = huber(dot(at->rho, at->rho, 3));
        memcpy(at->best_S, at->S, sizeof at->S);
    }
}

/* ---------------------------------------------------------------- the search */

/* dz of (I + A + damping (I + diag A)) dz = b - z; returns what it promises of the sum. */
static double step(const sum *point, double damping, double dz[6]) {
    double N[36], gradient[6];
    memcpy(N, point->A, sizeof N);
    for (unsigned k = 0; k < 6; k++) {
        N[7 * k] = (1 + N[7 * k]) * (1 + damping);
        gradient[k] = dz[k] = point->b[k] - point->z[k];
    }
    return oracle_solve_spd(6, 1, N, dz) ? dot(dz, gradient, 6) : 0;
}

static bool is_representable(const double L[36], const double z[6]) {
    double n[6];
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 6, 1, 6, 1, L, z, 0, n);
    return sqrt(dot(n, n, 3)) <= 1000 && sqrt(dot(n + 3, n + 3, 3)) <= 2;
}

static void descend(search *s, sum *best) {
    double damping = 0;
    for (int i = 0; i < TRIALS; i++) {
        double z[6], dz[6];
        sum trial;
        if (!(step(best, damping, dz) >= least_promise))
            break;
        for (unsigned k = 0; k < 6; k++)
            z[k] = best->z[k] + dz[k];
        if (is_representable(s->L, z) &&
            evaluate(s, z, &trial) + dot(z, z, 6) < dot(best->z, best->z, 6)) {
            *best = trial;
            accept(s);
            damping *= 0.1;
        } else {
            damping = damping > 0 ? 10 * damping : 0.01;
        }
    }
    const sum kept = *best; /* a trial that was not taken may have been looked at last */
    (void)evaluate(s, kept.z, best);
    accept(s);
}

/* ---------------------------------------------------------------- verdicts */

/* (rho - a dz)^T (I + a N^-1 a^T)^-1 (rho - a dz) with N = I + A, dz = N^-1 (b - z). */
static double distance2(const sight *at, const double A[36], const double b[6], const double z[6]) {
    double N[36], X[36 + 6], M[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, e[3], x[3];
    memcpy(N, A, sizeof N);
    for (unsigned k = 0; k < 6; k++)
        N[7 * k] += 1;
    for (unsigned k = 0; k < 6; k++) { /* columns: a^T and b - z */
        for (unsigned r = 0; r < 3; r++)
            X[4 * k + r] = at->a[6 * r + k];
        X[4 * k + 3] = b[k] - z[k];
    }
    if (!oracle_solve_spd(6, 4, N, X))
        return (double)INFINITY;
    for (unsigned r = 0; r < 3; r++) {
        e[r] = at->rho[r];
        for (unsigned k = 0; k < 6; k++) {
            e[r] -= at->a[6 * r + k] * X[4 * k + 3];
            for (unsigned c = 0; c < 3; c++)
                M[3 * r + c] += at->a[6 * r + k] * X[4 * k + c];
        }
    }
    memcpy(x, e, sizeof x);
    return oracle_solve_spd(3, 1, M, x) ? dot(e, x, 3) : (double)INFINITY;
}

/* What the twists alone say: no observation in A and b. */
static void judge_by_prior(const search *s, sight *at) {
    static const double none[36] = {0};
    const double s2 = s->t->config.pixel_sigma_px * s->t->config.pixel_sigma_px;
    const double limit = s->t->camera.fx_px * s->t->camera.fx_px;
    double L_S[9], La[18];
    at->prior_d2 = (double)INFINITY;
    if (!at->in_front) {
        at->active = 0;
        return;
    }
    memcpy(L_S, at->S, sizeof L_S);
    (void)oracle_cholesky(3, L_S);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 3, 1, L_S, at->a, 0, La);
    for (unsigned r = 0; r < 3; r++)
        if (at->S[4 * r] + dot(La + 6 * r, La + 6 * r, 6) - (r == 2 ? s2 / 2 : s2) > limit &&
            !s->t->landmarks[at->landmark].known) {
            at->active = 0;
            return;
        }
    at->prior_d2 = distance2(at, none, none, none);
}

/* Is so much of what is known of this prediction from the others that they can judge it? The least
 * pivot of (I - w h) (I + (1 - w) h), h = a (I + A)^-1 a^T. */
static bool others_know(const sight *at, const double A[36]) {
    double N[36], X[18], h[9], left[9], right[9], M[9];
    memcpy(N, A, sizeof N);
    for (unsigned k = 0; k < 6; k++) {
        N[7 * k] += 1;
        for (unsigned r = 0; r < 3; r++)
            X[3 * k + r] = at->a[6 * r + k];
    }
    if (!oracle_solve_spd(6, 3, N, X))
        return false;
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 3, 6, 1, at->a, X, 0, h);
    for (unsigned i = 0; i < 9; i++) {
        left[i] = (i % 4 == 0) - at->weight * h[i];
        right[i] = (i % 4 == 0) + (1 - at->weight) * h[i];
    }
    square_multiply(3, left, right, M);
    if (!oracle_cholesky(3, M))
        return false;
    return fmin(M[0], fmin(M[4], M[8])) >= sqrt(least_rest);
}

static double judge(const textbook *t, const sight *at, const sum *best, bool found) {
    double A[36], b[6];
    const double gap2 = observe_row_gap2(t, at->o);
    if (!isfinite(at->prior_d2) || !at->in_front)
        return (double)INFINITY;
    if (!found || !others_know(at, best->A))
        return at->prior_d2 + gap2;
    memcpy(A, best->A, sizeof A);
    memcpy(b, best->b, sizeof b);
    add(at, -at->weight, A, b);
    return distance2(at, A, b, best->z) + gap2;
}

/* -mu^T (P J^T S^-1 r) / r^2: the change of inverse range that the observation alone makes; none where
 * what is left uncertain of the range moves the disparity by little. `left` is its variance after that. */
static double change_of_inverse_range(const textbook *t, const sight *at, double *left) {
    const double *q = t->landmarks[at->landmark].x;
    const double range2 = dot(q, q, 3), range = sqrt(range2);
    const double mu[3] = {q[0] / range, q[1] / range, q[2] / range};
    double S[9], L_S[9], r[3], JP[9], moved[3], along[3], sideways[3], Jp[3];
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 3, 1, at->J, mu, 0, along);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 3, 1, at->P, mu, 0, sideways);
    const double disparity = along[0] - along[1];
    *left = dot(mu, sideways, 3) / (range2 * range2);
    if (!(disparity * disparity * dot(mu, sideways, 3) >
          least_range_share * t->config.pixel_sigma_px * t->config.pixel_sigma_px))
        return 0;
    memcpy(L_S, at->S, sizeof L_S);
    memcpy(S, at->S, sizeof S);
    (void)oracle_cholesky(3, L_S);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 3, 1, L_S, at->rho, 0, r);
    (void)oracle_solve_spd(3, 1, S, r);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 3, 1, at->J, sideways, 0, Jp);
    oracle_solve_lower(3, 1, L_S, Jp);
    *left -= dot(Jp, Jp, 3) / (range2 * range2);
    square_multiply(3, at->J, at->P, JP);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, 3, 1, 3, 1, JP, r, 0, moved);
    return -dot(mu, moved, 3) / range2;
}

static double inverse_range(const textbook_landmark *l) {
    return 1 / sqrt(dot(l->x, l->x, 3)) + l->beyond;
}

/* What inverse ranges usually are: u with u (u - mean) = 1 / sum w, mean = sum w / r / sum w and
 * w = 1 / (variance + u^2), in three rounds, of which the first one has a single observation's variance
 * for u^2. */
static double usual_inverse_range(const textbook *t) {
    const double by_range = t->camera.fx_px * t->camera.baseline_m / t->config.pixel_sigma_px;
    const double least = 1 / t->config.max_range_m;
    double usual = sqrt(least * least + 2 / (by_range * by_range));
    for (int round = 0; round < 3; round++) {
        double weights = 0, mean = 0;
        for (unsigned i = 0; i < t->count; i++) {
            const textbook_landmark *l = &t->landmarks[i];
            const unsigned row = textbook_row(t, i);
            double along2 = 0; /* variance along the ray, times the range squared */
            for (unsigned k = 0; k < 9; k++)
                along2 +=
                    l->x[k / 3] * l->x[k % 3] * textbook_covariance(t, row + k / 3, row + k % 3);
            const double weight = 1 / (along2 / pow(dot(l->x, l->x, 3), 3) + usual * usual);
            weights += weight;
            mean += weight * inverse_range(l);
        }
        mean /= weights;
        usual = fmax(least, mean / 2 + sqrt(mean * mean / 4 + 1 / weights));
    }
    return usual;
}

/* From the estimate to where a landmark is linearised: as near to the usual inverse range as two sigmas
 * about what the observation makes of the estimate allow. */
static double way_to_vantage(const textbook *t, const sight *at, double usual) {
    const textbook_landmark *l = &t->landmarks[at->landmark];
    double left;
    const double change = change_of_inverse_range(t, at, &left), sigmas = 2 * sqrt(fmax(0, left));
    return l->known ? 0 : fmin(fmax(usual - inverse_range(l), change - sigmas), change + sigmas);
}

/* The squared norm of the four residuals at the point looked at last. */
static double residual_norm2(const textbook *t, const sight *at) {
    const double s2 = t->config.pixel_sigma_px * t->config.pixel_sigma_px;
    double L_S[9], r[3];
    memcpy(L_S, at->S, sizeof L_S);
    (void)oracle_cholesky(3, L_S);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 1, 3, 1, L_S, at->rho, 0, r);
    /* vL and vR lie half their gap to both sides of v */
    return dot(r, r, 3) + r[2] * r[2] + s2 * observe_row_gap2(t, at->o);
}

/* ---------------------------------------------------------------- all of it */

static void prepare(search *s, unsigned landmark, const plr_observation *o) {
    const textbook *t = s->t;
    const unsigned row = textbook_row(t, landmark);
    sight *at = &s->sights[s->count++];
    memset(at, 0, sizeof *at);
    at->landmark = landmark;
    at->o = o;
    at->active = t->landmarks[landmark].known ? 0 : 1;
    for (unsigned r = 0; r < 3; r++) {
        memcpy(at->V + 6 * r, t->C + 6 * (row + r), 6 * sizeof *at->V);
        solve_lower(s->L, at->V + 6 * r);
    }
    for (unsigned r = 0; r < 3; r++)
        for (unsigned c = 0; c < 3; c++)
            at->P[3 * r + c] =
                textbook_covariance(t, row + r, row + c) - dot(at->V + 6 * r, at->V + 6 * c, 6);
    for (unsigned r = 0; r < 3; r++) /* of no point yet: any measure will do */
        at->best_S[4 * r] = 1;
}

/* None can be checked by the others: the twists' prediction says who may speak. */
static void hush_outliers(search *s) {
    for (unsigned i = 0; i < s->count; i++)
        if (!observe_accepts(s->t, s->sights[i].prior_d2, 0))
            s->sights[i].active = 0;
}

/* True if others are left out than before, and those who stay tell a motion alone. */
static bool leave_rejected_out(search *s, const sum *best) {
    unsigned same = 0, part = 0, out = 0;
    for (unsigned i = 0; i < s->count; i++) {
        sight *at = &s->sights[i];
        if (!(at->active > 0))
            continue;
        part++;
        const bool before = at->left_out;
        at->left_out = at->weight < 1 && !observe_accepts(s->t, judge(s->t, at, best, true),
                                                          residual_norm2(s->t, at));
        same += at->left_out == before;
        out += at->left_out;
    }
    return same < part && part - out >= ENOUGH;
}

/* From where all have pulled, on without what the gate rejects there; and once more. */
static void descend_without_rejected(search *s, sum *best) {
    for (int again = 0; again < AGAIN && leave_rejected_out(s, best); again++) {
        const sum kept = *best;
        (void)evaluate(s, kept.z, best);
        accept(s);
        descend(s, best);
    }
}

/* Those of the frame that are in the state. */
static void gather(search *s, const plr_frame *frame) {
    for (unsigned i = 0; i < frame->count; i++) {
        const unsigned landmark = textbook_find(s->t, frame->observations[i].id);
        if (landmark < s->t->count)
            prepare(s, landmark, &frame->observations[i]);
    }
}

void search_motion(textbook *t, const plr_frame *frame, search_result *result) {
    static const double zero[6] = {0};
    search s = {.t = t, .L = result->L, .sights = t->sightings};
    sum best;
    unsigned active = 0;
    gather(&s, frame);
    (void)evaluate(&s, zero, &best);
    accept(&s);
    for (unsigned i = 0; i < s.count; i++) {
        judge_by_prior(&s, &s.sights[i]);
        active += s.sights[i].active > 0;
    }
    const bool found = active >= FEW;
    if (!found)
        hush_outliers(&s);
    (void)evaluate(&s, zero, &best); /* once more, with those alone that take part */
    accept(&s);
    if (active > 0)
        descend(&s, &best);
    if (found)
        descend_without_rejected(&s, &best);
    memcpy(result->z, best.z, sizeof result->z);
    const double usual = usual_inverse_range(t);
    for (unsigned i = 0; i < s.count; i++) {
        const sight *at = &s.sights[i];
        textbook_landmark *l = &t->landmarks[at->landmark];
        l->d2 = judge(t, at, &best, found);
        l->norm2 = residual_norm2(t, at);
        if (!isfinite(l->d2) || !observe_accepts(t, l->d2, l->norm2))
            continue;
        result->accepted++;
        l->range_shift = way_to_vantage(t, at, usual);
    }
}
