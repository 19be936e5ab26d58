// SPDX-License-Identifier: MIT
/*
 * The accumulating test: a sum over frames of six differences, in which older ones count less, beside the
 * covariance that it should have, in units of what is usual (docs/SUPERVISION.md). It sees what no
 * single frame shows: a difference that is small and stays.
 */
#ifndef PLR_SUPERVISE_SUM_H
#define PLR_SUPERVISE_SUM_H

#include "pelorus/supervisor.h"

/* s <- keep s + x, V <- keep^2 V + C; C packed upper triangle, 6x6. */
void plr_sum_add(plr_sum *sum, plr_real keep, const plr_real x[PLR_POSE_DIM],
                 const plr_real C[PLR_POSE_TRIANGLE]);

/* s^T (D V D + floor I)^-1 s, chi-square with 6 degrees of freedom, with D^2 = diag(usual), or I where that
 * is NULL. `floor` keeps directions of which nothing is said out of it. */
plr_real plr_sum_statistic(const plr_sum *sum, const plr_real *usual, plr_real floor);

/* n = (V + floor I)^-1 s: the difference by pictures alone, without the odometry's prior. */
void plr_sum_by_pictures(const plr_real s[PLR_POSE_DIM], const plr_real V[PLR_POSE_TRIANGLE],
                         plr_real floor, plr_real n[PLR_POSE_DIM]);

#endif
