// SPDX-License-Identifier: MIT
/*
 * Rigid motions, SE(3), with tangent vectors xi = (rho, theta): translation first, m and rad. A
 * motion is a pair (R, p) that maps x to R x + p. 6x6 matrices act on (rho, theta) and are stored
 * row by row.
 */
#ifndef PLR_MATH_SE3_H
#define PLR_MATH_SE3_H

#include "pelorus/config.h"

/* (R, p) = Exp(xi): p = (I + b [theta]x + c [theta]x^2) rho. Course report III.8. */
void plr_se3_exp(plr_real R[9], plr_real p[3], const plr_real xi[6]);

/* The same with E = R - I in place of R: see plr_so3_expm1. */
void plr_se3_expm1(plr_real E[9], plr_real p[3], const plr_real xi[6]);

/* Ad(T) = [R, [p]x R; 0, R]. */
void plr_se3_adjoint(plr_real Ad[36], const plr_real R[9], const plr_real p[3]);

/* Ad(T^-1) = [R^T, -R^T [p]x; 0, R^T]. */
void plr_se3_adjoint_inverse(plr_real Ad[36], const plr_real R[9], const plr_real p[3]);

/* The right Jacobian: Exp(xi + d) = Exp(xi) Exp(Jr(xi) d) to first order, in closed form (Barfoot,
 * State Estimation for Robotics, 7.86, at -xi). */
void plr_se3_right_jacobian(plr_real Jr[36], const plr_real xi[6]);

/* (I + E, p) <- (I + E, p) (I + dE, dp) */
void plr_se3_append(plr_real E[9], plr_real p[3], const plr_real dE[9], const plr_real dp[3]);

/* R = I + E */
void plr_se3_rotation(plr_real R[9], const plr_real E[9]);

/* x <- T^-1 x = x + (E^T (x - p) - p) for T = (I + E, p). The change is computed by itself and the
 * point rounded only once, so that many small motions do not change its distance. */
void plr_se3_move_back(plr_real x[3], const plr_real E[9], const plr_real p[3]);

/* y = T^-1 x = R^T (x - p); y may not be x. */
void plr_se3_inverse_point(plr_real y[3], const plr_real R[9], const plr_real p[3],
                           const plr_real x[3]);

#endif
