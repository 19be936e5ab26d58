// SPDX-License-Identifier: MIT
/*
 * The search for a frame's motion D Exp(L nu), nu ~ N(0, I) (docs/MATH.md 10): the nu at which
 * |nu|^2 + sum of rho(|U_i^-T r_i|^2) is smallest. rho is Huber's function. The method is that of
 * Levenberg and Marquardt with a bounded number of evaluations. Of the state's covariance it uses
 * each landmark's own 3x3 block.
 */
#ifndef PLR_FILTER_SEARCH_H
#define PLR_FILTER_SEARCH_H

#include "pelorus/state.h"
#include "state/motion.h"
#include "state/sightings.h"

/* A matched observation as a term of the sum. "Last point" is the nu at which it was evaluated last. */
typedef struct plr_residual {
    plr_real V[PLR_ROWS * PLR_POSE_DIM]; /* covariance of landmark and nu: P_(i,b) B^T L^-T, 3x6 */
    plr_real P[9];                       /* the landmark's covariance if nu were known */
    plr_real U[2][6]; /* of S = J P J^T + R = U^T U: at the best point, and at the one on trial */
    plr_real a[PLR_ROWS * PLR_POSE_DIM]; /* U^-T dz/dnu at the last point, 3x6 */
    plr_real e[3];                       /* U^-T r there: the whitened residual */
    plr_real range_change;   /* P J^T S^-1 r, third row: the observation's correction of the inverse
                                range, 1/m */
    plr_real range_variance; /* the variance of the inverse range after that correction */
    plr_real weight;         /* in the sums of the last point: Huber's, 0 to 1; 0: not in them */
    plr_real cost;           /* Huber's rho at the best point */
    plr_real prior_d2;       /* d^2 about the twists' prediction; negative: too uncertain */
    plr_real det_S;          /* of that prediction */
    plr_real active;         /* 1: takes part in the search; 0: a known landmark, or excluded */
    bool behind;             /* at the last point the landmark lies behind the camera */
    bool uncertain;          /* the prediction is too uncertain for a linear correction */
    bool trimmed;            /* takes no part for now: it fits worst, or the gate rejects it */
    uint16_t row;            /* of the frame */
    plr_real twist_d2;       /* |e|^2 at the result of the search with the twists */
} plr_residual;

/* The search for nu. */
typedef struct plr_search {
    plr_filter *f;
    const plr_sightings *sightings;
    plr_residual *residuals; /* in work.Vt, which is free until the motion is applied */
    unsigned count;
    bool opens_fixed_gate; /* plr_picture_decision */
    uint64_t left_out;     /* rules of the supervisor */
    unsigned current;      /* which U belongs to the best point */
    plr_applied_motion prior;
} plr_search;

/* A point nu = z, with the sums from which the gradient and the Hessian of the cost follow
 * there. */
typedef struct plr_search_point {
    plr_real z[PLR_POSE_DIM];
    plr_real J[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN]; /* sum of w a^T a, packed upper */
    plr_real b[PLR_POSE_DIM];                          /* sum of w a^T e */
} plr_search_point;

static inline const plr_sighting *plr_search_row(const plr_search *s, unsigned i) {
    PLR_ASSERT(i < s->count && s->residuals[i].row < s->sightings->count);
    return &s->sightings->at[s->residuals[i].row];
}

static inline plr_slot *plr_search_slot(const plr_search *s, unsigned i) {
    return plr_slot_of(&s->f->belief, plr_search_row(s, i));
}

/* Appends a matched row of the frame. `active` is 1 if it takes part in the search, else 0. */
void plr_search_add(plr_search *s, unsigned row, plr_real active);

/* Fills the fields of all residuals that depend on s->prior alone: V and P. */
void plr_search_prepare(plr_search *s);

/* Prepares all residuals for s->prior and evaluates nu = 0, which becomes the best point. */
void plr_search_from_zero(plr_search *s, plr_search_point *best);

/* Improves the best point by a bounded number of trials, each accepted only if the cost falls. At
 * the end all residuals are evaluated at the best point. */
void plr_search_descend(plr_search *s, plr_search_point *best);

/* The motion on which three fifths agree, though the others are off by any amount: twice, sets the two
 * fifths out that fit the best point worst, and descends without them (concentration steps of least
 * trimmed squares). At the end all residuals are evaluated at the best point. */
void plr_search_concentrate(plr_search *s, plr_search_point *best);

/* Makes the sums of `best`, the point evaluated last, anew of what is not trimmed, and descends from there. */
void plr_search_without_trimmed(plr_search *s, plr_search_point *best);

/* Evaluates all residuals at nu = z, which becomes the best point. */
void plr_search_go_to(plr_search *s, const plr_real z[PLR_POSE_DIM], plr_search_point *best);

/* Evaluates them at the best point again, when something else has changed. */
void plr_search_again(plr_search *s, plr_search_point *best);

/* U^T U = I + J + damping (I + diag J), packed upper; false if it cannot be factorised. */
bool plr_search_factorise(const plr_search_point *point, plr_real damping,
                          plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN]);

/* The step dz from a point towards the minimum; U is from plr_search_factorise. Returns by how much
 * the cost should fall. */
plr_real plr_search_step(const plr_search_point *point, const plr_real *U,
                         plr_real dz[PLR_POSE_DIM]);

#endif
