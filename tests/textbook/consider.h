// SPDX-License-Identifier: MIT
/*
 * A frame that may not teach the biases: Schmidt's update, as it is defined. With the gain's rows of
 * the biases set to zero, K~, the covariance is Joseph's, which holds for any gain:
 *
 *     P <- (I - K~ H) P (I - K~ H)^T + K~ R K~^T
 *
 * all dense. It is the oracle for docs/MATH.md 17, where nothing of this is computed.
 */
#ifndef PELORUS_TEXTBOOK_CONSIDER_H
#define PELORUS_TEXTBOOK_CONSIDER_H

#include "textbook/textbook.h"

/* One row of the frame's H, n long and zero before, from an observation's derivatives by the pose (6)
 * and the landmark (3). */
void consider_row(const textbook *t, const double *by_pose, const double *by_landmark,
                  unsigned landmark, double *row);

/* P after a frame of m rows H, m x n, and `correction` without the biases'. P is of before. */
void consider_biases(textbook *t, unsigned n, unsigned m, const double *H);

#endif
