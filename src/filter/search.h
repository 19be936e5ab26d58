// SPDX-License-Identifier: MIT
/*
 * The search for a frame's motion (docs/MATH.md 10): nu ~ N(0, I) of the motion D Exp(L nu) at
 * which |nu|^2 + sum of rho(|U_i^-T r_i|^2) is least, by Levenberg's and Marquardt's steps with a
 * bounded number of evaluations. rho is Huber's function. Of the covariance each landmark's 3x3
 * block is used.
 */
#ifndef PLR_FILTER_SEARCH_H
#define PLR_FILTER_SEARCH_H

#include "pelorus/state.h"
#include "state/motion.h"

/* One matched observation. */
typedef struct plr_sighting {
    plr_real
        V[PLR_ROWS *
          PLR_POSE_DIM]; /* covariance of landmark and nu by the biases: P_(i,b) B^T L^-T, 3x6 */
    plr_real P[9];       /* the landmark's covariance once nu is known */
    plr_real U[2][6]; /* of S = J P J^T + R = U^T U: at the best point, and at the one on trial */
    plr_real a[PLR_ROWS * PLR_POSE_DIM]; /* U^-T dz/dnu, 3x6, at the point evaluated last */
    plr_real rho[3];                     /* U^-T r there */
    plr_real closer;    /* P J^T S^-1 r: by how much the observation changes its inverse range */
    plr_real left;      /* the variance of the inverse range after that */
    plr_real weight;    /* Huber's: 1, and less for a large residual */
    plr_real cost;      /* Huber's rho at the best point */
    plr_real at_zero;   /* d^2 around the twists' prediction; negative: no place to linearise */
    plr_real gain;      /* det S there */
    plr_real voice;     /* 1: takes part in the search; 0: known, or barred */
    bool lost;          /* at the point evaluated last it lies behind the camera */
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

/* A point nu = z, and what the derivatives of |z|^2 + sum of Huber's rho(|U^-T r|^2) there are made of. */
typedef struct plr_search_point {
    plr_real z[PLR_POSE_DIM];
    plr_real J[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN]; /* sum of w a^T a, packed upper */
    plr_real b[PLR_POSE_DIM];                          /* sum of w a^T rho */
} plr_search_point;

static inline const plr_observation *plr_search_observation(const plr_search *s, unsigned i) {
    const plr_workspace *w = &s->f->work;
    return &s->frame->observations[w->order[w->used[i]]];
}

static inline plr_slot *plr_search_slot(const plr_search *s, unsigned i) {
    const plr_workspace *w = &s->f->work;
    return &s->f->slots[w->slot_of[w->used[i]]];
}

/* One more sighting, of the observation work.used[s->count], of which no point is known yet. */
void plr_search_add(plr_search *s, plr_real voice);

/* What of the sightings hangs on s->prior and not on nu. */
void plr_search_prepare(plr_search *s);

/* Prepares all sightings for s->prior, and evaluates nu = 0: the best point so far. */
void plr_search_from_zero(plr_search *s, plr_search_point *best);

/* From the best point downhill: a bounded number of trials, each taken only if the sum falls. At
 * the end all sightings stand at the best point. */
void plr_search_descend(plr_search *s, plr_search_point *best);

/* All sightings at nu = z, which becomes the best point. */
void plr_search_go_to(plr_search *s, const plr_real z[PLR_POSE_DIM], plr_search_point *best);

/* U^T U = I + J + damping (I + diag J), packed upper; false if it cannot be factorised. */
bool plr_search_factorise(const plr_search_point *point, plr_real damping,
                          plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN]);

/* The step from a point towards the least sum, from its factor. Returns what it promises of the
 * sum. */
plr_real plr_search_step(const plr_search_point *point, const plr_real *U,
                         plr_real dz[PLR_POSE_DIM]);

#endif
