// SPDX-License-Identifier: MIT
#include "filter/votes.h"

#include <string.h>

#include "filter/trial.h"
#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "state/camera.h"
#include "state/pose.h"
#include "state/slots.h"

enum {
    LONGEST_TRIAL = 43,  /* frames; then another point is asked. A prime, so that it is another one
                         * whatever their number: ask_others begins at the frame's number */
    TRUSTED_FRAMES = 100 /* for which the twists are believed after a verdict */
};

/* What counts keep from frame to frame, about 50 frames. */
#define COUNTS_DECAY PLR_R(0.98)
/* The twists are right if at least PLR_VOTERS points, and so large a share of those that decided, fit
 * them, and no more than half fit neither. */
#define SHARE_FOR_TWISTS PLR_R(0.1)
#define MOST_FOR_NEITHER PLR_R(0.5)
/* Nothing is decided where the pictures' way is mostly noise: of the mean square of its steps the
 * square of the mean step is to be this share. */
#define STEADY_SHARE PLR_R(0.25)
/* The pictures are right if six fit them lately, and too few fit the twists. */
#define FEWEST_FOR_PICTURES PLR_R(5.5)
/* The motions' noise is common to all points, and each is judged by itself: these shares of the
 * variances by twists and by pictures leave them comparable. */
#define TWISTS_SHARE   PLR_R(0.3)
#define PICTURES_SHARE PLR_R(0.1)
/* Beside a good gyro, distant points toss the pictures' way to and fro by more in a frame than wheels
 * slip, and a point that fits no such zigzag would vote for any smooth way. So one candidate has a mean
 * of the way, in which a frame counts half as much as the next. It is a frame late. */
#define WAY_WEIGHT PLR_R(0.5)

void plr_votes_clear(plr_filter *f) {
    if (f->config.process == PLR_PROCESS_TWIST)
        memset(&f->own.votes, 0, sizeof f->own.votes);
}

static void forget_difference(plr_votes *v) {
    memset(v->difference, 0, sizeof v->difference);
    v->ways2 = v->frames = 0;
}

void plr_votes_keep_pose(plr_filter *f) {
    if (f->config.process != PLR_PROCESS_TWIST)
        return;
    forget_difference(&f->own.votes);
    for (unsigned t = 0; t < PLR_TRIALS; t++)
        f->own.votes.trials[t].frames = 0;
}

bool plr_votes_trust_twists(const plr_filter *f) {
    return f->config.process == PLR_PROCESS_TWIST && f->own.votes.trusted_frames > 0;
}

/* ---------------------------------------------------------------- the motions of a frame */

static void set_motion(const plr_filter *f, plr_candidates *c, unsigned which, const plr_real E[9],
                       const plr_real p[3]) {
    plr_real E_C[9];
    plr_camera_motion(E_C, c->motion[which].p, &f->par.camera, E, p);
    plr_se3_rotation(c->motion[which].R, E_C);
}

/* The twists' motion and `moved` after it, with the twists' turn if `way_only`. */
static void set_moved(const plr_filter *f, plr_candidates *c, unsigned which,
                      const plr_applied_motion *believed, const plr_real moved[PLR_POSE_DIM],
                      bool way_only) {
    plr_real E[9], p[3], dE[9], dp[3];
    memcpy(E, believed->E, sizeof E);
    memcpy(p, believed->p, sizeof p);
    plr_se3_expm1(dE, dp, moved);
    plr_se3_append(E, p, dE, dp);
    set_motion(f, c, which, way_only ? believed->E : E, p);
}

/* Raises *largest to `share` of the largest of three diagonal elements of X^T X; X: 6x6, of which the
 * columns from `first` on are looked at. */
static void raise_to(plr_real *largest, plr_real share, const plr_real X[PLR_POSE_SQUARE],
                     unsigned first) {
    for (unsigned c = first; c < first + 3; c++) {
        plr_real sum = 0;
        for (unsigned r = 0; r < PLR_POSE_DIM; r++)
            sum = PLR_FMA(X[PLR_POSE_DIM * r + c], X[PLR_POSE_DIM * r + c], sum);
        if (share * sum > *largest)
            *largest = share * sum;
    }
}

