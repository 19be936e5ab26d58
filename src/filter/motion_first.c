// SPDX-License-Identifier: MIT
#include "filter/motion_first.h"

#include <string.h>

#include "filter/gate.h"
#include "filter/linearisation.h"
#include "filter/search.h"
#include "filter/tracks.h"
#include "limits/limits.h"
#include "math/dense.h"
#include "math/small.h"
#include "pelorus/assertions.h"
#include "sensor/stereo.h"
#include "state/blocks.h"
#include "state/motion.h"
#include "state/seconds.h"
#include "state/slots.h"
#include "supervise/exclusion.h"
#include "supervise/supervise.h"

enum {
    MIN_POINTS = 3,   /* of fewer points none can be checked by the others */
    MIN_POOR = 6,     /* fewer points do not show that a search found the wrong minimum */
    MIN_AGREEING = 6, /* fewer points do not tell a motion of which nothing else is known */
    MORE_SEARCHES = 2 /* at most, if the first ends beside the minimum */
};

/* An observation is judged by the motion of all others only if they contribute at least about this
 * share to its prediction. Below it the observation has determined the motion itself. */
#define LEAST_SHARE PLR_R(0.05)

/* True if a landmark was out of sight before this frame, and may be lost. */
static bool is_unseen(const plr_search *s, unsigned i) {
    const plr_slot *slot = plr_search_slot(s, i);
    return !slot->known &&
           s->f->belief.t_ns - slot->last_seen_ns > plr_limit_ns(s->left_out, PLR_LIMIT_UNSEEN_MS);
}

/* True if its bearing is too uncertain to linearise at, though the motion were known: the pose drifted
 * meanwhile. */
static bool is_lost(const plr_search *s, unsigned i) {
    const plr_real limit = plr_stereo_max_bearing_variance(&s->f->camera), *P = s->residuals[i].P;
    return is_unseen(s, i) && !(P[0] <= limit && P[4] <= limit);
}

/* True if no frame has measured the motion for long. */
static bool is_dark(const plr_search *s) {
    return s->f->motion.seconds > plr_seconds(plr_limit_ns(s->left_out, PLR_LIMIT_DARK_MS));
}

/* True if a rejected landmark is lost, because its bearing is too uncertain. What drifted in a darkness is
 * in nu when it ends; by an IMU, which lost velocity and tilt as well, it stays in the landmarks' own
 * covariance after that. By twists, where frames did measure the motion, one rejection is an outlier. */
static bool has_drifted(const plr_search *s, unsigned i) {
    const bool may_be = is_dark(s) || plr_has_block(&s->f->belief, PLR_BLOCK_VELOCITY);
    return may_be && s->residuals[i].uncertain && is_unseen(s, i);
}

/* What makes a prediction too uncertain to linearise at. */
typedef enum plr_uncertainty {
    PLR_OF_POINT_AND_MOTION,
    PLR_OF_POINT /* the motion is found by the points together, however little is known of it */
} plr_uncertainty;

/* Compares an observation with the twists' prediction: prior_d2 with the whole uncertainty of nu in
 * S, and det_S. If the prediction is too uncertain to linearise at, prior_d2 is negative and
 * the observation takes no part in the search. */
