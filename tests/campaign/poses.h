// SPDX-License-Identifier: MIT
/* Rigid motions in double precision, and how far an estimate is from the truth in its own sigmas.
 * Written for the campaign alone: no line of it is the filter's or the other tests'. */
#ifndef CAMPAIGN_POSES_H
#define CAMPAIGN_POSES_H

#include <stdbool.h>

#include "pelorus/types.h"

/* T Exp(xi), xi = (rho, theta). */
plr_pose pose_moved(const plr_pose *T, const double xi[6]);

/* x_W = R x + p, and back. */
void pose_outwards(const plr_pose *T, const double x[3], double out[3]);
void pose_inwards(const plr_pose *T, const double x[3], double in[3]);

/* xi of T = estimate Exp(xi). */
void pose_error(const plr_pose *estimate, const plr_pose *T, double xi[6]);

/* xi^T P^-1 xi; negative if P is not positive. */
double pose_nees(const double xi[6], const double P[36]);

#endif
