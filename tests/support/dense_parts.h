// SPDX-License-Identifier: MIT
/* Matrices, geometry and Jacobians of the dense filter, in double, as docs/MATH.md has them. */
#ifndef PELORUS_TEST_DENSE_PARTS_H
#define PELORUS_TEST_DENSE_PARTS_H

#include <stdbool.h>

#include "support/dense_ekf.h"

enum { DENSE_BIAS = 6 }; /* the first row of the biases, where they are estimated */

bool dense_is_body(const dense_ekf *e);

/* The pose at which P and the landmarks of `body` stand: before the pending motion. */
void dense_reference(const dense_ekf *e, double T_WB[16]);

/* No motion is pending any more. */
void dense_forget_motion(dense_ekf *e);

/* The index of the landmark of that id; `count` if there is none. */
unsigned dense_find(const dense_ekf *e, uint32_t id);

/* --- matrices, row by row; to be freed --- */

double *dense_zeros(unsigned n, unsigned m);
double *dense_identity(unsigned n);

/* A[row.., column..] = B, of rows x columns; ld is A's. */
void dense_put(double *A, unsigned ld, unsigned row, unsigned column, unsigned rows,
               unsigned columns, const double *B);

/* P <- F P F^T */
void dense_sandwich(dense_ekf *e, const double *F);

/* --- geometry --- */

/* y = R x + p of a 4x4 motion; y may be x. */
void dense_apply(double y[3], const double M[16], const double x[3]);

/* The 3x3 rotation of a 4x4 motion, and of its inverse. */
void dense_rotation(double R[9], const double M[16]);
void dense_rotation_back(double Rt[9], const double M[16]);

/* 4x4 from a pose. */
void dense_motion(double M[16], const plr_pose *pose);

/* Ad(M) = [R, [p]x R; 0, R], 6x6. */
void dense_adjoint(double Ad[36], const double M[16]);

/* K = [-I | [q]x] Ad(T_CB), 3x6: how a point of the camera moves by a twist of the body. */
void dense_camera_by_pose(const dense_ekf *e, const double q[3], double K[18]);

/* J = R_WB [I | -[s]x], 3x6: how a point that stands at s in the body moves in the world. */
void dense_world_by_pose(const dense_ekf *e, const double s[3], double J[18]);

/* R_WC = R_WB R_CB^T, 3x3. */
void dense_camera_to_world(const dense_ekf *e, double R_WC[9]);

/* Moves the landmarks of `body` under a motion D of the body, and puts their blocks into F (dim x dim).
 * K[i] (3x6) is then how landmark i takes a twist of the body. */
void dense_move_points(dense_ekf *e, const double D[16], double *F, double *K);

/* z = (uL, uR, v) of q and Dz = dz/dq. */
void dense_project(const plr_calibration *c, const double q[3], double z[3], double Dz[9]);

/* q of z, by solving the projection for it, and the covariance Dz^-1 R Dz^-T of pixels. */
void dense_back_project(const plr_calibration *c, const double z[3], double pixel_variance,
                        double q[3], double P_q[9]);

/* q of a landmark: stored, or brought from the world. */
void dense_in_camera(const dense_ekf *e, unsigned landmark, double q[3]);

/* The rigid motion eta of the body that the corrections of points q have in common, where the pose's
 * own, xi, weighs a tenth (docs/MATH.md 11). A point's correction counts as the angle that it makes,
 * and along the ray as the disparity. */
void dense_common_motion(const dense_ekf *e, unsigned count, double (*q)[3],
                         double (*correction)[3], const double xi[6], double eta[6]);

/* A correction of a point as the chart makes it: bearing and inverse range (MATH 5), written
 * without a basis. q~ = retr(q, Jw e), and J the transport Ji(q~) diag(M, 1) Jw(q), 3x3. */
void dense_polar_step(const double q[3], const double e[3], double moved[3], double J[9]);

#endif
