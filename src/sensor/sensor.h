// SPDX-License-Identifier: MIT
/*
 * The small sensors: a reading of one to three numbers. Each has a file of its own and a row in
 * sensors.def; docs/ADD-A-SENSOR.md adds one.
 */
#ifndef PLR_SENSOR_SENSOR_H
#define PLR_SENSOR_SENSOR_H

#include "pelorus/belief.h"
#include "pelorus/types.h"
#include "sensor/measurement.h"

/* A kind of sensor: one of the two functions, the other is NULL. The reading has been checked:
 * finite numbers, and a sigma above zero for each number that was measured. */
typedef struct plr_sensor_kind {
    /* For a sensor of the state: fills the rows at the present estimate. */
    void (*of_state)(const plr_belief *belief, const plr_reading *reading, plr_measurement *m);

    /* For a sensor of the body's twist (v, w): fills one or two times three rows, and returns how
     * many times. They are held in plr_velocities.held[place] and after it. */
    unsigned (*of_twist)(const plr_reading *reading, plr_twist_rows rows[2]);
    unsigned place;

    uint8_t axes;      /* numbers that it can measure: bits as in plr_reading.axes */
    double most_value; /* a larger value is an error of the sender; 0: there is no value */

    /* Of a sensor that measures where the body is: while these axes are all measured, the position
     * cannot drift away, and a dark camera alone is no LOST. 0: no such sensor. */
    uint8_t bounds_position;
} plr_sensor_kind;

/* The kind with this number (plr_sensor); NULL if there is none. */
const plr_sensor_kind *plr_sensor_of(unsigned sensor);

/* True if number i, 0 to 2, of the reading was measured. */
static inline bool plr_reading_has(const plr_reading *reading, unsigned i) {
    return (reading->axes >> i & 1U) != 0;
}

#define SENSOR(number, kind, about) extern const plr_sensor_kind kind;
#include "sensor/sensors.def"
#undef SENSOR

#endif
