// SPDX-License-Identifier: MIT
/*
 * Whether the points of a frame agree with each other where they differ from the twists. If the
 * twists are wrong, all points lean to the same side, as the twists' error says. If some of the
 * points move, those at rest do not lean with them: then it is the scene that moves, and the twists
 * are believed (docs/MATH.md 17).
 */
#ifndef PLR_FILTER_DISSENT_H
#define PLR_FILTER_DISSENT_H

#include <stdbool.h>

#include "pelorus/state.h"

/* Sums over points of m, how far a point's innovations lean towards the motion n that the pictures
 * say beside the twists, and of g, how far they should. */
typedef struct plr_dissent {
    bool asked;               /* false: pictures and twists agree, and nothing is asked */
    plr_real n[PLR_POSE_DIM]; /* in the twists' sigmas, over the frames of a window */
    unsigned points;
    plr_real mm, mg, gg;
} plr_dissent;

/* Takes n from the windows of consistency.h. */
void plr_dissent_begin(const plr_filter *f, plr_dissent *d);

/* Adds a point: its track so far; a, 3x6, the derivative of its whitened innovation by n; and M,
 * packed upper triangle, with M^T M the covariance of that innovation as the others predict it: of a
 * point that they cannot predict nothing is expected. */
void plr_dissent_add(plr_dissent *d, const plr_slot *slot,
                     const plr_real a[PLR_ROWS * PLR_POSE_DIM], const plr_real M[6]);

/* True if no motion common to all the points explains how they lean. */
bool plr_dissent_is_found(const plr_dissent *d);

#endif
