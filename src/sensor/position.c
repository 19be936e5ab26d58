// SPDX-License-Identifier: MIT
/* The position of a point l of the body in the world, z = p_WB + R_WB l: GNSS in local metres,
 * motion capture, a beacon; with axes = 4 a height alone. */
#include <string.h>

#include "math/small.h"
#include "sensor/sensor.h"
#include "state/blocks.h"
#include "state/model.h"
#include "state/motion.h"

/* A place is p + R (rho + theta x rho / 2 + ...): where a height alone is measured and neither place nor
 * tilt is known, the second order moves it by more than a sigma, and as a measurement of tilt and place
 * it would be wrong. This is its variance, of the axes that are not measured: the others are known
 * when the reading is used. */
static plr_real second_order(const plr_filter *f, const plr_reading *reading) {
    plr_real P[PLR_POSE_SQUARE], way = 0, turn = 0;
    plr_motion_pose_covariance(f, P);
    for (unsigned axis = 0; axis < 3; axis++) {
        plr_real row[3] = {0};
        turn += P[(PLR_POSE_DIM + 1) * (3 + axis)];
        if (plr_reading_has(reading, axis))
            continue;
        for (unsigned i = 0; i < 3; i++)
            for (unsigned j = 0; j < 3; j++)
                row[i] = PLR_FMA(P[PLR_POSE_DIM * i + j], f->R_WB[3 * axis + j], row[i]);
        way += plr_dot3(row, f->R_WB + 3 * axis);
    }
    return PLR_R(0.25) * way * turn;
}

static void measure(const plr_filter *f, const plr_reading *reading, plr_measurement *m) {
    plr_real l[3], arm[3], J[PLR_ROWS * PLR_POSE_DIM];
    plr_term *pose = &m->H.term[0];
    const plr_real more = second_order(f, reading);
    for (unsigned i = 0; i < 3; i++)
        l[i] = (plr_real)reading->at_B_m[i];
    plr_mat3_vec(arm, f->R_WB, l);
    plr_world_by_pose(f->R_WB, l, J);
    m->H.terms = 1;
    pose->row = plr_row_of(f, PLR_BLOCK_POSE);
    pose->columns = PLR_POSE_DIM;
    for (unsigned i = 0; i < PLR_ROWS; i++) {
        if (!plr_reading_has(reading, i))
            continue;
        memcpy(pose->H + PLR_POSE_DIM * i, J + PLR_POSE_DIM * i, PLR_POSE_DIM * sizeof *J);
        m->r[i] = (plr_real)(reading->value[i] - f->p_WB[i] - (double)arm[i]);
        m->R[i] = (plr_real)(reading->sigma[i] * reading->sigma[i]) + more;
    }
}

const plr_sensor_kind plr_position = {
    .of_state = measure, .axes = 7, .most_value = 1e9, .bounds_position = 3};
