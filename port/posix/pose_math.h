// SPDX-License-Identifier: MIT
/* Rigid motions in double precision, with the library of the machine: for evaluation and output,
 * never for the estimate. Matrices are row by row. */
#ifndef PELORUS_POSIX_POSE_MATH_H
#define PELORUS_POSIX_POSE_MATH_H

#include "pelorus/types.h"

/* C = A B */
void pose_compose(plr_pose *C, const plr_pose *A, const plr_pose *B);

/* A^-1; the result may not be A. */
void pose_inverse(plr_pose *inverse, const plr_pose *A);

/* Angle of a rotation, 0 to pi. */
double rotation_angle(const double R[9]);

/* (rho, theta) with A = Exp(rho, theta): theta = the rotation vector, rho = V(theta)^-1 p. */
void pose_log(double xi[6], const plr_pose *A);

/* Unit quaternion (x, y, z, w) of a rotation, with w >= 0. */
void rotation_quaternion(double q[4], const double R[9]);

/* The rotation of a unit quaternion (x, y, z, w). */
void rotation_from_quaternion(double R[9], const double q[4]);

#endif
