// SPDX-License-Identifier: MIT
/*
 * Rotations, SO(3): the exponential and the coefficients of its Jacobians, by power series of fixed
 * length. No function of a mathematics library is used, so every target computes the same bits.
 * Accurate to rounding for |theta| <= pi rad.
 */
#ifndef PLR_MATH_SO3_H
#define PLR_MATH_SO3_H

#include "pelorus/config.h"

/* The coefficients that the formulas of SO(3) and SE(3) need, as functions of t = |theta|. */
typedef struct plr_so3_series {
    plr_real a; /* sin t / t */
    plr_real b; /* (1 - cos t) / t^2 */
    plr_real c; /* (t - sin t) / t^3 */
    plr_real d; /* (t^2 + 2 cos t - 2) / (2 t^4) */
    plr_real e; /* (2 t - 3 sin t + t cos t) / (2 t^5) */
} plr_so3_series;

/* All five at theta2 = |theta|^2. */
void plr_so3_series_at(plr_so3_series *s, plr_real theta2);

/* R = Exp(theta) = I + a [theta]x + b [theta]x^2 (Rodrigues). */
void plr_so3_exp(plr_real R[9], const plr_real theta[3]);

/* E = Exp(theta) - I, with the relative precision of theta, and not rounded in units of 1. */
void plr_so3_expm1(plr_real E[9], const plr_real theta[3]);

/* plr_so3_orthonormalise of R = I + E, computed from the small numbers of E without forming R. */
void plr_so3_orthonormalise_small(plr_real E[9]);

/* theta with Exp(theta) = R, |theta| < pi; near zero for half a turn, whose axis is lost. */
void plr_so3_log(plr_real theta[3], const plr_real R[9]);

/* R <- R (3 I - R^T R) / 2: a Newton step towards the nearest rotation, which squares the error. */
void plr_so3_orthonormalise(plr_real R[9]);

#endif
