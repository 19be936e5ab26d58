// SPDX-License-Identifier: MIT
/*
 * A measurement: what a sensor's reading says of the state. A sensor makes one from a reading and the
 * present estimate; gate and correction know nothing else of it.
 *
 * There are always three rows. A sensor that measures fewer leaves the others at zero, with R = 1: a
 * row without H and r says nothing, and changes no bit of the result.
 */
#ifndef PLR_SENSOR_MEASUREMENT_H
#define PLR_SENSOR_MEASUREMENT_H

#include "state/rows.h"

typedef struct plr_measurement {
    plr_rows H;            /* how the rows depend on the state's error */
    plr_real r[PLR_ROWS];  /* measured minus predicted: H x + N(0, R) */
    plr_real R[PLR_ROWS];  /* variances of the noise, independent from row to row */
    plr_real extra_d2;     /* a squared distance that no state could change, in its own sigmas (of a
                                stereo pair, the two images' row difference) */
    plr_real residual2;    /* squared norm of the raw residuals, for the setting gate-residual */
    plr_real max_variance; /* a predicted row with a larger variance gives no basis for a
                                linearisation; 0: any does */
} plr_measurement;

#endif
