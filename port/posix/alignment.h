// SPDX-License-Identifier: MIT
/* The rigid motion that brings one set of points closest to another. */
#ifndef PELORUS_POSIX_ALIGNMENT_H
#define PELORUS_POSIX_ALIGNMENT_H

#include <stddef.h>

#include "pelorus/types.h"

/* The A in SE(3) that makes sum |a_k - A b_k|^2 least, without scale, in closed form: the rotation
 * is the eigenvector of the largest eigenvalue of Horn's 4x4 matrix (J. Opt. Soc. Am. A 4, 1987).
 * a and b: n points of 3, n > 0. */
void alignment_fit(plr_pose *A, const double *a, const double *b, size_t n);

#endif