static void judge_by_prior(plr_search *s, unsigned i, plr_uncertainty by) {
    plr_residual *at = &s->residuals[i];
    at->prior_d2 = -1;
    const bool dark = is_dark(s) && by == PLR_OF_POINT_AND_MOTION, lost = is_lost(s, i);
    at->uncertain = dark || lost; /* unless the prediction below says otherwise */
    if (at->behind || lost) {
        at->active = 0;
        return;
    }
    const plr_real *U = at->U[s->current];
    plr_real M[6], x[3], R[PLR_ROWS];
    plr_stereo_variances(&s->f->camera, plr_search_row(s, i)->seen, R);
    const plr_real limit = plr_stereo_max_variance(&s->f->camera);
    /* px^2, as the limit is */
    const plr_real most = limit * plr_stereo_max_bearing_variance(&s->f->camera);
    bool basis = true, within = true;
    for (unsigned r = 0, k = 0; r < 3; r++)
        for (unsigned c = r; c < 3; c++, k++) {
            M[k] = plr_dot3(at->a + PLR_POSE_DIM * r, at->a + PLR_POSE_DIM * c) +
                   plr_dot3(at->a + PLR_POSE_DIM * r + 3, at->a + PLR_POSE_DIM * c + 3) +
                   (r == c ? PLR_R(1) : PLR_R(0));
        }
    /* the diagonal of U^T M U - R: `sum` with the uncertainty of nu, `own` without */
    for (unsigned r = 0; r < 3; r++) {
        plr_real u[3] = {0}, sum = 0, own = 0;
        for (unsigned k = 0; k <= r; k++) {
            u[k] = U[plr_upper_row(3, k) + r - k];
            own = PLR_FMA(u[k], u[k], own);
        }
        for (unsigned k = 0; k < 3; k++)
            for (unsigned l = 0; l < 3; l++)
                sum += u[k] * u[l] *
                       M[k <= l ? plr_upper_row(3, k) + l - k : plr_upper_row(3, l) + k - l];
        basis = basis && (by == PLR_OF_POINT ? own : sum) - R[r] <= limit;
        within = within && (dark ? sum : own) - R[r] <= most;
    }
    at->uncertain = !within;
    if ((!basis && !plr_search_slot(s, i)->known) || !plr_cholesky3(M)) {
        at->active = 0;
        return;
    }
    memcpy(x, at->e, sizeof x);
    plr_solve3_transposed(1, M, x);
    at->prior_d2 = plr_dot3(x, x);
    const plr_real root = U[0] * U[3] * U[5] * M[0] * M[3] * M[5];
    at->det_S = root * root;
}

/* d^2 of an observation about the motion that all others give. With h = a (I + J)^-1 a^T and the
 * weight w of the observation in J it is e^T [(I - w h)(I + (1 - w) h)]^-1 e. `share` receives the
 * smallest pivot of the matrix in brackets, about the share that the others contribute. */
static plr_real leave_one_out(const plr_residual *at, const plr_real *U,
                              const plr_real dz[PLR_POSE_DIM], plr_real e[3], plr_real *share) {
    plr_real X[PLR_ROWS * PLR_POSE_DIM], h[9], M[6];
    const plr_real w = at->weight;
    PLR_ASSERT(0 <= w && w <= 1);
    for (unsigned r = 0; r < 3; r++) {
        e[r] = at->e[r];
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
    *share = 0;
    if (!plr_cholesky3(M))
        return 0;
    *share = M[0] < M[3] ? M[0] : M[3];
    *share = *share < M[5] ? *share : M[5];
    *share *= *share;
    plr_solve3_transposed(1, M, e);
    return plr_dot3(e, e);
}

/* The squared norm of the four pixel residuals at the point evaluated last, for the setting
 * gate-residual. */
static plr_real residual_norm2(const plr_search *s, unsigned i) {
    const plr_residual *at = &s->residuals[i];
    plr_real r[3];
    plr_multiply3_transposed(r, at->U[s->current], at->e);
    return plr_stereo_residual2(plr_search_row(s, i)->seen, r);
}

/* d^2 of an observation for the gate: about the motion that the others give, or, where they say too little or
 * none was found (U is NULL), about the prediction. */
static plr_real gate_d2(const plr_search *s, unsigned i, const plr_real *U,
                        const plr_real dz[PLR_POSE_DIM], plr_real e[3], plr_real *share) {
    const plr_residual *at = &s->residuals[i];
    *share = 0;
    const plr_real without_it = U ? leave_one_out(at, U, dz, e, share) : at->prior_d2;
    return (*share >= LEAST_SHARE ? without_it : at->prior_d2) +
           plr_stereo_row_gap_d2(&s->f->camera, plr_search_row(s, i)->seen);
}

/* What the gate says of an observation, with its d^2. Adds the innovation of an accepted one to its track. */
static plr_gate_result judge(plr_search *s, unsigned i, const plr_real *U,
                             const plr_real dz[PLR_POSE_DIM], plr_real *judged_d2) {
    const plr_residual *at = &s->residuals[i];
    plr_real e[3], share;
    *judged_d2 = at->prior_d2;
    if (!(at->prior_d2 >= 0) || at->behind)
        return PLR_GATE_REJECTED;
    const plr_real d2 = *judged_d2 = gate_d2(s, i, U, dz, e, &share);
    const bool accepted = plr_gate_accepts(s->f, s->opens_fixed_gate, d2, residual_norm2(s, i));
    plr_slot *slot = plr_search_slot(s, i);
    if (accepted && share >= LEAST_SHARE)
        plr_track_add(slot, s->left_out, e);
    if (!accepted)
        return plr_gate_rejection(s->left_out, d2);
    return slot->moving ? PLR_GATE_REJECTED : PLR_GATE_ACCEPTED;
}

/* How much an observation tells about the translation, 1/sigma: of a distant point little. */
static plr_real telling(const plr_residual *at) {
    plr_real sum = 0;
    for (unsigned r = 0; r < PLR_ROWS && !at->behind; r++)
        sum += plr_dot3(at->a + PLR_POSE_DIM * r, at->a + PLR_POSE_DIM * r);
    return PLR_SQRT(sum);
}

/* A point as it is at the point evaluated last. */
static plr_excluding_point excluding_point(const plr_residual *at) {
    return (plr_excluding_point){.active = at->active,
                                 .weight = at->weight,
                                 .d2 = plr_dot3(at->e, at->e),
                                 .by_odometry_d2 = at->twist_d2,
                                 .behind = at->behind,
                                 .tells = telling(at)};
}

static plr_exclusion_evidence count_points(const plr_search *s) {
    plr_exclusion_evidence all = {0};
    for (unsigned i = 0; i < s->count; i++) {
        const plr_excluding_point point = excluding_point(&s->residuals[i]);
        plr_exclusion_add(s->left_out, &all, &point);
    }
    return all;
}

/* The largest share of the open prior's variance that a direction of the motion keeps. */
static plr_real largest_unobserved(const plr_search_point *point) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0}, C[PLR_POSE_SQUARE] = {0}, most = 0;
    if (!plr_search_factorise(point, 0, U))
        return 1;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        C[(PLR_POSE_DIM + 1) * k] = 1;
    plr_solve_upper_transposed(PLR_POSE_DIM, PLR_POSE_DIM, U, C, PLR_POSE_DIM);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        plr_real left = 0;
        for (unsigned r = 0; r < PLR_POSE_DIM; r++)
            left = PLR_FMA(C[PLR_POSE_DIM * r + k], C[PLR_POSE_DIM * r + k], left);
        most = left > most ? left : most;
    }
    return most;
}

