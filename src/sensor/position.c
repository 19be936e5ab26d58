// SPDX-License-Identifier: MIT
/* The position of a point l of the body in the world, z = p_WB + R_WB l: GNSS in local metres,
 * motion capture, a beacon; with axes = 4 a height alone. */
#include <string.h>

#include "math/small.h"
#include "sensor/sensor.h"
#include "state/blocks.h"
#include "state/pose.h"

static void measure(const plr_belief *belief, const plr_reading *reading, plr_measurement *m) {
    plr_real l[3], arm[3], J[PLR_ROWS * PLR_POSE_DIM];
    for (unsigned i = 0; i < 3; i++)
        l[i] = (plr_real)reading->at_B_m[i];
    plr_mat3_vec(arm, belief->R_WB, l);
    plr_world_by_pose(belief->R_WB, l, J);
    plr_real *H = plr_rows_add(&m->H, plr_row_of(belief, PLR_BLOCK_POSE), PLR_POSE_DIM);
    for (unsigned i = 0; i < PLR_ROWS; i++) {
        if (!plr_reading_has(reading, i))
            continue;
        memcpy(H + PLR_POSE_DIM * i, J + PLR_POSE_DIM * i, PLR_POSE_DIM * sizeof *J);
        m->r[i] = (plr_real)(reading->value[i] - belief->p_WB[i] - (double)arm[i]);
        m->R[i] = (plr_real)(reading->sigma[i] * reading->sigma[i]);
    }
}

const plr_sensor_kind plr_position = {
    .of_state = measure, .axes = 7, .most_value = 1e9, .bounds_position = 3};
