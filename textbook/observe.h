// SPDX-License-Identifier: MIT
/* One observation: prediction and derivatives (III.1 to III.4, III.7, III.11). */
#ifndef PELORUS_TEXTBOOK_OBSERVE_H
#define PELORUS_TEXTBOOK_OBSERVE_H

#include "textbook/textbook.h"

/* Columns of H that are not zero: six of the pose, three of the landmark. */
enum { OBSERVE_COLUMNS = 9 };

typedef struct observe_line {
    double r[TEXTBOOK_ROWS];                   /* z - h, px */
    double H[TEXTBOOK_ROWS * OBSERVE_COLUMNS]; /* [H_xi | H_m], 4 x 9 */
} observe_line;

/* False if the point lies nearer than min_depth in front of the camera. */
bool observe_linearise(const textbook *t, unsigned landmark, const plr_observation *seen,
                       observe_line *line);

/* q of pixels, and a factor with S S^T = cov(q), 3x3: the pixels' noise. */
void observe_back_project(const textbook *t, const plr_observation *seen, double q[3], double S[9]);

/* J = R_WB [I | -hat(s)], 3x6: how the pose's error moves a point that stands at s in the body. */
void observe_world_by_pose(const textbook *t, const double s[3], double J[18]);

/* R_WB R_CB^T, 3x3. */
void observe_camera_to_world(const textbook *t, double R_WC[9]);

#endif