static bool has_support(const plr_search *s, const plr_search_point *open, plr_misfit misfit) {
    const plr_exclusion_evidence all = count_points(s);
    return plr_exclusion_has_support(s->left_out, &all, misfit) &&
           plr_exclusion_is_well_spread(s->left_out, largest_unobserved(open));
}

/* Searches again with a prior so wide that the twists hardly count; where most do not agree with the
 * twists, so that wrong matches may mislead it, without those that fit worst, too. True, with `best`
 * and s->prior at the result, if enough observations support it; otherwise the search is put back to
 * where it was. */
static PLR_SELDOM bool search_without_twists(plr_search *s, plr_search_point *best,
                                             plr_misfit misfit) {
    const plr_applied_motion stated = s->prior;
    const plr_exclusion_evidence all = count_points(s);
    const bool most_agree = plr_exclusion_most_agree(&all);
    plr_search_point open;
    for (unsigned i = 0; i < s->count; i++)
        s->residuals[i].twist_d2 = plr_dot3(s->residuals[i].e, s->residuals[i].e);
    plr_motion_open_prior(&s->f->belief, &s->f->motion, &s->f->work.noise, &s->prior);
    plr_search_from_zero(s, &open);
    for (unsigned i = 0; i < 2; i++)
        plr_search_descend(s, &open);
    bool supported = has_support(s, &open, misfit);
    if (!supported && !most_agree) {
        plr_search_concentrate(s, &open);
        supported = has_support(s, &open, misfit);
    }
    if (supported) {
        *best = open;
        return true;
    }
    s->prior = stated;
    plr_search_prepare(s);
    plr_search_again(s, best);
    return false;
}

/* All landmarks but those of a given map. */
static void let_unknown_take_part(plr_search *s) {
    for (unsigned i = 0; i < s->count; i++)
        s->residuals[i].active = plr_search_slot(s, i)->known ? 0 : 1;
}

/* Compares all observations with the twists' prediction, and excludes from the search those whose
 * prediction is too uncertain to linearise at. If fewer than three remain, none can be checked by
 * the others; then those that the gate rejects here are excluded too. Returns how many were left
 * before that. */
