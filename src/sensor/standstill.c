// SPDX-License-Identifier: MIT
/* The body does not move: v = 0 with sigma[0], m/s, and w = 0 with sigma[1], rad/s, each if `axes` has
 * its bit. */
#include <string.h>

#include "sensor/sensor.h"

static unsigned measure(const plr_reading *reading, plr_twist_rows rows[2]) {
    memset(rows, 0, 2 * sizeof *rows);
    for (unsigned part = 0; part < 2; part++)
        for (unsigned i = 0; i < PLR_ROWS; i++) {
            const bool measured = plr_reading_has(reading, part);
            rows[part].R[i] =
                measured ? (plr_real)(reading->sigma[part] * reading->sigma[part]) : PLR_R(1);
            rows[part].M[PLR_POSE_DIM * i + 3 * part + i] = measured ? PLR_R(1) : PLR_R(0);
        }
    return 2;
}

const plr_sensor_kind plr_standstill = {"standstill", NULL, measure, 1};
