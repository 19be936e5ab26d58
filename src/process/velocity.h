// SPDX-License-Identifier: MIT
/*
 * Velocities that small sensors measure, beside the twists (docs/MATH.md 18). A reading holds until
 * the sensor's next one, as a twist does, and its noise counts as white: variance times seconds
 * between readings is its density. In each step of the motion the two are weighed against each
 * other, the motion takes the mean, and their difference is information about the twists' biases. It
 * waits in f->velocities.bias_Lambda until the next correction, so that twists, readings and frames may come in
 * any order.
 */
#ifndef PLR_PROCESS_VELOCITY_H
#define PLR_PROCESS_VELOCITY_H

#include <stdbool.h>

#include "pelorus/state.h"
#include "state/rows.h"

/* The rows hold from now on; `which` says in whose place, below PLR_HELD_VELOCITIES. Of a sensor's
 * first reading the interval is not known yet: it holds from the second one on. */
void plr_velocity_hold(plr_filter *f, unsigned which, const plr_twist_rows *rows);

/* What is held, and what it said of the biases, is forgotten: another clock, or another bias. */
void plr_velocity_forget(plr_filter *f);

/* What was said of the biases has been used. */
void plr_velocity_forget_bias(plr_filter *f);

/* Does anything hold for a step that begins now? */
bool plr_velocity_is_held(const plr_filter *f);

/* A step of `seconds` by twists: its displacement xi, with covariance V, 6x6. Both are corrected by
 * all that holds. The step's error then depends on the biases' by -seconds T db, T 6x6. */
void plr_velocity_fuse(plr_filter *f, plr_real seconds, plr_real xi[PLR_POSE_DIM],
                       plr_real V[PLR_POSE_SQUARE], plr_real T[PLR_POSE_SQUARE]);

/* Is there information about the biases, for plr_velocity_bias_rows? */
bool plr_velocity_informs_bias(const plr_filter *f);

/* It as two measurements: H, r and R of part 0 and of part 1. */
void plr_velocity_bias_rows(const plr_filter *f, unsigned part, plr_rows *H, plr_real r[PLR_ROWS]);

#endif