static unsigned judge_all_by_prior(plr_search *s, plr_search_point *best) {
    unsigned active = 0;
    bool changed = false;
    for (unsigned i = 0; i < s->count; i++) {
        plr_residual *at = &s->residuals[i];
        const bool was_active = at->active > 0;
        judge_by_prior(s, i, PLR_OF_POINT_AND_MOTION);
        active += at->active > 0;
        changed = changed || (was_active && !(at->active > 0));
    }
    for (unsigned i = 0; active < MIN_POINTS && i < s->count; i++)
        if (!plr_gate_accepts(s->f, s->opens_fixed_gate, s->residuals[i].prior_d2, 0)) {
            changed = changed || s->residuals[i].active > 0;
            s->residuals[i].active = 0;
        }
    if (changed)
        plr_search_from_zero(s, best);
    return active;
}

/* The twists' prediction of most points is too uncertain to linearise at, but the points themselves
 * may be well known: after frames that were lost in a fast turn, or a darkness. If the motion at which
 * they agree with each other can be found, all of them take part in the search. They need not be well
 * spread: a direction in which they say little keeps what the twists say of it. Otherwise the search
 * goes on with those whose prediction is good enough. Returns how many take part. */
static PLR_SELDOM unsigned search_by_agreement(plr_search *s, plr_search_point *best) {
    unsigned active = 0;
    let_unknown_take_part(s);
    for (unsigned i = 0; i < s->count; i++) {
        judge_by_prior(s, i, PLR_OF_POINT);
        active += s->residuals[i].active > 0;
    }
    if (active >= MIN_AGREEING) {
        plr_search_from_zero(s, best);
        for (unsigned again = 0; again <= MORE_SEARCHES; again++)
            plr_search_descend(s, best);
        const plr_exclusion_evidence all = count_points(s);
        if (all.agree >= MIN_AGREEING && plr_exclusion_most_agree(&all))
            return active;
    }
    let_unknown_take_part(s);
    plr_search_from_zero(s, best);
    return judge_all_by_prior(s, best);
}

/* What a prediction over metres says of its own uncertainty is right to first order only: of its d^2 this
 * share is compared with the gate. */
#define ASTRAY_SHARE PLR_R(0.25)

/* True if at least a quarter of the points disagree with the result of a search although the twists'
 * prediction allows them: from a prediction that is off by metres the bounded number of trials may not
 * lead to the minimum. */
static bool fits_poorly(const plr_search *s) {
    unsigned active = 0, poor = 0;
    for (unsigned i = 0; i < s->count; i++) {
        const plr_residual *at = &s->residuals[i];
        if (!(at->active > 0))
            continue;
        active++;
        const bool allowed =
            plr_gate_accepts(s->f, s->opens_fixed_gate, at->prior_d2 * ASTRAY_SHARE, 0);
        poor += allowed && (at->behind || !plr_gate_accepts(s->f, s->opens_fixed_gate,
                                                            plr_dot3(at->e, at->e), 0));
    }
    return active >= MIN_POOR && 4 * poor >= active;
}

/* Enters the matched rows. Returns how many are not of a given map: the others take no part. */
static unsigned enter(plr_search *s) {
    unsigned unknown = 0;
    for (unsigned k = 0; k < s->sightings->count; k++) {
        const plr_sighting *row = &s->sightings->at[k];
        if (!plr_is_matched(row))
            continue;
        const bool known = plr_is_of_known(&s->f->belief, row);
        unknown += !known;
        plr_search_add(s, k, known ? 0 : 1);
    }
    return unknown;
}

/* The factor of the sums at the best point, and the step that they would go next. */
static bool solve(const plr_search_point *best, plr_real *U, plr_real dz[PLR_POSE_DIM]) {
    if (!plr_search_factorise(best, 0, U))
        return false;
    (void)plr_search_step(best, U, dz);
    return true;
}

/* Trims what the gate rejects at the best point. One of full weight stays: it pulls no more than noise does,
 * whatever the gate says of it. True if others are trimmed than before and what is left is enough to tell a
 * motion alone (few fit anything); if false, the sums are still those of before. */
