// SPDX-License-Identifier: MIT
#include "posix/trajectory.h"

#include <inttypes.h>
#include <math.h>

/* The four squared components of the quaternion times four; the largest is taken as the pivot, so
 * that nothing is divided by a small number (Shepperd 1978). */
void rotation_quaternion(double q[4], const double R[9]) {
    const double trace = R[0] + R[4] + R[8];
    const double squares[4] = {1 + 2 * R[0] - trace, 1 + 2 * R[4] - trace, 1 + 2 * R[8] - trace,
                               1 + trace};
    int pivot = 0;
    for (int i = 1; i < 4; i++)
        if (squares[i] > squares[pivot])
            pivot = i;
    const double xy = R[1] + R[3], xz = R[2] + R[6], yz = R[5] + R[7];
    const double wx = R[7] - R[5], wy = R[2] - R[6], wz = R[3] - R[1];
    const double rows[4][4] = {{squares[0], xy, xz, wx},
                               {xy, squares[1], yz, wy},
                               {xz, yz, squares[2], wz},
                               {wx, wy, wz, squares[3]}};
    double norm = 0;
    for (int i = 0; i < 4; i++)
        norm += rows[pivot][i] * rows[pivot][i];
    const double scale = (rows[pivot][3] < 0 ? -1 : 1) / sqrt(norm);
    for (int i = 0; i < 4; i++)
        q[i] = rows[pivot][i] * scale;
}

/* Seconds without a rounding: a double holds no nanoseconds of this century. */
static void put_time(FILE *file, plr_time_ns t_ns) {
    fprintf(file, "%" PRIu64 ".%09" PRIu64, t_ns / 1000000000u, t_ns % 1000000000u);
}

void trajectory_put(FILE *file, const plr_pose_message *pose) {
    double q[4];
    if (file == NULL)
        return;
    rotation_quaternion(q, pose->T_WB.R);
    put_time(file, pose->t_ns);
    for (int i = 0; i < 3; i++)
        fprintf(file, " %.9g", pose->T_WB.p[i]);
    for (int i = 0; i < 4; i++)
        fprintf(file, " %.9g", q[i]);
    fputc('\n', file);
}
