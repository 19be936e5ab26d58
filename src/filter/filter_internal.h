// SPDX-License-Identifier: MIT
/* Constants and functions that several files of the filter use; not for callers. */
#ifndef PLR_FILTER_INTERNAL_H
#define PLR_FILTER_INTERNAL_H

#include <stdbool.h>

#include "math/validate.h"
#include "pelorus/filter.h"

/* plr_filter.magic of an initialised filter. */
#define PLR_FILTER_MAGIC 0x504C5231U

/* Forgets the last reading. Until the next one the body is assumed to stand still, by twists, or to keep its
 * velocity, by an IMU. */
void plr_filter_forget_reading(plr_filter *f);

/* The prior's variance of bias k of 0 to 5, as the settings say. */
static inline double plr_filter_bias_variance(const plr_config *config, unsigned k) {
    const double linear = config->process == PLR_PROCESS_IMU ? config->bias_accel_sigma_mps2
                                                             : config->bias_velocity_sigma_mps;
    const double sigma = k < 3 ? linear : config->bias_gyro_sigma_radps;
    return sigma * sigma;
}

/* The biases' covariance becomes a diagonal, uncorrelated with the rest. Only without landmarks. */
void plr_filter_begin_bias(plr_filter *f, const double variance[PLR_BIAS_DIM]);

/* With an IMU: the velocity's covariance becomes that of an unknown one, likewise. */
void plr_filter_begin_velocity(plr_filter *f);

/* Counts a refused call in the totals, and returns its status. */
plr_status plr_filter_refuse(plr_filter *f, plr_status status);

/* What odometry and small sensors have sent, at a time of the caller's or the filter's. */
plr_readings_evidence plr_filter_readings_at(const plr_filter *f, plr_time_ns now_ns);

/* The motion that is not yet in P, for the supervisor; the matches are not filled. */
void plr_filter_pending_motion(const plr_filter *f, plr_picture_evidence *e);

/* Tells the supervisor of the pending motion, which is about to be applied without a frame. */
void plr_filter_note_motion(plr_filter *f);

/* Stores the pose's covariance after a good frame, for plr_filter_recover. */
void plr_filter_store_for_recovery(plr_filter *f);

/* Adds the motion that is about to be applied to the stored covariance. */
void plr_filter_propagate_recovery(plr_filter *f);

/* At the present pose: sets its covariance to P, drops the landmarks and the pending motion, takes the
 * velocity for unknown, and doubts the pose until pictures and twists agree. Returns what the supervisor decides
 * now of the frame at hand. */
plr_picture_decision plr_filter_begin_anew(plr_filter *f, const plr_real P[PLR_POSE_SQUARE],
                                           bool relocated);

/* The biases' covariance becomes their prior's, and the mean of one that is further from its own than so many
 * sigmas. Only without landmarks. */
void plr_filter_begin_prior_bias(plr_filter *f, plr_real sigmas);

/* A variance is no longer positive: notes when. Returns PLR_E_DIVERGED, for the caller to pass on until
 * plr_filter_recover. */
plr_status plr_filter_diverge(plr_filter *f);

/* plr_covariance_close_noise, where a failure is a divergence. */
plr_status plr_filter_close_noise(plr_filter *f, plr_real nu[PLR_POSE_DIM]);

/* After a divergence: keeps the pose, sets its covariance to the stored one, drops the landmarks,
 * and sets the biases' covariance to their prior's. */
void plr_filter_recover(plr_filter *f);

#endif
