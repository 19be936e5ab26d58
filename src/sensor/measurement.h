// SPDX-License-Identifier: MIT
/*
 * A measurement: the linearised form of a sensor's reading. Gate and correction know nothing else
 * about a sensor.
 *
 * There are always three rows. A sensor that measures fewer numbers leaves the other rows of H and
 * r zero, with R = 1: such a row has no effect on any bit of the result.
 */
#ifndef PLR_SENSOR_MEASUREMENT_H
#define PLR_SENSOR_MEASUREMENT_H

#include <stdbool.h>

#include "state/rows.h"

typedef struct plr_measurement {
    plr_rows H;           /* derivative by the state's error */
    plr_real r[PLR_ROWS]; /* measured minus predicted: H x + N(0, R) */
    plr_real R[PLR_ROWS]; /* variances of the noise, independent from row to row */

    /* Of a wheel's reading: r is H x + by_wheel s + noise, s the errors of the wheels. */
    plr_by_wheel by_wheel;
    bool of_wheel;

    /* Added to d^2 in the gate: a squared error, in units of sigma^2, that does not depend on the
     * state (of a stereo pair, the gap between its rows). */
    plr_real extra_d2;

    /* Squared norm of the raw residuals, for the setting gate-residual. */
    plr_real residual2;

    /* The measurement is rejected if the variance of a predicted row is larger, because a
     * linearisation would be wrong there. 0: no limit. */
    plr_real max_variance;
} plr_measurement;

#endif
