// SPDX-License-Identifier: MIT
/*
 * SE(3) in double from first principles: 4x4 matrices, row by row, and power series, no closed form.
 * Slow, and independent of src/math. Tangent vectors are (rho, theta).
 */
#ifndef PELORUS_TEST_RIGID_H
#define PELORUS_TEST_RIGID_H

#include "pelorus/types.h"

/* C = A B for n x n; C overlaps neither. */
void square_multiply(unsigned n, const double *A, const double *B, double *C);

/* M = Exp(xi), 4x4: the power series of the matrix exponential, for |theta| <= pi. */
void rigid_exp(double M[16], const double xi[6]);

/* N = M^-1 for a rigid motion: [R^T, -R^T p]. */
void rigid_inverse(double N[16], const double M[16]);

/* y = R x + p; y may be x. */
void rigid_apply(double y[3], const double M[16], const double x[3]);

/* The rotation of a motion, and of its inverse, 3x3. */
void rigid_rotation(double R[9], const double M[16]);
void rigid_rotation_back(double Rt[9], const double M[16]);

/* Makes R of M a rotation again, to rounding. */
void rigid_clean(double M[16]);

/* The same motion in the library's type. */
void rigid_from_pose(double M[16], const plr_pose *pose);
void rigid_to_pose(plr_pose *pose, const double M[16]);

/* The first-order part of a motion near identity: M = I + [xi]^ + O(xi^2). */
void rigid_vee(double xi[6], const double M[16]);

/* xi with Exp(xi) = E, by Newton's steps from its first-order part; for motions well below pi rad. */
void rigid_log(double xi[6], const double E[16]);

/* ad(xi) = [ [theta]x, [rho]x; 0, [theta]x ], 6x6. */
void rigid_ad(double ad[36], const double xi[6]);

/* Ad(M) = [R, [p]x R; 0, R], 6x6. */
void rigid_adjoint(double Ad[36], const double M[16]);

/* Jr(xi) = sum_k (-ad xi)^k / (k+1)!, 6x6, for |theta| <= pi. */
void rigid_right_jacobian(double Jr[36], const double xi[6]);

#endif
