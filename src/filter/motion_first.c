// SPDX-License-Identifier: MIT
#include "filter/motion_first.h"

#include <string.h>

#include "filter/gate.h"
#include "filter/search.h"
#include "filter/tracks.h"
#include "filter/vantage.h"
#include "math/dense.h"
#include "math/small.h"
#include "sensor/stereo.h"
#include "state/motion.h"
#include "state/slots.h"

enum {
    FEW = 3, /* fewer points say nothing that could be checked */
    MANY = 6 /* fewer are not believed against the twists */
};

/* An observation speaks for one of two motions if its squared residuals differ by more. */
#define DECISIVE PLR_R(9)
/* It agrees with a motion if its squared residual is below this: 97 of 100 that stand do. */
#define AGREES PLR_R(9)
/* Points are well spread if together they leave no more of an open prior's variance in any direction. */
#define LEFT_OPEN PLR_R(0.25)
/* The least share, about, that a point may leave to the others in what is known of its own prediction.
 * Below it the point has made the motion what it is, and cannot be judged by it. */
#define LEAST_REST PLR_R(0.05)

/* What the twists alone say of an observation: d^2 with nu's whole uncertainty, and det S. Without a basis
 * for a linearisation d^2 is negative, and it has no voice. */
static void judge_at_zero(plr_search *s, unsigned i) {
    plr_sighting *at = &s->sightings[i];
    at->at_zero = -1;
    if (at->lost) {
        at->voice = 0;
        return;
    }
    const plr_real *U = at->U[s->bank];
    plr_real M[6], x[3];
    plr_real limit = plr_stereo_largest_spread(s->f);
    bool basis = true;
    for (unsigned r = 0, k = 0; r < 3; r++)
        for (unsigned c = r; c < 3; c++, k++) {
            M[k] = plr_dot3(at->a + PLR_POSE_DIM * r, at->a + PLR_POSE_DIM * c) +
                   plr_dot3(at->a + PLR_POSE_DIM * r + 3, at->a + PLR_POSE_DIM * c + 3) +
                   (r == c ? PLR_R(1) : PLR_R(0));
        }
    for (unsigned r = 0; r < 3; r++) { /* the diagonal of U^T M U - R */
        plr_real u[3] = {0}, sum = 0;
        for (unsigned k = 0; k <= r; k++)
            u[k] = U[plr_upper_row(3, k) + r - k];
        for (unsigned k = 0; k < 3; k++)
            for (unsigned l = 0; l < 3; l++)
                sum += u[k] * u[l] *
                       M[k <= l ? plr_upper_row(3, k) + l - k : plr_upper_row(3, l) + k - l];
        basis = basis && sum - plr_stereo_variance(s->f, r) <= limit;
    }
    if ((!basis && !plr_search_slot(s, i)->known) || !plr_cholesky3(M)) {
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
static plr_real left_out(const plr_sighting *at, const plr_real *U, const plr_real dz[PLR_POSE_DIM],
                         plr_real e[3], plr_real *rest) {
    plr_real X[PLR_ROWS * PLR_POSE_DIM], h[9], M[6];
    const plr_real w = at->weight;
    for (unsigned r = 0; r < 3; r++) {
        e[r] = at->rho[r];
        for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
            e[r] = PLR_FMA(-at->a[PLR_POSE_DIM * r + k], dz[k], e[r]);
            X[3 * k + r] = at->a[PLR_POSE_DIM * r + k];
        }
    }
    plr_solve_upper_transposed(PLR_POSE_DIM, 3, U, X, 3);
    for (unsigned r = 0; r < 3; r++)
        for (unsigned c = 0; c < 3; c++) {
            h[3 * r + c] = 0;
            for (unsigned k = 0; k < PLR_POSE_DIM; k++)
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

/* The squared norm of the four residuals at the point evaluated last, for the setting gate-residual. */
static plr_real residual_norm2(const plr_search *s, unsigned i) {
    const plr_sighting *at = &s->sightings[i];
    plr_real r[3];
    plr_multiply3_transposed(r, at->U[s->bank], at->rho);
    return plr_stereo_residual2(plr_search_observation(s, i), r);
}

static bool judge(plr_search *s, unsigned i, bool found, const plr_real *U,
                  const plr_real dz[PLR_POSE_DIM], float *nis) {
    const plr_sighting *at = &s->sightings[i];
    plr_real d2 = at->at_zero, e[3], rest = 0;
    if (!(d2 >= 0) || at->lost)
        return false;
    if (found) {
        const plr_real by_others = left_out(at, U, dz, e, &rest);
        d2 = rest >= LEAST_REST ? by_others : d2;
    }
    d2 += plr_stereo_besides(s->f, plr_search_observation(s, i));
    const bool accepted = plr_gate_accepts(s->f, d2, residual_norm2(s, i));
    plr_slot *slot = plr_search_slot(s, i);
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
    return weight < PLR_R(0.7) * voices || plr_norm2_of_6(best->z) > PLR_R(36);
}

/* Do the observations leave no direction of the motion open? */
static bool is_well_spread(const plr_search_point *point) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0}, C[PLR_POSE_SQUARE] = {0};
    if (!plr_search_factorise(point, 0, U))
        return false;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        C[(PLR_POSE_DIM + 1) * k] = 1;
    plr_solve_upper_transposed(PLR_POSE_DIM, PLR_POSE_DIM, U, C, PLR_POSE_DIM);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        plr_real left = 0;
        for (unsigned r = 0; r < PLR_POSE_DIM; r++)
            left = PLR_FMA(C[PLR_POSE_DIM * r + k], C[PLR_POSE_DIM * r + k], left);
        if (left > LEFT_OPEN)
            return false;
    }
    return true;
}

