// SPDX-License-Identifier: MIT
/*
 * The start with an IMU (docs/MATH.md 19): tilt, velocity and biases, from readings at rest or in
 * motion. Position and heading cannot be measured; they stay as they were set.
 */
#ifndef PLR_PROCESS_ALIGNMENT_H
#define PLR_PROCESS_ALIGNMENT_H

#include <stdbool.h>

#include "pelorus/belief.h"
#include "pelorus/settings.h"
#include "pelorus/source.h"

/* Not started, nothing averaged. */
void plr_alignment_clear(plr_source *source);

/* Adds a reading (a, w) of before the start, and starts by it if the readings are good for that: sets pose,
 * velocity and biases, with their covariance. There may be no landmarks. */
void plr_alignment_add(plr_belief *belief, plr_source *source, const plr_config *config,
                       plr_time_ns t_ns, const plr_real reading[PLR_POSE_DIM]);

/* True in the first half of the stretch that is averaged. */
bool plr_alignment_is_early(const plr_alignment *at, plr_time_ns t_ns);

/* The stretch that is averaged begins anew: the pictures show that the body moves. */
void plr_alignment_restart(plr_source *source);

/* Notes that the body moves or turns. A gyro that turned while the accelerometer stood still is the
 * sensor's fault until a rest has shown otherwise, whatever moves after that. */
void plr_alignment_does_not_stand(plr_source *source, plr_imu_fault how);

/* Starts with velocity v and the pose as they were set. */
void plr_alignment_given(plr_belief *belief, plr_source *source, const plr_real v[PLR_VELOCITY_DIM],
                         const plr_real variance[PLR_VELOCITY_DIM]);

/* After each frame of the first seconds: notes that the readings' mean does not fit gravity in the
 * pose, as a start that was given may have it: units, signs, axes. */
void plr_alignment_watch_gravity(const plr_belief *belief, plr_source *source);

/* The pose was set with a covariance, a position was measured, or a landmark of a map came in:
 * position and yaw are not free any more, and an anchor would lose what is known of them. */
void plr_alignment_keep_world(plr_source *source);

/* The clock is about to be set from belief->t_ns to t_ns: the time since the start stays what it is. */
void plr_alignment_follow_clock(const plr_belief *belief, plr_source *source, plr_time_ns t_ns);

/* True between a start in motion and the anchor: errors of second order are not in P yet. */
bool plr_alignment_is_unsettled(const plr_source *source);

/* Some time after a start in motion: lays the world anew so that the present position and yaw are exact,
 * or known to start_sigma. Where the world is given, P is widened instead. Not while a motion is pending. */
void plr_alignment_anchor(plr_belief *belief, const plr_motion *motion, plr_source *source,
                          const plr_config *config);

#endif
