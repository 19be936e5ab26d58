// SPDX-License-Identifier: MIT
/* The velocity of a point l of the body, along the body's axes: z = v + w x l. A driven wheel
 * measures x; one that cannot slip sideways, y too. */
#include <string.h>

#include "math/small.h"
#include "sensor/sensor.h"

static unsigned measure(const plr_reading *reading, plr_twist_rows rows[2]) {
    plr_real l[3], L[9];
    for (unsigned i = 0; i < 3; i++)
        l[i] = (plr_real)reading->at_B_m[i];
    plr_skew(L, l);
    memset(rows, 0, sizeof *rows);
    for (unsigned i = 0; i < PLR_ROWS; i++) {
        plr_real *M = rows->M + PLR_POSE_DIM * i;
        rows->R[i] = 1;
        if (!plr_reading_has(reading, i))
            continue;
        rows->z[i] = (plr_real)reading->value[i];
        rows->R[i] = (plr_real)(reading->sigma[i] * reading->sigma[i]);
        M[i] = 1; /* v */
        for (unsigned j = 0; j < 3; j++)
            M[3 + j] = -L[3 * i + j]; /* w x l = -[l]x w */
    }
    return 1;
}

const plr_sensor_kind plr_wheel = {.of_twist = measure, .place = 0, .axes = 7, .most_value = 1e4};
