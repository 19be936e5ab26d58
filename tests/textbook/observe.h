// SPDX-License-Identifier: MIT
/* One observation: prediction and derivatives (III.1 to III.4, III.7, III.11), and how points move. */
#ifndef PELORUS_TEXTBOOK_OBSERVE_H
#define PELORUS_TEXTBOOK_OBSERVE_H

#include "textbook/textbook.h"

/* Columns of H that are not zero: six of the pose, three of the landmark. */
enum { OBSERVE_COLUMNS = 9 };

typedef struct observe_line {
    double r[TEXTBOOK_ROWS];                   /* z - h, px */
    double H[TEXTBOOK_ROWS * OBSERVE_COLUMNS]; /* [H_xi | H_m], 4 x 9; in `body` H_xi = 0 */
} observe_line;

/* False if the point lies nearer than min_depth in front of the camera. */
bool observe_linearise(const textbook *t, unsigned landmark, const plr_observation *seen,
                       observe_line *line);

/* Does the gate let an observation through, of Mahalanobis distance d2 and squared residual norm2? */
bool observe_accepts(const textbook *t, double d2, double norm2);

/* What the rows of both images differ by, squared, in pixel variances: its part in d2. */
double observe_row_gap2(const textbook *t, const plr_observation *seen);

/* The pixels of a point q of the camera as three rows, z = (uL, uR, v), where v is the mean of vL and vR,
 * of half the variance, and D = dz/dq, 3x3; D may be NULL. */
void observe_project3(const plr_calibration *c, const double q[3], double z[3], double D[9]);

/* q of pixels, and a factor with S S^T = cov(q), 3x3: the pixels' noise. */
void observe_back_project(const textbook *t, const plr_observation *seen, double q[3], double S[9]);

/* A landmark in the left camera. */
void observe_in_camera(const textbook *t, unsigned landmark, double q[3]);

/* J = R_WB [I | -hat(s)], 3x6: how the pose's error moves a point that stands at s in the body. In
 * `body` the pose is the one of P. */
void observe_world_by_pose(const textbook *t, const double s[3], double J[18]);

/* K = -[I | -hat(q)] Ad(T_CB), 3x6: how a point of the camera moves by a twist of the body. */
void observe_camera_by_pose(const textbook *t, const double q[3], double K[18]);

/* R_WB R_CB^T, 3x3. */
void observe_camera_to_world(const textbook *t, double R_WC[9]);

#endif
