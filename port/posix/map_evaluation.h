// SPDX-License-Identifier: MIT
/*
 * The map against the landmarks that the recording knows (LANDMARK, known), by id:
 *   rms_m, median_m  of |m^ - A m|, A the truth brought to the estimate's start (posix/evaluation.h)
 *   nees_per_dof     mean of e^T P^-1 e / 3, e = m^ - A m, P the map's own covariance
 * Landmarks that came from the recording themselves are left out.
 */
#ifndef PELORUS_POSIX_MAP_EVALUATION_H
#define PELORUS_POSIX_MAP_EVALUATION_H

#include "pelorus/session.h"
#include "posix/samples.h"

/* NaN where a figure cannot be had. */
typedef struct map_figures {
    size_t landmarks;    /* compared */
    size_t not_positive; /* of them left out of NEES: their covariance has no inverse */
    double rms_m, median_m, nees_per_dof;
    double least_sigma_m, largest_sigma_m; /* claimed: root of the mean variance of an axis */
} map_figures;

/* `made`: plr_landmark_message, as they left the state and at the end. */
void map_figures_of(map_figures *figures, const samples *made, const plr_known_map *known,
                    const plr_pose *A);

#endif
