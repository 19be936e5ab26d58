// SPDX-License-Identifier: MIT
/* The replay's results as text files. A NULL file is left alone. */
#ifndef PELORUS_POSIX_TABLES_H
#define PELORUS_POSIX_TABLES_H

#include <stdio.h>

#include "pelorus/session.h"
#include "posix/samples.h"

/* TUM: `t x y z qx qy qz qw`, seconds and metres, the body in the world. */
void trajectory_put(FILE *file, const plr_pose_message *pose);

/* One row a frame, refused ones too (their estimate is empty). Columns: frames_put_titles. */
void frames_put_titles(FILE *file);

/* `trace` is that of the whole covariance, `bias_variance` 6 numbers. */
void frames_put(FILE *file, const plr_frame_result *result, double trace,
                const double *bias_variance);

/* PLY, ASCII: plr_landmark_message items, with id, role, times seen and standard deviation. */
void map_put(FILE *file, const samples *landmarks);

#endif
