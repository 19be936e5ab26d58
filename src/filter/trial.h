// SPDX-License-Identifier: MIT
/* One point, followed over frames under several motions of the camera: a Kalman filter of
 * (x/z, y/z, 1/z) under each (docs/MATH.md 17). */
#ifndef PLR_FILTER_TRIAL_H
#define PLR_FILTER_TRIAL_H

#include <stdbool.h>

#include "pelorus/state.h"

/* What a point that stands says. */
typedef enum plr_vote {
    PLR_VOTE_TWISTS,   /* it fits the twists' motion, and no other */
    PLR_VOTE_PICTURES, /* it fits a motion of the pictures, and not the twists' */
    PLR_VOTE_NEITHER,  /* it fits none: it moves in its own way, or is no point */
    PLR_VOTE_OPEN
} plr_vote;

/* The motions that a point is followed under. The third is the pictures' way, steadied, with the twists' turn:
 * distant points, which tell the turn alone, fit it as well as the twists' and stay undecided. */
enum { PLR_BY_TWISTS, PLR_BY_PICTURES, PLR_BY_PICTURES_WAY, PLR_MOTIONS };

/* Motions of the left camera, and the variances of their noise, m^2 and rad^2. */
typedef struct plr_candidates {
    struct {
        plr_real R[9], p[3];
    } motion[PLR_MOTIONS];
    plr_real way_variance, turn_variance;
} plr_candidates;

/* Begins with what a frame sees. */
void plr_trial_begin(const plr_filter *f, plr_trial *t, const plr_observation *seen);

/* Follows the point by one frame. False if it cannot be followed. */
bool plr_trial_follow(const plr_filter *f, plr_trial *t, const plr_observation *seen,
                      const plr_candidates *c);

plr_vote plr_trial_vote(const plr_trial *t);

/* True if it follows the point `id`. */
bool plr_trial_is_of(const plr_trial *t, uint32_t id);

/* Ids as two numbers of 16 bits: all that is saved of votes are numbers. */
void plr_trial_set_id(plr_real halves[2], uint32_t id);
bool plr_trial_is_id(const plr_real halves[2], uint32_t id);

#endif
