// SPDX-License-Identifier: MIT
/* The motion between frames, and its application to landmarks and covariance. */
#ifndef PLR_FILTER_PREDICT_H
#define PLR_FILTER_PREDICT_H

#include "pelorus/state.h"
#include "process/process.h"
#include "state/motion.h"

/* Carries the pose to t_ns by the last reading. */
void plr_predict_to(plr_filter *f, plr_time_ns t_ns);

/* Plans the step that ends with a reading at t_ns (process/process.h): its seconds are those since the filter's
 * time, its interval that since the last reading, or since the pose was set. PLR_OK, or why the reading is refused:
 * then, and in mapping, where there is none, the step is not filled. Changes nothing. */
plr_status plr_predict_plan(const plr_filter *f, plr_time_ns t_ns,
                            const plr_real reading[PLR_POSE_DIM], plr_process_step *step);

/* Moves the state by a reading as planned, or counts a refused one. */
plr_status plr_predict_accept(plr_filter *f, plr_time_ns t_ns, const plr_real reading[PLR_POSE_DIM],
                              plr_status planned, const plr_process_step *step);

/* Counts a reading that is refused, and returns the status. While none is taken the pose's covariance grows. */
plr_status plr_predict_refuse(plr_filter *f, plr_status status);

/* Applies a motion D' (state/motion.h) to landmarks and covariance, and moves the pose from D to D'. In `body` the motion's
 * noise is kept in work.noise, not in P, until plr_covariance_close_noise. PLR_E_DIVERGED if a variance is
 * negative or not finite, or the step too large; likewise plr_predict_apply_prior and _pending. */
plr_status plr_predict_apply(plr_filter *f, const plr_applied_motion *applied);

/* Applies the accumulated motion to landmarks and covariance without observations: at nu = 0. */
plr_status plr_predict_apply_prior(plr_filter *f);

/* Discards the accumulated motion; the biases' walk of its duration is still added. */
void plr_predict_drop(plr_filter *f);

/* Applies the accumulated motion, if there is any, at nu = 0. In `body` its noise stays open. */
plr_status plr_predict_apply_pending(plr_filter *f);

#endif