/* X = L^T, or U^-T L^T with U^T U = Lambda: the covariance of the motion is X^T X. */
static void add_noise(plr_candidates *c, plr_real share, const plr_real L[PLR_POSE_SQUARE],
                      const plr_real *Lambda) {
    plr_real X[PLR_POSE_SQUARE];
    for (unsigned r = 0; r < PLR_POSE_DIM; r++)
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            X[PLR_POSE_DIM * k + r] = L[PLR_POSE_DIM * r + k];
    if (Lambda) {
        plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0};
        memcpy(U, Lambda, PLR_POSE_TRIANGLE * sizeof *U);
        if (!plr_cholesky_upper(PLR_POSE_DIM, U))
            return;
        plr_solve_upper_transposed(PLR_POSE_DIM, PLR_POSE_DIM, U, X, PLR_POSE_DIM);
    }
    raise_to(&c->way_variance, share, X, 0);
    raise_to(&c->turn_variance, share, X, 3);
}

static void add_to_way(plr_votes *v, const plr_real moved[PLR_POSE_DIM]) {
    for (unsigned i = 0; i < 3; i++)
        v->way[i] = PLR_FMA(WAY_WEIGHT, moved[i] - v->way[i], v->way[i]);
}

static void find_candidates(const plr_filter *f, const plr_applied_motion *believed,
                            const plr_applied_motion *applied, const plr_correction *correction,
                            const plr_real moved[PLR_POSE_DIM], plr_candidates *c) {
    plr_real steadied[PLR_POSE_DIM];
    memset(c, 0, sizeof *c);
    memcpy(steadied, moved, sizeof steadied);
    memcpy(steadied, f->own.votes.way, sizeof f->own.votes.way);
    set_motion(f, c, PLR_BY_TWISTS, believed->E, believed->p);
    set_moved(f, c, PLR_BY_PICTURES, believed, moved, false);
    set_moved(f, c, PLR_BY_PICTURES_WAY, believed, steadied, true);
    add_noise(c, TWISTS_SHARE, believed->L, NULL);
    add_noise(c, PICTURES_SHARE, applied->JL, correction->Lambda);
}

/* ---------------------------------------------------------------- the points that are asked */

static bool is_asked(const plr_votes *v, uint32_t id) {
    for (unsigned t = 0; t < PLR_TRIALS; t++)
        if (plr_trial_is_of(&v->trials[t], id))
            return true;
    return false;
}

/* The first points that voted for the twists: one that is asked again and again is one. */
static void note_voter(plr_votes *v, uint32_t id) {
    unsigned known = 0;
    while (known < PLR_VOTERS && (plr_real)known < v->voter_count &&
           !plr_trial_is_id(v->voters[known], id))
        known++;
    if (known == PLR_VOTERS || (plr_real)known < v->voter_count)
        return;
    plr_trial_set_id(v->voters[known], id);
    v->voter_count += PLR_R(1);
}

static bool may_be_asked(const plr_filter *f, unsigned k) {
    return f->work.slot_of[k] != PLR_NO_SLOT && !f->slots[f->work.slot_of[k]].known;
}

/* Follows a point that is asked, and counts its vote: true if it has decided. A point that moves by
 * itself or with others is left out as long as the twists are trusted. */
static bool ask(plr_filter *f, plr_trial *t, const plr_frame *frame, unsigned n,
                const plr_candidates *c) {
    plr_votes *v = &f->own.votes;
    unsigned k = 0;
    while (k < n &&
           !(plr_trial_is_of(t, frame->observations[f->work.order[k]].id) && may_be_asked(f, k)))
        k++;
    if (k == n || !plr_trial_follow(f, t, &frame->observations[f->work.order[k]], c)) {
        t->frames = 0;
        return false;
    }
    const plr_vote vote = plr_trial_vote(t);
    if (vote == PLR_VOTE_OPEN) {
        if (t->frames > LONGEST_TRIAL)
            t->frames = 0;
        return false;
    }
    t->frames = 0;
    v->counts[vote] += PLR_R(1);
    plr_slot *slot = &f->slots[f->work.slot_of[k]];
    if (vote == PLR_VOTE_TWISTS) {
        slot->moving = 0;
        note_voter(v, slot->id);
    } else if (v->trusted_frames > 0) {
        slot->moving = 1;
    }
    return true;
}

/* Gives each free trial a point. It begins at another one in each frame, so that all have their
 * turn. */
