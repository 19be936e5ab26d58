// SPDX-License-Identifier: MIT
/*
 * Do the readings of a small sensor agree with the estimate, as their sigma says? One that is off by
 * two sigma passes the gate, and pulls the pose each time.
 */
#ifndef PLR_FILTER_READINGS_H
#define PLR_FILTER_READINGS_H

#include "pelorus/state.h"

/* Nothing is known of any sensor. */
void plr_readings_clear(plr_filter *f);

/* Adds a reading that was used or rejected, with its squared distance d2 from what was expected. */
void plr_readings_add(plr_filter *f, const plr_reading *reading, bool used, plr_real d2);

/* By how much the variance of the sensor's readings is larger than stated, 1 or more: what they differ
 * from the estimate by says so while they are off. */
plr_real plr_readings_widening(const plr_filter *f, unsigned sensor);

/* True if ten in succession were rejected, or if readings are off, of any sensor. */
bool plr_readings_are_wrong(const plr_filter *f);

/* True if a reading of the state is the sensor's last one again, of the same time: it says nothing
 * new. (One of the twist takes the place of the last.) */
bool plr_readings_repeats(const plr_filter *f, const plr_reading *reading);

#endif