static bool trim_rejected(plr_search *s, const plr_real *U, const plr_real dz[PLR_POSE_DIM]) {
    unsigned kept = 0;
    bool changed = false;
    for (unsigned i = 0; i < s->count; i++) {
        plr_residual *at = &s->residuals[i];
        plr_real e[3], share;
        if (!(at->active > 0))
            continue;
        const bool accepted =
            at->weight >= 1 || (!at->behind && plr_gate_accepts(s->f, s->opens_fixed_gate,
                                                                gate_d2(s, i, U, dz, e, &share),
                                                                residual_norm2(s, i)));
        changed = changed || accepted == at->trimmed;
        at->trimmed = !accepted;
        kept += accepted;
    }
    return changed && kept >= MIN_AGREEING;
}

/* Goes on without what the gate rejects, at most twice: Huber's function bounds the pull of a point and does
 * not end it, so that many that move alike pull the motion aside until the others are rejected, too.
 * U and dz are of the result. False if its sums have no factor. */
static bool search_without_rejected(plr_search *s, plr_search_point *best, plr_real *U,
                                    plr_real dz[PLR_POSE_DIM]) {
    bool found = solve(best, U, dz);
    for (unsigned again = 0; found && again < MORE_SEARCHES && trim_rejected(s, U, dz); again++) {
        plr_search_without_trimmed(s, best);
        found = solve(best, U, dz);
    }
    return found;
}

/* Judges every row at the result of the search, and says where its landmark is to be linearised. */
static void judge_all(plr_search *s, const plr_real *U, const plr_real dz[PLR_POSE_DIM],
                      plr_sightings *sightings) {
    plr_filter *f = s->f;
    const plr_real usual = plr_linearisation_usual(f);
    for (unsigned i = 0; i < s->count; i++) {
        const plr_residual *at = &s->residuals[i];
        plr_sighting *row = &sightings->at[at->row];
        plr_linearised *own = &sightings->of_slot[row->slot];
        plr_slot *slot = plr_slot_of(&f->belief, row);
        const plr_gate_result result = judge(s, i, U, dz, &own->d2);
        const bool accepted = result == PLR_GATE_ACCEPTED;
        const bool lost = !accepted && has_drifted(s, i);
        row->verdict = (uint8_t)(lost ? PLR_GATE_LOST : result);
        own->det_S = at->det_S;
        if (lost) /* as if unseen: the frame does not correct it as it does others */
            slot->last_frame = f->belief.frame_number - 1;
        if (accepted && !slot->known)
            f->work.noise.range_shift[row->slot] =
                plr_linearisation_offset(slot, usual, at->range_change, at->range_variance);
    }
}

void plr_motion_find(plr_filter *f, plr_sightings *sightings, const plr_picture_decision *decided,
                     plr_motion_first *first) {
    plr_search s = {.f = f,
                    .sightings = sightings,
                    .residuals = (plr_residual *)(void *)f->work.Vt,
                    .opens_fixed_gate = decided->opens_fixed_gate,
                    .left_out = plr_supervise_left_out(&f->supervisor)};
    plr_search_point best;
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0}, dz[PLR_POSE_DIM] = {0};
    plr_motion_prior(&f->belief, &f->motion, &f->work.noise, decided->weight, &s.prior);
    const unsigned unknown = enter(&s);
    plr_search_from_zero(&s, &best);
    unsigned active = judge_all_by_prior(&s, &best);
    if (unknown >= MIN_AGREEING && 2 * active < unknown)
        active = search_by_agreement(&s, &best);
    bool found = active >= MIN_POINTS; /* else `motion` is the twists' */
    if (active > 0)
        plr_search_descend(&s, &best);
    for (unsigned again = 0; again < MORE_SEARCHES && fits_poorly(&s); again++)
        plr_search_descend(&s, &best);
    plr_misfit misfit = PLR_MISFIT_NONE;
    if (found && decided->may_exclude_odometry) {
        const plr_exclusion_evidence all = count_points(&s);
        misfit = plr_exclusion_misfit(s.left_out, &all, plr_norm2_of_6(best.z));
    }
    first->outright = misfit != PLR_MISFIT_NONE && search_without_twists(&s, &best, misfit);
    found = found && search_without_rejected(&s, &best, U, dz);
    plr_motion_at(&f->motion, &s.prior, best.z, &first->motion);
    judge_all(&s, found ? U : NULL, dz, sightings);
}