static void ask_others(plr_filter *f, const plr_frame *frame, unsigned n) {
    plr_votes *v = &f->own.votes;
    unsigned next = 0;
    for (unsigned t = 0; t < PLR_TRIALS; t++) {
        if (v->trials[t].frames > 0)
            continue;
        for (bool found = false; next < n && !found; next++) {
            const unsigned k = (next + f->frame_number) % n;
            const plr_observation *seen = &frame->observations[f->work.order[k]];
            found = may_be_asked(f, k) && !is_asked(v, seen->id);
            if (found)
                plr_trial_begin(f, &v->trials[t], seen);
        }
    }
}

/* ---------------------------------------------------------------- the verdict */

/* d <- Ad(D'^-1) d + moved */
static void propagate_difference(plr_votes *v, const plr_applied_motion *applied,
                                 const plr_real moved[PLR_POSE_DIM]) {
    plr_real R[9], A[PLR_POSE_SQUARE], d[PLR_POSE_DIM];
    plr_se3_rotation(R, applied->E);
    plr_se3_adjoint_inverse(A, R, applied->p);
    memcpy(d, v->difference, sizeof d);
    plr_mat6_vec(v->difference, A, d);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        v->difference[i] += moved[i];
    v->ways2 += plr_dot3(moved, moved);
    v->frames += PLR_R(1);
}

/* True if the pictures lead away from the twists step by step, and do not toss the pose to and fro, as
 * few or distant points do. A point that stands fits no such motion. */
static bool is_steady(const plr_votes *v) {
    return plr_dot3(v->difference, v->difference) >= STEADY_SHARE * v->frames * v->ways2;
}

/* Back to the pose by twists. */
static void take_back(plr_filter *f) {
    plr_votes *v = &f->own.votes;
    plr_real back[PLR_POSE_DIM];
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        back[i] = -v->difference[i];
    if (plr_pose_is_correction(back))
        plr_pose_correct(f, back);
    forget_difference(v);
    f->totals.widened++;
}

/* Old votes keep their share for ever: only a new one, of any kind, prolongs the trust. */
static bool decide(plr_filter *f, bool voted) {
    plr_votes *v = &f->own.votes;
    const plr_real twists = v->counts[PLR_VOTE_TWISTS], pictures = v->counts[PLR_VOTE_PICTURES];
    const plr_real neither = v->counts[PLR_VOTE_NEITHER], all = twists + pictures + neither;
    const bool share = twists >= SHARE_FOR_TWISTS * all;
    if (share && v->voter_count >= PLR_VOTERS && neither <= MOST_FOR_NEITHER * all &&
        (v->trusted_frames > 0 || is_steady(v))) {
        if (voted || !(v->trusted_frames > 0))
            v->trusted_frames = TRUSTED_FRAMES;
        if (!f->consistency.contradicted)
            return false;
        take_back(f);
        return true;
    }
    if (!share && pictures > FEWEST_FOR_PICTURES) {
        v->trusted_frames = v->voter_count = 0;
        forget_difference(v);
    }
    return false;
}

bool plr_votes_add(plr_filter *f, const plr_frame *frame, unsigned n,
                   const plr_applied_motion *believed, const plr_applied_motion *applied,
                   const plr_correction *correction, const plr_real moved[PLR_POSE_DIM]) {
    const plr_consistency *c = &f->consistency;
    plr_votes *v = &f->own.votes;
    plr_candidates candidates;
    bool voted = false;
    if (f->config.process != PLR_PROCESS_TWIST)
        return false;
    v->trusted_frames -= v->trusted_frames > 0 ? PLR_R(1) : PLR_R(0);
    if (!c->contradicted && !c->drifting && c->settling_frames == 0 && !(v->trusted_frames > 0)) {
        plr_votes_clear(f);
        return false;
    }
    propagate_difference(v, applied, moved);
    add_to_way(v, moved);
    find_candidates(f, believed, applied, correction, moved, &candidates);
    for (unsigned i = 0; i < PLR_VOTE_OPEN; i++)
        v->counts[i] *= COUNTS_DECAY;
    for (unsigned t = 0; t < PLR_TRIALS; t++)
        if (v->trials[t].frames > 0 && ask(f, &v->trials[t], frame, n, &candidates))
            voted = true;
    ask_others(f, frame, n);
    for (unsigned k = 0; k < n; k++) /* a known map says where the body is */
        if (f->work.slot_of[k] != PLR_NO_SLOT && f->slots[f->work.slot_of[k]].known)
            forget_difference(v);
    return decide(f, voted);
}
