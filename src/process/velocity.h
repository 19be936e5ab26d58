// SPDX-License-Identifier: MIT
/*
 * Velocities measured by small sensors, beside the twists (docs/MATH.md 18). A reading is held
 * until the next one of its sensor, as a twist is, with a white noise of density variance times
 * interval. In each step of the motion twist and readings are combined by their covariances; the
 * difference informs about the twists' biases, and is collected until the next correction, so that
 * twists, readings and frames may come in any order.
 */
#ifndef PLR_PROCESS_VELOCITY_H
#define PLR_PROCESS_VELOCITY_H

#include <stdbool.h>

#include "pelorus/belief.h"
#include "pelorus/source.h"
#include "state/rows.h"

/* Holds rows from now on, at index `which` < PLR_HELD_VELOCITIES. The interval of a sensor's first
 * reading is not known yet, so only the second one is held. */
void plr_velocity_hold(const plr_belief *belief, plr_source *source, unsigned which,
                       const plr_twist_rows *rows);

/* Drops all held rows and what they say of the biases: the clock or the biases change. */
void plr_velocity_forget(plr_source *source);

/* Drops the information about the biases, which a correction has used. */
void plr_velocity_forget_bias(plr_source *source);

/* True if rows are held for a step from now to end_ns. */
bool plr_velocity_is_held(const plr_belief *belief, const plr_source *source, plr_time_ns end_ns);

/* Corrects a step of `seconds` to end_ns, with displacement xi and its covariance V, 6x6, by all
 * held rows. Rows that the step contradicts are dropped until their sensor's next reading. The
 * derivative of the step's error by the biases' error is then -seconds T, T 6x6. */
void plr_velocity_fuse(const plr_belief *belief, plr_source *source, plr_time_ns end_ns,
                       plr_real seconds, plr_real xi[PLR_POSE_DIM], plr_real V[PLR_POSE_SQUARE],
                       plr_real T[PLR_POSE_SQUARE]);

/* True if there is information about the biases for plr_velocity_bias_rows. */
bool plr_velocity_informs_bias(const plr_source *source);

/* The information as two measurements with R = I: H and r of part 0 or 1. */
void plr_velocity_bias_rows(const plr_belief *belief, const plr_source *source, unsigned part,
                            plr_rows *H, plr_real r[PLR_ROWS]);

#endif