/* Do at least three of the observations, a fifth of them, and four times as many as for the twists, speak
 * for the other motion, and do three fifths of at least six, well spread, agree on it? Fewer may stand on
 * something that moves: a car that fills a third of the picture draws the others some way along. */
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
    return against >= FEW && 5 * against >= voices && 4 * with <= against &&
           5 * agree >= 3 * voices && voices >= MANY && is_well_spread(open);
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
    plr_search_from_zero(s, &open);
    for (unsigned i = 0; i < 2; i++)
        plr_search_descend(s, &open);
    if (speaks_against_twists(s, &open)) {
        *best = open;
        return true;
    }
    const plr_search_point kept = *best;
    s->prior = believed;
    plr_search_prepare(s);
    plr_search_go_to(s, kept.z, best);
    return false;
}

/* Judges all by the twists' prediction, and silences those that have no part in the search: what gives
 * no basis for a linearisation; and, since of one or two points none can be checked by the others, what the
 * gate does not let through there. Returns how many points there are that have a basis. */
static unsigned judge_all_at_zero(plr_search *s, plr_search_point *best) {
    unsigned voices = 0;
    bool silenced = false;
    for (unsigned i = 0; i < s->count; i++) {
        plr_sighting *at = &s->sightings[i];
        const bool spoke = at->voice > 0;
        judge_at_zero(s, i);
        voices += at->voice > 0;
        silenced = silenced || (spoke && !(at->voice > 0));
    }
    for (unsigned i = 0; voices < FEW && i < s->count; i++)
        if (!plr_gate_accepts(s->f, s->sightings[i].at_zero, 0)) {
            silenced = silenced || s->sightings[i].voice > 0;
            s->sightings[i].voice = 0;
        }
    if (silenced)
        plr_search_from_zero(s, best);
    return voices;
}

void plr_motion_find(plr_filter *f, const plr_frame *frame, unsigned n, plr_motion_first *first,
                     float *nis) {
    plr_search s = {.f = f, .frame = frame, .sightings = (plr_sighting *)(void *)f->work.Vt};
    plr_search_point best;
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0}, dz[PLR_POSE_DIM] = {0};
    plr_motion_prior(f, &s.prior);
    for (unsigned k = 0; k < n; k++)
        if (f->work.slot_of[k] != PLR_NO_SLOT) {
            f->work.used[s.count] = (uint16_t)k;
            plr_search_add(&s, f->slots[f->work.slot_of[k]].known ? 0 : 1);
        }
    plr_search_from_zero(&s, &best);
    const unsigned voices = judge_all_at_zero(&s, &best);
    first->found = voices >= FEW;
    if (voices > 0)
        plr_search_descend(&s, &best);
    first->contradicted = first->found && is_suspicious(&s, &best) && contradicts(&s, &best);
    first->found = first->found && plr_search_factorise(&best, 0, U);
    if (first->found)
        (void)plr_search_step(&best, U, dz);
    plr_motion_at(f, &s.prior, best.z, &first->motion);
    const plr_real usual = plr_vantage_usual(f);
    for (unsigned i = 0; i < s.count; i++) {
        const bool accepted = judge(&s, i, first->found, U, dz, nis);
        f->work.gain[f->work.used[i]] = accepted ? s.sightings[i].gain : PLR_R(-1);
        const plr_slot *slot = plr_search_slot(&s, i);
        if (accepted && !slot->known)
            f->work.noise.closer[slot - f->slots] =
                plr_vantage_offset(slot, usual, s.sightings[i].closer, s.sightings[i].left);
    }
}
