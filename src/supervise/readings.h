// SPDX-License-Identifier: MIT
/* Do the readings of a small sensor agree with the estimate, as their sigma says? One that is off by two
 * sigma passes the gate, and pulls the pose each time. */
#ifndef PLR_SUPERVISE_READINGS_H
#define PLR_SUPERVISE_READINGS_H

#include <string.h>

#include "pelorus/supervisor.h"

/* Nothing is known of any sensor. */
static inline void plr_sensors_forget(plr_supervisor *s) {
    memset(s->sensors, 0, sizeof s->sensors);
    for (unsigned i = 0; i < PLR_SENSORS; i++)
        s->sensors[i].t_ns = PLR_NEVER_NS;
}

/* The last reading of its sensor. */
static inline void plr_sensors_note(plr_supervisor *s, const plr_reading *reading) {
    plr_sensor_record *of = &s->sensors[reading->sensor - 1];
    of->t_ns = reading->t_ns;
    memcpy(of->value, reading->value, sizeof of->value);
}

/* Adds a reading of so many numbers that was used or rejected, with its squared distance d2 from what was
 * expected. */
void plr_sensors_add(plr_supervisor *s, const plr_reading *reading, unsigned numbers, bool used,
                     plr_real d2);

/* True if ten in succession were rejected, or if readings are off, of any sensor. */
bool plr_sensors_are_wrong(const plr_supervisor *s);

#endif
