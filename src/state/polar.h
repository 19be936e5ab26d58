// SPDX-License-Identifier: MIT
/*
 * The polar chart at a point q (docs/MATH.md 5): two bearing angles and inverse range,
 * w = (N^T mu-change, change of 1/r), with r = |q|, mu = q / r, N(mu) a 3x2 orthonormal basis of
 * the plane orthogonal to mu. The error of a far point is nearly Gaussian in it.
 */
#ifndef PLR_STATE_POLAR_H
#define PLR_STATE_POLAR_H

#include <stdbool.h>

#include "pelorus/config.h"

/* The least range, m: the bearing of a nearer point is not defined well enough. */
#define PLR_MIN_RANGE PLR_R(0.01)

/* The chart at one point. */
typedef struct plr_polar {
    plr_real r;       /* m */
    plr_real mu[3];   /* unit vector */
    plr_real N[2][3]; /* the two columns of N(mu) */
} plr_polar;

/* The chart at q, |q| > 0. N: Duff et al., Building an Orthonormal Basis, Revisited (2017). */
void plr_polar_at(plr_polar *chart, const plr_real q[3]);

/* Jw = [N^T / r; -mu^T / r^2], 3x3: point error to chart. */
void plr_polar_from_point(plr_real Jw[9], const plr_polar *chart);

/* Ji = [r N | -r^2 mu], 3x3, the inverse of Jw: chart to point error. */
void plr_polar_to_point(plr_real Ji[9], const plr_polar *chart);

/* Moves a point q along its chart: a = mu x (N w_12), mu+ = Exp(a) mu, 1/r+ = 1/r + w_3, by adding
 * the step, so that a small one is rounded at its own size. *result is the chart there, M =
 * N(mu+)^T Exp(a) N(mu) (2x2) the transport of the bearing. 1/r+ is at least min_inverse_range;
 * *beyond receives the rest of w_3, or 0. True if w was limited: a turn over 1 rad, a range under
 * PLR_MIN_RANGE, or NaN. */
bool plr_polar_retract(plr_polar *result, plr_real M[4], const plr_polar *chart,
                       const plr_real w[3], plr_real min_inverse_range, plr_real q[3],
                       plr_real *beyond);

#endif
