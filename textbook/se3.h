// SPDX-License-Identifier: MIT
/* Rigid motions as 4x4 matrices, row by row, by their power series: nothing here comes from src/. */
#ifndef PELORUS_TEXTBOOK_SE3_H
#define PELORUS_TEXTBOOK_SE3_H

#include "pelorus/types.h"

/* C = A B, 4x4; C may be neither. */
void se3_multiply(const double A[16], const double B[16], double C[16]);

/* M^-1 = [R^T | -R^T p]; may not be M. */
void se3_inverse(const double M[16], double inverse[16]);

/* y = R x + p; y may be x. */
void se3_apply(const double M[16], const double x[3], double y[3]);

/* M <- Exp(xi), xi = (rho, theta): sum of hat(xi)^k / k!. */
void se3_exp(const double xi[6], double M[16]);

/* 6x6: Ad(M) = [R, hat(p) R; 0, R]. */
void se3_adjoint(const double M[16], double Ad[36]);

/* 6x6: Exp(xi + dx) = Exp(xi) Exp(J dx): sum of (-ad(xi))^k / (k + 1)!. */
void se3_right_jacobian(const double xi[6], double J[36]);

/* Makes R of M a rotation again, to rounding. */
void se3_clean(double M[16]);

void se3_from_pose(const plr_pose *pose, double M[16]);
void se3_to_pose(const double M[16], plr_pose *pose);

#endif
