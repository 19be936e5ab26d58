// SPDX-License-Identifier: MIT
/*
 * Do the points of a frame agree on a motion that the odometry excludes (docs/MATH.md 17)? The search asks for
 * each of the motions that it finds; nothing is remembered.
 */
#ifndef PLR_SUPERVISE_EXCLUSION_H
#define PLR_SUPERVISE_EXCLUSION_H

#include <stdbool.h>

#include "limits/limits.h"
#include "pelorus/supervisor.h"

/* A matched point at a motion. */
typedef struct plr_excluding_point {
    plr_real active, weight; /* 1: takes part in the search; with Huber's weight */
    plr_real d2,
        by_odometry_d2; /* its squared residual; the same in the search with the odometry */
    bool behind;        /* it would lie behind the camera */
    plr_real tells;     /* of the translation, 1/sigma: a distant point little */
} plr_excluding_point;

/* What the points of a frame say together, of those that take part. */
typedef struct plr_exclusion_evidence {
    unsigned points; /* whether they take part or not */
    unsigned active, agree;
    plr_real parts, weight; /* sums of `active` and `weight` */
    plr_real told;          /* sum of `tells` */
    unsigned misfits;       /* only these can come to support another motion */
    plr_real told_by_misfits;
    unsigned with, against; /* that support the odometry, and the motion found without it */
    plr_real told_against;
} plr_exclusion_evidence;

static inline void plr_exclusion_add(uint64_t left_out, plr_exclusion_evidence *all,
                                     const plr_excluding_point *point) {
    const plr_real clear = plr_limit(left_out, PLR_LIMIT_CLEAR_DIFFERENCE);
    const plr_real near = plr_limit(left_out, PLR_LIMIT_POINT_AGREES);
    const bool agrees = !point->behind && point->d2 < near;
    all->points++;
    all->parts += point->active;
    all->weight += point->weight;
    if (!(point->active > 0))
        return;
    all->active++;
    all->agree += agrees;
    all->told += point->tells;
    if (point->d2 > clear) {
        all->misfits++;
        all->told_by_misfits += point->tells;
    }
    if (agrees && point->by_odometry_d2 > point->d2 + clear) {
        all->against++;
        all->told_against += point->tells;
    }
    all->with += point->by_odometry_d2 < near && point->d2 > point->by_odometry_d2 + clear;
}

/* Which points have a small weight, so that another motion may fit them better. */
typedef enum plr_misfit {
    PLR_MISFIT_NONE,
    PLR_MISFIT_FEW, /* but they tell most of the translation: all others are distant */
    PLR_MISFIT_MANY
} plr_misfit;

/* Of the motion found with the odometry, which is off by nu, |nu|^2 = nu2. */
plr_misfit plr_exclusion_misfit(uint64_t left_out, const plr_exclusion_evidence *all, plr_real nu2);

/* True if three fifths of those that take part agree. */
static inline bool plr_exclusion_most_agree(const plr_exclusion_evidence *all) {
    return 5 * all->agree >= 3 * all->active;
}

/* True if enough points support the motion found without the odometry: at least three, a fifth of all, and four
 * times as many as support the odometry. A point supports the motion that it agrees with, if the other one
 * fits it clearly worse; a wrong match agrees with neither, and is nearer to one of them by chance. If few misfit,
 * those three tell more about the translation than all others do. Of six and more, three fifths must agree with
 * the motion. Of three to five all must, whether they took part in the search or not: three of five may lie on
 * one car, which pulls the estimate of the others with it. If all agree, wheels that slip are likelier than a
 * scene that moves as one. */
bool plr_exclusion_has_support(uint64_t left_out, const plr_exclusion_evidence *all,
                               plr_misfit misfit);

/* True if the points determine that motion in all six directions: none keeps a larger share of the open
 * prior's variance than `unobserved`. */
bool plr_exclusion_is_well_spread(uint64_t left_out, plr_real unobserved);

#endif
