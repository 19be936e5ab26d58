// SPDX-License-Identifier: MIT
/* The replay's results as text files. A NULL file is left alone. */
#ifndef PELORUS_POSIX_TRAJECTORY_H
#define PELORUS_POSIX_TRAJECTORY_H

#include <stdio.h>

#include "pelorus/session.h"

/* TUM: `t x y z qx qy qz qw`, seconds and metres, the body in the world. */
void trajectory_put(FILE *file, const plr_pose_message *pose);

/* One row a frame, refused ones too (their estimate is empty). Columns: frames_put_titles. */
void frames_put_titles(FILE *file);

/* `trace` is that of the whole covariance, `bias_variance` 6 numbers. */
void frames_put(FILE *file, const plr_frame_result *result, double trace,
                const double *bias_variance);

/* Unit quaternion (x, y, z, w) of a rotation, with w >= 0. */
void rotation_quaternion(double q[4], const double R[9]);

#endif
