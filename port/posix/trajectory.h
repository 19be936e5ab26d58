// SPDX-License-Identifier: MIT
/* The replay's results as text files. A NULL file is left alone. */
#ifndef PELORUS_POSIX_TRAJECTORY_H
#define PELORUS_POSIX_TRAJECTORY_H

#include <stdio.h>

#include "pelorus/session.h"

/* TUM: `t x y z qx qy qz qw`, seconds and metres, the body in the world. */
void trajectory_put(FILE *file, const plr_pose_message *pose);

/* Unit quaternion (x, y, z, w) of a rotation, with w >= 0. */
void rotation_quaternion(double q[4], const double R[9]);

#endif
